"""Several things of known size at once: they agree, one was moved, or one contradicts the others."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from drawn_ground import frame
from drawn_solid import box_around, drawn_solids
from passing_camera import CAMERA, FPS, STILL, error_and_sigma, motion, seen, view

from standoff.core.camera import CameraPrior
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.telemetry import Telemetry
from standoff.core.types import Detections, ImageArray, NoGroundMap
from standoff.evaluation.drawn_markers import draw_marker
from standoff.stages.ground import (
    FusedGround,
    FusedParams,
    MarkerObserver,
    MarkerPlace,
    Reference,
    ReferenceParams,
    ReferenceShape,
    marker_pattern,
)
from standoff.stages.ground.reference_matching import WHICH
from standoff.stages.ground.solid import SolidState
from standoff.stages.ground.solid_choice import NOT_THERE

FIRST = ReferenceShape.rectangle(2.0, 2.89)
SECOND = ReferenceShape.rectangle(1.4, 1.9)
HEIGHTS_M = (0.4, 0.25)
STANDS = np.array([-4.2, 1.3])
"""Where the second reference's first corner lies, turned by a third of a right angle."""


def turned(shape: ReferenceShape, place_m: FloatArray, turn_deg: float = 30.0) -> ReferenceShape:
    turn = np.deg2rad(turn_deg)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return ReferenceShape.from_corners(shape.corners_m @ rotation.T + place_m)


def picture(k: int, *, first: bool = True, second: bool = True, place_m: FloatArray = STANDS) -> ImageArray:
    shown = [(FIRST, HEIGHTS_M[0])] * first + [(turned(SECOND, place_m), HEIGHTS_M[1])] * second
    return drawn_solids([(shape, SolidState(view(k), height)) for shape, height in shown], view(k), seed=k)


def boxes(k: int, *, first: bool = True, second: bool = True, place_m: FloatArray = STANDS) -> Detections:
    shown = [(FIRST, HEIGHTS_M[0])] * first + [(turned(SECOND, place_m), HEIGHTS_M[1])] * second
    found = np.array([box_around(shape, SolidState(view(k), height)) for shape, height in shown]).reshape(-1, 4)
    scores = np.linspace(0.9, 0.7, len(found))
    return Detections(found, scores, np.full(len(found), CLASS_BY_NAME["reference"].id))


def references(*, stated: bool = False) -> list[Reference]:
    params = ReferenceParams(size_sigma=0.0)
    second = turned(SECOND, STANDS) if stated else SECOND
    return [
        Reference(FIRST, HEIGHTS_M[0], params=params),
        Reference(second, HEIGHTS_M[1], params=params, place_known=stated),
    ]


def following(*given: Reference, camera: CameraPrior | None = None) -> FusedGround:
    prior = CameraPrior.calibrated(CAMERA) if camera is None else camera
    return FusedGround(given, camera=prior, params=FusedParams(sizes=False))


@pytest.mark.parametrize("stated", [False, pytest.param(True, marks=pytest.mark.live)])
def test_a_second_reference_never_makes_distances_less_sure(stated: bool) -> None:
    camera = CameraPrior.unknown(640, 360)
    alone, both = following(references()[0], camera=camera), following(*references(stated=stated), camera=camera)
    for k in range(4):
        one = alone.update(frame(picture(k), k / FPS), boxes(k, second=False), motion(k))
        two = both.update(frame(picture(k), k / FPS), boxes(k), motion(k))
        error, sigma = error_and_sigma(two, k)
        assert error < 3.0 * sigma
        assert sigma <= error_and_sigma(one, k)[1] * 1.02
    assert not both.describe()["warnings"]


@pytest.mark.parametrize("stated", [pytest.param(False, marks=pytest.mark.live), True])
def test_while_the_first_is_hidden_the_second_holds_the_map(stated: bool) -> None:
    ground = following(*references(stated=stated))
    for k in range(2):
        ground.update(frame(picture(k), k / FPS), boxes(k), motion(k))
    for k in range(2, 6):
        result = ground.update(frame(picture(k, first=False), k / FPS), boxes(k, first=False), motion(k))
        error, sigma = error_and_sigma(result, k)
        assert error < 3.0 * sigma
        assert seen(result).age_s == 0.0 and seen(result).site_frame == 0


@pytest.mark.parametrize("which", [0, pytest.param(1, marks=pytest.mark.live)])
def test_a_reference_that_was_moved_is_named_and_the_ground_stays(which: int) -> None:
    ground = following(*references())
    for k in range(3):
        before = seen(ground.update(frame(picture(k), k / FPS), boxes(k), motion(k)))
    moved_m = np.array([0.9, -0.5])
    for k in range(3, 12):
        shown = _moved_picture(k, which, moved_m)
        result = ground.update(frame(shown[0], k / FPS), shown[1], motion(k))
        error, sigma = error_and_sigma(result, k)
        assert error < 4.0 * sigma + 0.02
        assert seen(result).site_frame == before.site_frame
    (warning,) = ground.describe()["warnings"]
    assert f"reference {which + 1} was moved by 1.0 m" in warning


