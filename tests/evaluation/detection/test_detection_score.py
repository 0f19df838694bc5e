from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import tolerances
from evaluation.detection.drawn_detections import CLASSES, detections, picture, random_scenes
from hypothesis import given
from hypothesis import strategies as st
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from standoff.core.homography import FloatArray
from standoff.core.types import Detections
from standoff.evaluation.detection import Curve, score_detections
from standoff.labels import LabelledPicture

SEEDS = range(6)
BOX = [10.0, 10.0, 50.0, 90.0]
FAR = [300.0, 300.0, 340.0, 380.0]
counted = st.lists(st.tuples(st.integers(0, 5), st.booleans()), max_size=40)


def voc_ap11(matched_in_order: Sequence[bool], truths: int) -> float:
    """The definition of VOC 2007 word for word, in fractions."""
    right = wrong = 0
    points: list[tuple[Fraction, Fraction]] = []
    for matched in matched_in_order:
        right, wrong = right + matched, wrong + (not matched)
        points.append((Fraction(right, truths), Fraction(right, right + wrong)))
    best = [
        max((precision for recall, precision in points if recall >= Fraction(step, 10)), default=Fraction(0))
        for step in range(11)
    ]
    return float(sum(best) / 11)


def coco_precision(truth: list[LabelledPicture], found: list[Detections], recalls: FloatArray) -> FloatArray:
    """(recalls, classes) by pycocotools at IoU 0.5, from its own file formats."""
    images = [{"id": k + 1, "width": one.size_px[0], "height": one.size_px[1]} for k, one in enumerate(truth)]
    boxes: list[dict[str, Any]] = []
    for image, one in zip(images, truth, strict=True):
        for box, own, ignored in zip(one.xyxy_px, one.class_id, one.ignored, strict=True):
            for class_id in range(len(CLASSES)) if ignored else (own,):
                boxes.append(_coco(image, class_id, box) | {"iscrowd": int(ignored), "id": len(boxes) + 1})
    guesses = [
        _coco(image, class_id, box) | {"score": float(score)}
        for image, one in zip(images, found, strict=True)
        for box, score, class_id in zip(one.xyxy_px, one.score, one.class_id, strict=True)
    ]
    with contextlib.redirect_stdout(io.StringIO()):
        coco = COCO()
        categories = [{"id": k + 1, "name": name} for k, name in enumerate(CLASSES)]
        coco.dataset = {"info": {}, "images": images, "annotations": boxes, "categories": categories}
        coco.createIndex()
        evaluation = COCOeval(coco, coco.loadRes(guesses), "bbox")
        evaluation.params.iouThrs = np.array([0.5])
        evaluation.params.recThrs = recalls
        evaluation.evaluate()
        evaluation.accumulate()
    return np.asarray(evaluation.eval["precision"][0, :, :, 0, -1])


def _coco(image: dict[str, Any], class_id: int, box: FloatArray) -> dict[str, Any]:
    left, top, right, bottom = box.tolist()
    width, height = right - left, bottom - top
    return {
        "image_id": image["id"],
        "category_id": int(class_id) + 1,
        "bbox": [left, top, width, height],
        "area": width * height,
    }


@pytest.mark.parametrize("seed", SEEDS)
def test_matching_and_ap_are_those_of_pycocotools(seed: int) -> None:
    truth, found = random_scenes(seed)
    score = score_detections(truth, found, CLASSES)
    # A hair less, for COCO compares recalls such as 7 / 20 with 0.35000000000000003.
    theirs = coco_precision(truth, found, np.linspace(0.0, 1.0, 101) - 1e-9)
    for class_id, one in enumerate(score.classes):
        assert one.curve.interpolated(100) == pytest.approx(theirs[:, class_id], abs=tolerances.GEOMETRY_REL)
        steps = (np.arange(one.truths) + 0.5) / one.truths
        all_points = coco_precision(truth, found, steps)[:, class_id].mean()
        assert one.ap == pytest.approx(all_points, abs=tolerances.GEOMETRY_REL)


@given(counted, st.integers(1, 30))
def test_eleven_points_are_those_of_vocs_definition(rows: list[tuple[int, bool]], spare: int) -> None:
    score = np.linspace(1.0, 0.1, len(rows))
    matched = np.array([hit for _, hit in rows], dtype=np.bool_)
    truths = int(matched.sum()) + spare
    curve = Curve.of(score, matched, truths)
    assert curve.ap11() == pytest.approx(voc_ap11(matched.tolist(), truths), abs=tolerances.GEOMETRY_REL)


@given(counted, st.integers(1, 10), st.floats(0.05, 1.0))
def test_what_a_curve_says_of_thresholds_is_what_counting_says(
    rows: list[tuple[int, bool]], spare: int, precision: float
) -> None:
    score = np.array([level for level, _ in rows]) / 5.0
    matched = np.array([hit for _, hit in rows], dtype=np.bool_)
    truths = int(matched.sum()) + spare
    curve = Curve.of(score, matched, truths)
    allowed, best_f1 = [0.0], 0.0
    for threshold in np.unique(score):
        shown = score >= threshold
        right = int(matched[shown].sum())
        assert curve.at(float(threshold)) == pytest.approx((right / shown.sum(), right / truths))
        allowed += [right / truths] if right >= precision * shown.sum() else []
        best_f1 = max(best_f1, 2.0 * right / (shown.sum() + truths))
    assert curve.recall_at_precision(precision) == pytest.approx(max(allowed))
    best = curve.best_f1()
    if best is None:
        assert best_f1 == 0.0
    else:
        at_best, recall = curve.at(float(curve.score[best]))
        assert 2.0 * at_best * recall / (at_best + recall) == pytest.approx(best_f1)


