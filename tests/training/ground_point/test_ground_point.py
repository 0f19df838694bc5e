"""Ground points are learnt, and their stated errors hold on what was not learnt from."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.core.types import Detections, ImageArray
from standoff.labels import LabelledPicture
from standoff.stages.detect import POINT_CLASSES, POINT_CROP_PX, find_model
from standoff.testing import ScriptedDetector
from standoff.training.ground_point import (
    Patches,
    PointTraining,
    as_found,
    measure_points,
    read_eyes,
    read_patches,
    train_points,
)
from standoff.training.ground_point.crops import PATCH_PX, boxed_crop, drawn_crop
from standoff.training.pictures.augment_params import AugmentParams

UNTOUCHED = replace(AugmentParams(), shadows=0.0, colour=0.0, blur=0.0, lost_detail=0.0, noise=0.0, jpeg=0.0)
EXCAVATOR = POINT_CLASSES.index("excavator")


def dots(count: int, seed: int) -> Patches:
    """Grey patches with a bright blob where the point is."""
    rng = np.random.default_rng(seed)
    images = rng.integers(60, 110, (count, PATCH_PX, PATCH_PX, 3)).astype(np.uint8)
    places_px = rng.uniform(0.3 * PATCH_PX, 0.7 * PATCH_PX, (count, 2))
    columns, rows = np.meshgrid(np.arange(PATCH_PX) + 0.5, np.arange(PATCH_PX) + 0.5)
    for image, (x, y) in zip(images, places_px, strict=True):
        image[(columns - x) ** 2 + (rows - y) ** 2 < 8**2] = 250
    return Patches(images, places_px / PATCH_PX, np.full(count, EXCAVATOR), np.full(count, 100.0))


def blob_middle(image: ImageArray) -> FloatArray:
    columns, rows = np.meshgrid(np.arange(POINT_CROP_PX) + 0.5, np.arange(POINT_CROP_PX) + 0.5)
    bright = image.max(axis=2) > 180
    return np.array([columns[bright].mean(), rows[bright].mean()]) / POINT_CROP_PX


def test_the_point_goes_with_what_is_seen() -> None:
    patches, rng = dots(60, 0), np.random.default_rng(1)
    compared = 0
    for image, point in zip(patches.images, patches.point, strict=True):
        boxed, place = boxed_crop(image, point)
        if np.abs(place - 0.5).max() < 0.35:
            np.testing.assert_allclose(blob_middle(boxed), place, atol=0.01)
            compared += 1
        drawn, place = drawn_crop(rng, image, point, UNTOUCHED)
        bright_px = np.argwhere(drawn.max(axis=2) > 180)
        # Where something bright was put before it, there is more than the blob.
        alone = len(bright_px) > 100 and np.ptp(bright_px, axis=0).max() < 22
        if np.abs(place - 0.5).max() < 0.35 and alone:
            np.testing.assert_allclose(blob_middle(drawn), place, atol=0.01)
            compared += 1
    assert compared > 40


@pytest.mark.live
def test_what_can_be_seen_is_learnt_and_its_errors_hold() -> None:
    plan = PointTraining(steps=250, batch=16, workers=0)
    network = train_points(dots(300, 2), read_eyes(find_model("site")), plan)
    (error,) = (one for one in measure_points(network, dots(200, 3)) if one.count)
    assert error.name == "excavator" and error.count == 200
    # Nothing but the middle would be off by a quarter of the side.
    assert error.median < 0.06
    told = measure_points(network, dots(200, 4))[EXCAVATOR]
    assert told.stretch == pytest.approx(error.stretch, rel=0.35)


def test_errors_are_those_of_what_a_detector_finds_in_the_boxes_in_which_it_does(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "site.png"), np.zeros((100, 200, 3), dtype=np.uint8))
    left_px = np.array([0.0, 40.0, 80.0, 120.0, 160.0])
    boxes_px = np.column_stack([left_px, np.full(5, 10.0), left_px + 20.0, np.full(5, 50.0)])
    classes = ("vehicle", "worker", "crane")
    picture = LabelledPicture(
        tmp_path / "site.png", (200, 100), boxes_px, np.array([1, 1, 0, 1, 2]),
        np.array([False, False, False, True, False]), "a", "b", foot_px=boxes_px[:, 2:],
    )  # fmt: skip
    worker, excavator = CLASS_BY_NAME["worker"].id, CLASS_BY_NAME["excavator"].id
    # The first is found loosely, the second too unsurely, the third as something else; the others are not asked for.
    found = Detections(boxes_px + 2.0, np.array([0.9, 0.2, 0.9, 0.9, 0.9]),
                       np.array([worker, worker, excavator, worker, worker]))  # fmt: skip
    seen = as_found(picture, classes, ScriptedDetector({0: found}))
    np.testing.assert_array_equal(seen.xyxy_px, boxes_px[:1] + 2.0)
    np.testing.assert_array_equal(seen.foot_px, boxes_px[:1, 2:])
    assert seen.class_id.tolist() == [1] and not seen.ignored.any()
    assert len(read_patches([seen], classes)) == 1


def test_what_has_no_point_teaches_nothing() -> None:
    empty = Patches(*(getattr(dots(2, 0), field.name)[:0] for field in fields(Patches)))
    with pytest.raises(DataError, match="ground points"):
        train_points(empty, read_eyes(find_model("site")), PointTraining(steps=1))
    assert len(read_patches([], ["worker"])) == 0
