from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.core.homography import FloatArray
from standoff.core.types import Detections
from standoff.stages.detect.suppression import join_cut, prefer_finer, suppress


def _random_detections(seed: int, count: int) -> Detections:
    random = np.random.default_rng(seed)
    corner = random.uniform(0, 60, (count, 2))
    xyxy_px = np.concatenate([corner, corner + random.uniform(10, 40, (count, 2))], axis=1)
    return Detections(xyxy_px, random.uniform(0.01, 1, count), random.integers(0, 3, count))


@given(st.integers(0, 10**6), st.integers(1, 60), st.sampled_from([0.1, 0.45, 0.8]))
def test_suppression_keeps_what_opencv_keeps_class_by_class(seed: int, count: int, iou: float) -> None:
    detections = _random_detections(seed, count)
    expected: set[float] = set()
    for class_id in range(3):
        own = detections[detections.class_id == class_id]
        xywh = np.concatenate([own.xyxy_px[:, :2], own.xyxy_px[:, 2:] - own.xyxy_px[:, :2]], axis=1)
        kept = cv2.dnn.NMSBoxes(xywh.tolist(), own.score.tolist(), 0.0, iou)
        expected |= set(own.score[np.asarray(kept, dtype=np.int64)])
    kept_scores = suppress(detections, iou, 1000).score
    assert set(kept_scores) == expected
    assert (np.diff(kept_scores) <= 0).all()


Box = tuple[float, float, float, float]


def _detections(boxes: list[Box], score: list[float], class_id: list[int]) -> Detections:
    return Detections(np.array(boxes), np.array(score), np.array(class_id, dtype=np.int64))


def test_suppression_keeps_the_surest_up_to_the_limit() -> None:
    detections = _detections([(0, 0, 9, 9), (20, 0, 29, 9), (40, 0, 49, 9)], [0.2, 0.9, 0.5], [0, 0, 0])
    np.testing.assert_array_equal(suppress(detections, 0.45, 2).score, [0.9, 0.5])


def test_suppressing_nothing_gives_nothing() -> None:
    assert len(suppress(Detections.empty(), 0.45, 10)) == 0


WHOLE = (10.0, 10.0, 110.0, 60.0)
LEFT_PIECE = (10.0, 12.0, 70.0, 59.0)
RIGHT_PIECE = (50.0, 10.0, 110.0, 60.0)


def test_a_whole_box_takes_in_its_pieces_and_their_score() -> None:
    pieces = _detections([LEFT_PIECE, WHOLE, RIGHT_PIECE], [0.9, 0.3, 0.8], [1, 1, 1])
    joined = join_cut(pieces, np.array([True, False, True]), 0.6)
    np.testing.assert_array_equal(joined.xyxy_px, [WHOLE])
    assert joined.score[0] == 0.9


def test_two_pieces_without_a_whole_become_one_box() -> None:
    left, right = (10.0, 12.0, 80.0, 59.0), (35.0, 10.0, 110.0, 60.0)
    joined = join_cut(_detections([left, right], [0.4, 0.8], [1, 1]), np.array([True, True]), 0.6)
    np.testing.assert_array_equal(joined.xyxy_px, [WHOLE])
    assert joined.score[0] == 0.8


@pytest.mark.parametrize(
    ("cut", "classes"),
    [
        pytest.param((False, False), [0, 0], id="a worker in front of another, both whole"),
        pytest.param((True, False), [0, 0], id="only the larger one is cut"),
        pytest.param((False, True), [1, 0], id="a cut worker in front of a machine"),
    ],
)
def test_what_is_no_piece_of_the_larger_box_stays(cut: tuple[bool, bool], classes: list[int]) -> None:
    boxes = _detections([WHOLE, (20.0, 20.0, 40.0, 50.0)], [0.9, 0.8], classes)
    assert len(join_cut(boxes, np.array(cut), 0.6)) == 2


def test_a_piece_that_hardly_overlaps_stays() -> None:
    boxes = _detections([WHOLE, (100.0, 10.0, 140.0, 60.0)], [0.9, 0.8], [0, 0])
    assert len(join_cut(boxes, np.array([False, True]), 0.6)) == 2


def test_joining_nothing_gives_nothing() -> None:
    assert len(join_cut(Detections.empty(), np.zeros(0, np.bool_), 0.6)) == 0


COARSE, FINE, NEIGHBOUR = (10.0, 10.0, 20.0, 30.0), (13.0, 14.0, 23.0, 38.0), (21.0, 10.0, 31.0, 30.0)


def test_a_coarse_box_gives_way_to_the_finer_box_of_the_same_thing_and_leaves_its_score() -> None:
    detections = _detections([COARSE, FINE, NEIGHBOUR], [0.9, 0.5, 0.4], [0, 0, 0])
    preferred, kept = prefer_finer(detections, np.array([True, False, True]), np.array([False, True, False]), 0.2)
    assert kept.tolist() == [False, True, True], "the neighbour overlaps the finer box by less"
    np.testing.assert_array_equal(preferred.score, [0.9, 0.9, 0.4])
    np.testing.assert_array_equal(preferred.xyxy_px, detections.xyxy_px)


@pytest.mark.parametrize(
    ("is_coarse", "is_fine", "classes"),
    [
        pytest.param((True, False), (False, True), [0, 1], id="of another class"),
        pytest.param((True, False), (False, False), [0, 0], id="no box is fine"),
        pytest.param((False, False), (False, True), [0, 0], id="no box is coarse"),
    ],
)
def test_nothing_else_gives_way(is_coarse: tuple[bool, bool], is_fine: tuple[bool, bool], classes: list[int]) -> None:
    detections = _detections([COARSE, FINE], [0.9, 0.5], classes)
    preferred, kept = prefer_finer(detections, np.array(is_coarse), np.array(is_fine), 0.2)
    assert kept.all()
    np.testing.assert_array_equal(preferred.score, [0.9, 0.5])


@given(st.integers(0, 10**6), st.integers(0, 40))
def test_what_gives_way_overlaps_a_finer_box_that_is_at_least_as_sure_afterwards(seed: int, count: int) -> None:
    detections = _random_detections(seed, count)
    is_coarse = np.random.default_rng(seed).random(count) < 0.5
    preferred, kept = prefer_finer(detections, is_coarse, ~is_coarse, 0.2)
    assert kept[~is_coarse].all()
    for index in np.flatnonzero(is_coarse):
        own = ~is_coarse & (detections.class_id == detections.class_id[index])
        iou = [_iou(detections.xyxy_px[index], box) for box in detections.xyxy_px[own]]
        assert kept[index] == (max(iou, default=0.0) < 0.2)
        if not kept[index]:
            assert preferred.score[own][int(np.argmax(iou))] >= detections.score[index]


def _iou(one: FloatArray, other: FloatArray) -> float:
    width = max(0.0, min(one[2], other[2]) - max(one[0], other[0]))
    height = max(0.0, min(one[3], other[3]) - max(one[1], other[1]))
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (one, other)]
    return float(width * height / (sum(areas) - width * height))