def _moved_picture(k: int, which: int, moved_m: FloatArray) -> tuple[ImageArray, Detections]:
    shapes = [FIRST, turned(SECOND, STANDS)]
    shapes[which] = ReferenceShape.from_corners(shapes[which].corners_m + moved_m)
    states = [SolidState(view(k), height) for height in HEIGHTS_M]
    found = np.array([box_around(shape, state) for shape, state in zip(shapes, states, strict=True)])
    detections = Detections(found, np.array([0.9, 0.7]), np.full(2, CLASS_BY_NAME["reference"].id))
    return drawn_solids(list(zip(shapes, states, strict=True)), view(k), seed=k), detections


def test_one_box_that_could_be_either_of_two_is_no_map() -> None:
    ground = following(*references())
    result = ground.update(frame(picture(0, second=False), 0.0), boxes(0, second=False), STILL)
    assert isinstance(result, NoGroundMap) and WHICH in result.reason


@pytest.mark.live
def test_two_references_are_told_apart_whichever_the_detector_is_surer_of() -> None:
    for turned_round in (False, True):
        ground, detections = following(*references()), boxes(0)
        if turned_round:
            detections = Detections(detections.xyxy_px, detections.score[::-1], detections.class_id)
        error, sigma = error_and_sigma(ground.update(frame(picture(0), 0.0), detections, STILL), 0)
        assert error < 3.0 * sigma


MARKER = MarkerPlace.lying(7, 0.9, xy_m=(-3.2, 0.2), heading_deg=20.0)


def with_marker(k: int, place: MarkerPlace = MARKER) -> ImageArray:
    light = picture(k, second=False) / 255.0
    draw_marker(light, marker_pattern("apriltag36h11", place.marker_id), view(k).project(place.corners_m))
    return np.asarray(np.clip(np.rint(light * 255.0), 0, 255), dtype=np.uint8)


def beside_marker(camera: CameraPrior) -> FusedGround:
    return FusedGround(references()[:1], MarkerObserver([MARKER]), camera=camera, params=FusedParams(sizes=False))


def test_a_marker_beside_a_reference_makes_it_surer() -> None:
    camera = CameraPrior.unknown(640, 360)
    alone, both = following(references()[0], camera=camera), beside_marker(camera)
    for k in range(3):
        shown = frame(with_marker(k), k / FPS)
        one = alone.update(shown, boxes(k, second=False), motion(k))
        error, sigma = error_and_sigma(both.update(shown, boxes(k, second=False), motion(k)), k)
        assert error < 3.0 * sigma
    assert sigma < error_and_sigma(one, k)[1]
    assert not both.describe()["warnings"]


def test_a_marker_that_was_moved_is_named_and_changes_nothing() -> None:
    astray = MarkerPlace.lying(7, 0.9, xy_m=(-4.0, 0.9), heading_deg=20.0)
    ground = beside_marker(CameraPrior.calibrated(CAMERA))
    for k in range(10):
        shown = with_marker(k, MARKER if k < 3 else astray)
        error, sigma = error_and_sigma(ground.update(frame(shown, k / FPS), boxes(k, second=False), motion(k)), k)
        assert error < 3.0 * sigma
    (warning,) = ground.describe()["warnings"]
    assert "marker 7 lies elsewhere than stated" in warning and "frame" in warning


