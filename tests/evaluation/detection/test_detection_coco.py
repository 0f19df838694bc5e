from __future__ import annotations

import contextlib
import io
from importlib import util
from typing import Any

import numpy as np
import pytest
import tolerances
from evaluation.detection.drawn_detections import CLASSES, detections, picture, random_scenes
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from standoff.core.errors import MissingDependency
from standoff.core.types import Detections
from standoff.evaluation.detection.coco import HEIGHT_BANDS_PX, coco_figures
from standoff.labels import LabelledPicture


def official_stats(truth: list[LabelledPicture], found: list[Detections]) -> list[float]:
    """What COCO's own program prints first: AP, AP50, AP75, small, medium, large."""
    annotations: list[dict[str, Any]] = [
        {"image_id": k, "category_id": int(class_id), "bbox": [*box[:2], *(box[2:] - box[:2])], "iscrowd": 0}
        for k, one in enumerate(truth)
        for box, class_id in zip(one.xyxy_px, one.class_id, strict=True)
    ]
    for number, row in enumerate(annotations, start=1):
        row |= {"id": number, "area": row["bbox"][2] * row["bbox"][3]}
    guesses = np.array(
        [
            [k, *box[:2], *(box[2:] - box[:2]), score, class_id]
            for k, one in enumerate(found)
            for box, score, class_id in zip(one.xyxy_px, one.score, one.class_id, strict=True)
        ]
    )
    with contextlib.redirect_stdout(io.StringIO()):
        coco = COCO()
        coco.dataset = {
            "info": {},
            "images": [{"id": k} for k in range(len(truth))],
            "annotations": annotations,
            "categories": [{"id": k} for k in range(len(CLASSES))],
        }
        coco.createIndex()
        evaluation = COCOeval(coco, coco.loadRes(guesses), "bbox")
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
    return [float(value) for value in evaluation.stats[:6]]


@pytest.mark.parametrize("seed", range(4))
def test_the_figures_are_those_that_cocos_program_prints(seed: int) -> None:
    truth, found = random_scenes(seed, ignored_share=0.0)
    figures = coco_figures(truth, found, CLASSES)
    ours = [figures.mean(name) for name in ("ap", "ap50", "ap75", "ap_small", "ap_medium", "ap_large")]
    assert ours == pytest.approx(official_stats(truth, found), abs=tolerances.GEOMETRY_REL)


@pytest.mark.parametrize("height_px", [8.0, 14.9, 15.0, 29.0, 30.0, 59.0, 60.0, 300.0])
def test_a_thing_counts_in_the_band_of_its_height_alone(height_px: float) -> None:
    tall = [100.0, 50.0, 140.0, 50.0 + height_px]
    figures = coco_figures([picture([tall])], [detections([tall], [0.9])], CLASSES).classes[0]
    inside = [low <= height_px < high for low, high in HEIGHT_BANDS_PX]
    assert figures.truths_by_height == tuple(map(int, inside))
    assert figures.ap50_by_height == pytest.approx([1.0 if here else np.nan for here in inside], nan_ok=True)


def test_a_false_alarm_of_another_height_costs_a_band_nothing() -> None:
    small, large = [10.0, 10.0, 20.0, 30.0], [100.0, 100.0, 200.0, 300.0]
    truth, found = [picture([small])], [detections([large, small], [0.9, 0.5])]
    figures = coco_figures(truth, found, CLASSES).classes[0]
    assert figures.ap50 == pytest.approx(0.5)
    assert figures.ap50_by_height[1] == pytest.approx(1.0)


def test_classes_without_truth_do_not_enter_the_mean() -> None:
    box = [10.0, 10.0, 50.0, 90.0]
    figures = coco_figures([picture([box], [1])], [detections([box, box], [0.9, 0.8], [1, 0])], CLASSES)
    assert np.isnan(figures.classes[0].ap)
    assert figures.mean("ap") == pytest.approx(1.0)
    assert np.isnan(coco_figures([picture([])], [Detections.empty()], CLASSES).mean("ap"))


def test_without_pycocotools_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("standoff.evaluation.detection.coco.find_spec", lambda name: None)
    assert util.find_spec("pycocotools") is not None
    with pytest.raises(MissingDependency, match=r"standoff\[train\]"):
        coco_figures([picture([])], [Detections.empty()], CLASSES)
