"""A survey holds for a camera that stands as it was surveyed, and for no other."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
import pytest
from drawn_ground import frame
from tolerances import CARRIED_SURVEY_PX

from standoff.core.homography import FloatArray
from standoff.core.types import Detections, GroundMap, ImageArray, NoGroundMap
from standoff.stages.ground import FixedCamera, SurveyedGround
from standoff.stages.ground.fixed_camera import MOVED, OUT_OF_SIGHT
from standoff.stages.motion import MotionEstimator

SIZE_PX = (640, 360)
POINTS_PX = np.array([[60.0, 330.0], [600.0, 340.0], [500.0, 120.0], [120.0, 110.0]])
POINTS_M = np.array([[-5.0, 0.0], [5.0, 0.0], [6.0, 20.0], [-6.0, 20.0]])
FPS = 10.0


def soil(seed: int, size_px: tuple[int, int] = (1600, 900)) -> ImageArray:
    """Ground with texture at all scales."""
    rng = np.random.default_rng(seed)
    gray = np.full(size_px[::-1], 110.0, np.float32)
    for cells in (20, 60, 200):
        coarse = rng.normal(0.0, 18.0, (cells * size_px[1] // size_px[0], cells)).astype(np.float32)
        gray += cv2.resize(coarse, size_px, interpolation=cv2.INTER_CUBIC)
    return np.clip(gray, 0, 255).astype(np.uint8)


def view(ground: ImageArray, picture_to_soil: FloatArray, noise_seed: int = 0) -> ImageArray:
    """What a camera sees of it."""
    gray = cv2.warpPerspective(ground, picture_to_soil, SIZE_PX, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    noisy = gray + np.random.default_rng(noise_seed).normal(0.0, 2.0, gray.shape)
    seen: ImageArray = np.clip(noisy, 0, 255).astype(np.uint8)
    return seen


def shifted(x_px: float, y_px: float = 0.0, turn_rad: float = 0.0) -> FloatArray:
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    return np.array([[c, -s, 400.0 + x_px], [s, c, 250.0 + y_px], [0.0, 0.0, 1.0]])


def watch(pictures: Iterable[ImageArray | None], fps: float = FPS) -> tuple[list[GroundMap | NoGroundMap], FixedCamera]:
    """Return the map of each picture; None is a blank one."""
    ground, estimator = FixedCamera(SurveyedGround(POINTS_PX, POINTS_M, SIZE_PX)), MotionEstimator()
    maps = []
    for k, picture in enumerate(pictures):
        shown = np.full(SIZE_PX[::-1], 30, np.uint8) if picture is None else picture
        now = frame(shown, k / fps)
        maps.append(ground.update(now, Detections.empty(), estimator.update(now, Detections.empty())))
    return maps, ground


def misplaced_px(found: GroundMap, picture_to_soil: FloatArray, first: FloatArray) -> float:
    """How far, in pixels, the surveyed places are from where the picture shows them."""
    truth = np.linalg.inv(picture_to_soil) @ first
    shown_px = cv2.perspectiveTransform(POINTS_PX[None], truth)[0]
    places_px, _ = found.to_image(POINTS_M)
    return float(np.linalg.norm(places_px - shown_px, axis=1).max())


@pytest.mark.parametrize("seed", [1, 2])
def test_a_camera_that_stands_still_keeps_its_map(seed: int) -> None:
    ground = soil(seed)
    maps, stage = watch(view(ground, shifted(0.0), k) for k in range(12))
    assert all(one is maps[0] for one in maps)
    assert stage.describe()["warnings"] == []


@pytest.mark.parametrize(("pan_px", "turn_rad"), [(3.0, 0.0), (-2.0, 0.004), (0.0, -0.01)])
def test_a_slow_pan_carries_the_map_and_is_a_warning(pan_px: float, turn_rad: float) -> None:
    ground, first = soil(3), shifted(0.0)
    poses = [shifted(pan_px * k, 0.3 * pan_px * k, turn_rad * k) for k in range(16)]
    maps, stage = watch(view(ground, pose, k) for k, pose in enumerate(poses))
    for found, pose in zip(maps, poses, strict=True):
        assert isinstance(found, GroundMap)
        assert misplaced_px(found, pose, first) < CARRIED_SURVEY_PX
    assert any(MOVED in warning for warning in stage.describe()["warnings"])


def test_once_much_has_left_the_picture_there_is_no_map() -> None:
    ground = soil(4)
    maps, _ = watch(view(ground, shifted(12.0 * k), k) for k in range(30))
    assert isinstance(maps[5], GroundMap)
    assert isinstance(maps[-1], NoGroundMap) and maps[-1].reason == MOVED
    # Back again: the first picture is found.
    maps, _ = watch(view(ground, shifted(12.0 * (20 - abs(k - 20))), k) for k in range(41))
    assert isinstance(maps[20], NoGroundMap)
    assert isinstance(maps[-1], GroundMap)
    assert misplaced_px(maps[-1], shifted(0.0), shifted(0.0)) < CARRIED_SURVEY_PX


def test_a_cut_ends_the_map_at_once_and_the_old_view_brings_it_back() -> None:
    here, there = soil(5), soil(6)
    pictures = [view(here, shifted(0.0), k) for k in range(5)]
    pictures += [view(there, shifted(0.0), k) for k in range(30)]
    pictures += [view(here, shifted(0.0), k) for k in range(12)]
    maps, stage = watch(pictures)
    assert all(isinstance(one, GroundMap) for one in maps[:5])
    assert all(isinstance(one, NoGroundMap) and one.reason == MOVED for one in maps[5:35])
    assert isinstance(maps[-1], GroundMap)
    assert any(MOVED in warning for warning in stage.describe()["warnings"])


def test_a_lorry_before_the_lens_hides_the_background_for_a_while() -> None:
    ground = soil(7)
    pictures: list[ImageArray | None] = [view(ground, shifted(0.0), k) for k in range(5)]
    pictures += [None] * 40
    pictures += [view(ground, shifted(0.0), k) for k in range(12)]
    maps, _ = watch(pictures)
    hidden = maps[5:45]
    assert all(isinstance(one, GroundMap) and one.age_s > 0 for one in hidden[:9])
    assert all(isinstance(one, NoGroundMap) and one.reason in (OUT_OF_SIGHT, MOVED) for one in hidden[12:])
    assert isinstance(maps[-1], GroundMap) and maps[-1].age_s == 0.0


def test_where_nothing_can_be_seen_of_the_ground_the_map_holds_with_a_warning() -> None:
    maps, stage = watch([None] * 20)
    assert all(one is maps[0] for one in maps)
    assert "too little to tell" in stage.describe()["warnings"][0]


def test_a_change_of_resolution_is_a_move() -> None:
    ground, estimator = FixedCamera(SurveyedGround(POINTS_PX, POINTS_M, SIZE_PX)), MotionEstimator()
    small = view(soil(8), shifted(0.0))
    for k, picture in enumerate([small, small, cv2.resize(small, (1280, 720)), cv2.resize(small, (1280, 720))]):
        now = frame(picture, k / FPS)
        found = ground.update(now, Detections.empty(), estimator.update(now, Detections.empty()))
    assert isinstance(found, NoGroundMap) and found.reason == MOVED