@pytest.mark.parametrize("seed", SEEDS)
def test_who_finds_everything_exactly_is_perfect(seed: int) -> None:
    truth, _ = random_scenes(seed)
    found = [Detections(one.xyxy_px, np.full(len(one.xyxy_px), 0.7), one.class_id)[~one.ignored] for one in truth]
    score = score_detections(truth, found, CLASSES)
    assert (score.mean_ap11, score.mean_ap) == pytest.approx((1.0, 1.0))
    assert score.average_iou == pytest.approx(1.0)
    assert all((one.precision, one.recall, one.threshold) == (1.0, 1.0, 0.7) for one in score.classes)


@pytest.mark.parametrize("seed", SEEDS)
def test_asking_for_more_overlap_never_makes_a_detection_right(seed: int) -> None:
    truth, found = random_scenes(seed)
    rights = [
        sum(int(one.curve.right[-1]) for one in score_detections(truth, found, CLASSES, iou).classes)
        for iou in (0.3, 0.5, 0.7, 0.9)
    ]
    assert rights == sorted(rights, reverse=True)
    assert rights[0] > rights[-1]


@pytest.mark.parametrize("seed", SEEDS)
def test_the_order_in_which_boxes_are_listed_does_not_matter(seed: int) -> None:
    truth, found = random_scenes(seed)
    rng = np.random.default_rng(seed)
    shuffled = [one[rng.permutation(len(one))] for one in found]
    assert score_detections(truth, shuffled, CLASSES).to_dict() == score_detections(truth, found, CLASSES).to_dict()


def test_a_second_box_on_the_same_thing_is_a_false_alarm() -> None:
    score = score_detections([picture([BOX])], [detections([BOX, BOX], [0.6, 0.9])], CLASSES).of("worker")
    assert score.curve.right.tolist() == [1, 1]
    assert score.curve.wrong.tolist() == [0, 1]
    assert score.threshold == 0.9


def test_another_class_on_the_same_spot_finds_nothing() -> None:
    score = score_detections([picture([BOX])], [detections([BOX], [0.9], [1])], CLASSES)
    assert score.of("worker").ap11 == 0.0
    assert score.of("excavator").detections == 1


def test_what_lies_in_an_ignored_region_counts_neither_way_unless_it_finds_something() -> None:
    region = [0.0, 0.0, 200.0, 200.0]
    half_out = [120.0, 0.0, 330.0, 100.0]
    truth = [picture([region, BOX], [2, 0], [True, False])]
    found = [detections([BOX, [60.0, 60.0, 80.0, 90.0], half_out], [0.5, 0.9, 0.8])]
    score = score_detections(truth, found, CLASSES)
    worker = score.of("worker")
    assert (worker.truths, worker.detections) == (1, 2)
    assert worker.curve.score.tolist() == [0.8, 0.5]
    assert worker.curve.right.tolist() == [0, 1]
    assert score.of("vehicle").truths == 0


def test_a_class_without_truth_is_unknown_and_one_that_is_never_found_is_nought() -> None:
    truth = [picture([BOX, FAR], [0, 1])]
    found = [detections([BOX, FAR], [0.9, 0.4], [0, 2])]
    score = score_detections(truth, found, CLASSES)
    assert [one.ap11 for one in score.classes] == pytest.approx([1.0, 0.0, np.nan], nan_ok=True)
    assert score.mean_ap11 == pytest.approx(0.5)
    missed, unasked = score.of("excavator"), score.of("vehicle")
    assert (missed.recall, missed.recall_at_precision(0.8)) == (0.0, 0.0)
    assert np.isnan([missed.threshold, missed.precision, missed.average_iou, unasked.recall]).all()
    assert np.isnan(unasked.recall_at_precision(0.8))


def test_average_iou_is_over_what_is_right_at_the_best_threshold() -> None:
    shifted = [BOX[0] + 8.0, BOX[1], BOX[2] + 8.0, BOX[3]]
    truth = [picture([BOX, FAR])]
    unsure = [[600.0, 400.0 + k, 610.0, 420.0 + k] for k in range(9)]
    found = [detections([shifted, *unsure, FAR], [0.9, *[0.5] * 9, 0.1])]
    score = score_detections(truth, found, CLASSES)
    assert score.of("worker").threshold == 0.9
    assert score.average_iou == pytest.approx(32.0 / 48.0)


def test_pictures_without_anything_are_scored() -> None:
    score = score_detections([picture([]), picture([])], [Detections.empty(), detections([BOX], [0.3])], CLASSES)
    assert np.isnan([score.mean_ap11, score.average_iou]).all()
    assert score.of("worker").detections == 1
    assert np.isnan(score_detections([], [], CLASSES).mean_ap11)


def test_each_picture_needs_its_detections() -> None:
    with pytest.raises(ValueError, match=r"shorter|longer"):
        score_detections([picture([])], [], CLASSES)


def test_an_unknown_class_is_a_key_error() -> None:
    score = score_detections([picture([BOX])], [Detections.empty()], CLASSES)
    with pytest.raises(KeyError, match="crane"):
        score.of("crane")


def test_a_weight_in_training_changes_no_score() -> None:
    truth, found = random_scenes(0)
    heavy = [replace(one, weight=5.0) for one in truth]
    assert score_detections(heavy, found, CLASSES).mean_ap11 == score_detections(truth, found, CLASSES).mean_ap11
