from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from evaluation.detection.drawn_detections import CLASSES, SIZE_PX, picture, random_scenes

from standoff.core.camera import Camera
from standoff.core.pose import View
from standoff.core.types import Detections
from standoff.evaluation.detection import score_detections
from standoff.evaluation.detection.points import score_points
from standoff.labels.types import LabelledPicture
from standoff.labels.views import GroundView, view_line, views_of

_CAMERA = Camera(*SIZE_PX, np.array([[600.0, 0, 320], [0, 600.0, 240], [0, 0, 1]]), np.zeros(5))
_HEIGHT_M = 30.0
_FROM_ABOVE = GroundView(View.aimed(_CAMERA, np.array([5.0, 7.0, _HEIGHT_M]), heading_deg=20.0, pitch_deg=90.0), 0.0)
"""Straight down: every pixel is 5 cm wide."""


def _with_points(
    seed: int, sigma_px: float, stated_px: float, pictures: int = 60
) -> tuple[list[LabelledPicture], list[Detections]]:
    """True boxes as detections; their points are off by a normal error and say how much they think that is."""
    rng = np.random.default_rng(seed)
    truth = [one for one in random_scenes(seed, pictures)[0] if not one.ignored.all()]
    truth = [replace(one, foot_px=one.xyxy_px[:, 2:] - rng.uniform(0, 9, (len(one.xyxy_px), 2))) for one in truth]
    found = []
    for one in truth:
        real = ~one.ignored
        count = int(real.sum())
        found.append(
            Detections(
                one.xyxy_px[real], rng.uniform(0.5, 1.0, count), one.class_id[real],
                one.foot_px[real] + rng.normal(0.0, sigma_px, (count, 2)),
                np.tile(stated_px**2 * np.eye(2), (count, 1, 1)),
            )
        )  # fmt: skip
    return truth, found


@pytest.mark.parametrize("seed", range(3))
def test_errors_are_measured_in_pixels_box_heights_and_metres(seed: int) -> None:
    truth, found = _with_points(seed, 4.0, 4.0)
    views = dict.fromkeys(range(len(truth)), _FROM_ABOVE)
    scores = score_points(score_detections(truth, found, CLASSES), views)
    assert [one.name for one in scores.classes] == list(CLASSES)
    for one, bands in zip(scores.classes, scores.by_height, strict=True):
        # Half of the distances of a plane's normal errors are under 1.177 of them, 19 of 20 under 2.448.
        assert one.median_px == pytest.approx(1.177 * 4.0, rel=0.25)
        assert one.p95_px == pytest.approx(2.448 * 4.0, rel=0.3)
        assert one.median_m == pytest.approx(one.median_px * _HEIGHT_M / 600.0, rel=1e-6)
        assert 0.85 < one.inside <= 1.0
        assert one.anchor_median_m > 0.0
        assert sum(band.count for band in bands) <= one.count
        assert bands[0].median_heights > bands[-1].median_heights


@pytest.mark.parametrize(("stated_px", "least", "most"), [(1.0, 0.0, 0.35), (16.0, 0.995, 1.0)])
def test_points_that_are_too_sure_or_too_shy_are_found_out(stated_px: float, least: float, most: float) -> None:
    truth, found = _with_points(5, 4.0, stated_px)
    scores = score_points(score_detections(truth, found, CLASSES), {})
    assert all(least <= one.inside <= most for one in scores.classes)
    assert all(math.isnan(one.median_m) for one in scores.classes), "no camera, no metres"


def test_without_points_or_without_marks_there_is_nothing_to_score() -> None:
    truth, found = _with_points(1, 4.0, 4.0)
    unmarked = [replace(one, foot_px=np.full_like(one.foot_px, np.nan)) for one in truth]
    plain = [Detections(one.xyxy_px, one.score, one.class_id) for one in found]
    for pictures, detections in ((unmarked, found), (truth, plain)):
        assert score_points(score_detections(pictures, detections, CLASSES), {}).classes == ()


def test_wrong_detections_have_no_say() -> None:
    one = replace(picture([[10.0, 10.0, 50.0, 60.0]]), foot_px=np.array([[30.0, 58.0]]))
    boxes = np.array([[10.0, 10.0, 50.0, 60.0], [300.0, 10.0, 350.0, 60.0]])
    feet, covariance = np.array([[31.0, 58.0], [999.0, 999.0]]), np.tile(np.eye(2), (2, 1, 1))
    found = Detections(boxes, np.array([0.9, 0.8]), np.zeros(2, np.int64), feet, covariance)
    (worker,) = score_points(score_detections([one], [found], CLASSES), {}).classes
    assert (worker.count, worker.median_px, worker.inside) == (1, 1.0, 1.0)
    assert worker.median_heights == pytest.approx(0.02)


def test_views_are_found_by_the_pictures_of_their_sets(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "views.jsonl").write_text(view_line("1.jpg", _FROM_ABOVE))
    pictures = [tmp_path / "a" / "images" / "test" / "1.jpg", tmp_path / "b" / "images" / "1.jpg", Path("1.jpg")]
    assert list(views_of(pictures)) == [0]