@pytest.mark.live
def test_markers_that_were_moved_are_named_once_whichever_are_in_sight() -> None:
    told = [MARKER, MarkerPlace.lying(8, 0.9, xy_m=(3.2, 3.0))]
    lying = [MarkerPlace.lying(7, 0.9, xy_m=(-4.0, 0.9)), MarkerPlace.lying(8, 0.9, xy_m=(2.6, 2.2))]
    ground = FusedGround(
        references()[:1], MarkerObserver(told), camera=CameraPrior.calibrated(CAMERA), params=FusedParams(sizes=False)
    )
    for k in range(12):
        light = picture(k, second=False) / 255.0
        for place in lying[: 1 + k // 7]:
            draw_marker(light, marker_pattern("apriltag36h11", place.marker_id), view(k).project(place.corners_m))
        shown = np.asarray(np.clip(np.rint(light * 255.0), 0, 255), dtype=np.uint8)
        ground.update(frame(shown, k / FPS), boxes(k, second=False), motion(k))
    (warning,) = ground.describe()["warnings"]
    assert "marker 7 lies elsewhere than stated" in warning


def telemetry(height_m: float, pitch_deg: float = np.nan) -> Telemetry:
    angles = dict.fromkeys(("pitch_deg", "roll_deg", "heading_deg"), np.nan)
    if np.isfinite(pitch_deg):
        angles = {"pitch_deg": pitch_deg, "roll_deg": 0.0, "heading_deg": 200.0}
    sigmas = {"height_sigma_m": 0.5, "pitch_sigma_deg": 0.5, "roll_sigma_deg": 0.5, "heading_sigma_deg": 4.0}
    return Telemetry(0.0, "drawn", height_m=height_m, **angles, **sigmas)


@pytest.mark.parametrize("angles", [False, True])
def test_telemetry_beside_a_reference_makes_it_surer_never_less_sure(angles: bool) -> None:
    said = telemetry(float(view().position_m[2]), 50.0 if angles else np.nan)
    camera = CameraPrior.unknown(640, 360)
    with_it, without = (following(references()[0], camera=camera) for _ in range(2))
    shown = frame(picture(0, second=False), 0.0)
    error, sigma = error_and_sigma(with_it.update(replace(shown, telemetry=said), boxes(0, second=False), STILL), 0)
    assert error < 3.0 * sigma
    assert sigma <= error_and_sigma(without.update(shown, boxes(0, second=False), STILL), 0)[1] * 1.002
    assert not with_it.describe()["warnings"]


@pytest.mark.parametrize("said", [telemetry(60.0), telemetry(9.5, 20.0)], ids=["height", "pitch"])
def test_a_reference_that_telemetry_contradicts_is_believed_after_a_while_and_named(said: Telemetry) -> None:
    """Something may hide a part of it; then soon another one."""
    with_it, without = (following(references()[0]) for _ in range(2))
    for time_s in (0.0, 0.5, 1.9):
        shown = replace(frame(picture(0, second=False), time_s), telemetry=said)
        with_it.update(shown, boxes(0, second=False), STILL)
        assert not with_it.describe()["warnings"] or "found in no frame" in with_it.describe()["warnings"][0]
    shown = frame(picture(0, second=False), 2.2)
    one = seen(with_it.update(replace(shown, telemetry=said), boxes(0, second=False), STILL))
    other = seen(without.update(shown, boxes(0, second=False), STILL))
    np.testing.assert_allclose(one.image_to_ground, other.image_to_ground, rtol=1e-9, atol=1e-12)
    (warning,) = with_it.describe()["warnings"]
    assert "telemetry" in warning and "the reference is trusted" in warning


def test_one_bad_frame_of_motion_does_not_lose_a_hidden_reference_s_map() -> None:
    ground = following(references()[0])
    for k in range(2):
        ground.update(frame(picture(k, second=False), k / FPS), boxes(k, second=False), motion(k))
    bare = cv2.GaussianBlur(picture(2, first=False, second=False), (0, 0), 1.0)
    assert isinstance(ground.update(frame(bare, 2 / FPS), Detections.empty(), STILL), NoGroundMap)
    error, sigma = error_and_sigma(ground.update(frame(bare, 3 / FPS), Detections.empty(), motion(3)), 3)
    assert error < 3.0 * sigma


@pytest.mark.parametrize("factor", [0.5, 0.8, 1.0, 1.03, 1.4])
def test_a_lens_that_cannot_be_is_named_and_not_used(factor: float) -> None:
    stated = CameraPrior.calibrated(CAMERA.refocused(factor, float(CAMERA.distortion[0])))
    ground = following(references()[0], camera=stated)
    result = ground.update(frame(picture(0, second=False), 0.0), boxes(0, second=False), STILL)
    warnings = ground.describe()["warnings"]
    if 0.9 < factor < 1.1:
        assert not warnings
    else:
        (warning,) = warnings
        named = float(warning.split("one ")[1].split(" times")[0])
        assert named == pytest.approx(1.0 / factor, rel=0.1)
        error, sigma = error_and_sigma(result, 0)
        assert error < 3.0 * sigma


def test_a_reference_that_no_frame_shows_is_named_with_the_reason_until_one_does() -> None:
    ground = following(references()[0])
    bare = frame(picture(0, first=False, second=False), 0.0)
    result = ground.update(bare, boxes(0, second=False), STILL)
    assert isinstance(result, NoGroundMap)
    assert ground.describe()["warnings"] == [f"the reference was found in no frame: {NOT_THERE}"]
    ground.update(frame(picture(1, second=False), 1.0), boxes(1, second=False), STILL)
    assert not ground.describe()["warnings"]
