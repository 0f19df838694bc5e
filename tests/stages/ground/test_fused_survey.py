"""Surveyed points of one picture of a camera that moves, alone and beside other things of known place or size."""

from __future__ import annotations

import numpy as np
import pytest
from drawn_ground import frame
from drawn_solid import box_around, drawn_solids
from passing_camera import CAMERA, FPS, PAIR_PX, error_and_sigma, motion, seen, view

from standoff.core.camera import CameraPrior
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.types import Detections, GroundMap, ImageArray, NoGroundMap
from standoff.stages.ground import FusedGround, FusedParams, Reference, ReferenceParams, ReferenceShape, SurveyedGround
from standoff.stages.ground.solid import SolidState
from standoff.stages.ground.survey_observer import MISSED, NOT_YET

SHAPE, HEIGHT_M = ReferenceShape.rectangle(2.0, 2.89), 0.4
POINTS_M = np.array([[-3.5, -1.5], [3.5, -0.5], [3.0, 5.0], [-4.0, 4.5], [0.5, 6.0]])


def picture(k: int) -> ImageArray:
    return drawn_solids([(SHAPE, SolidState(view(k), HEIGHT_M))], view(k), seed=k)


def boxes(k: int) -> Detections:
    box = box_around(SHAPE, SolidState(view(k), HEIGHT_M))
    return Detections(box[None], np.array([0.9]), np.array([CLASS_BY_NAME["reference"].id]))


def seen_at(k: int, points_m: FloatArray, noise_px: float = 0.5) -> FloatArray:
    points_px = view(k).project(np.column_stack([points_m, np.zeros(len(points_m))]))
    return points_px + np.random.default_rng(k).normal(0.0, noise_px, points_px.shape)


def survey(k: int = 0, *, time_s: float | None = None) -> SurveyedGround:
    """Read points in frame k."""
    return SurveyedGround(seen_at(k, POINTS_M), POINTS_M, (640, 360), camera=CAMERA, point_sigma_px=0.5, time_s=time_s)


def following(
    surveyed: SurveyedGround | None, *references: Reference, camera: CameraPrior | None = None
) -> FusedGround:
    prior = CameraPrior.calibrated(CAMERA) if camera is None else camera
    return FusedGround(references, survey=surveyed, camera=prior, params=FusedParams(sizes=False))


def reference(*, place_known: bool = True) -> Reference:
    return Reference(SHAPE, HEIGHT_M, params=ReferenceParams(size_sigma=0.0), place_known=place_known)


def place_error_m(result: GroundMap | NoGroundMap, k: int) -> float:
    found_m, _ = seen(result).to_ground(PAIR_PX)
    return float(np.linalg.norm(found_m - view(k).to_plane(PAIR_PX), axis=1).max())


def test_points_of_the_first_picture_are_carried_by_the_motion() -> None:
    ground = following(survey())
    for k in range(6):
        result = ground.update(frame(picture(k), k / FPS), Detections.empty(), motion(k))
        error, sigma = error_and_sigma(result, k)
        assert error < 3.0 * sigma < 0.5
        assert place_error_m(result, k) < 0.2
    assert "5 surveyed points" in ground.describe()["basis"]


def test_points_of_a_later_picture_wait_for_it() -> None:
    ground = following(survey(2, time_s=2 / FPS))
    for k in range(2):
        result = ground.update(frame(picture(k), k / FPS), Detections.empty(), motion(k))
        assert isinstance(result, NoGroundMap) and NOT_YET in result.reason
    for k in range(2, 5):
        error, sigma = error_and_sigma(ground.update(frame(picture(k), k / FPS), Detections.empty(), motion(k)), k)
        assert error < 3.0 * sigma


def test_a_picture_that_never_comes_is_a_warning() -> None:
    ground = following(survey(2, time_s=0.3))
    for k in range(3):
        result = ground.update(frame(picture(k), k / FPS), Detections.empty(), motion(k))
    assert isinstance(result, NoGroundMap) and MISSED in result.reason
    assert any(MISSED in warning for warning in ground.describe()["warnings"])


@pytest.mark.parametrize("place_known", [False, True])
def test_a_survey_and_a_reference_are_surer_together(place_known: bool) -> None:
    camera = CameraPrior.unknown(640, 360)
    lonely = following(survey(), camera=camera)
    both = following(survey(), reference(place_known=place_known), camera=camera)
    for k in range(4):
        shown = frame(picture(k), k / FPS)
        one = lonely.update(shown, boxes(k), motion(k))
        two = both.update(shown, boxes(k), motion(k))
        error, sigma = error_and_sigma(two, k)
        assert error < 3.0 * sigma
        assert sigma <= error_and_sigma(one, k)[1] * 1.02
        assert place_error_m(two, k) < 0.25
    assert not both.describe()["warnings"]


def test_a_survey_takes_over_the_frame_of_a_reference_without_a_place() -> None:
    ground = following(survey(2, time_s=2 / FPS), reference(place_known=False))
    frames = []
    for k in range(5):
        result = ground.update(frame(picture(k), k / FPS), boxes(k), motion(k))
        error, sigma = error_and_sigma(result, k)
        assert error < 3.0 * sigma
        frames.append((seen(result).site_frame, seen(result).frame_stated))
    assert frames == [(0, False)] * 2 + [(1, True)] * 3
    assert place_error_m(result, 4) < 0.25


def test_a_survey_that_contradicts_the_reference_is_named_and_changes_nothing() -> None:
    stretched = SurveyedGround(
        seen_at(1, POINTS_M), POINTS_M * 1.3, (640, 360), camera=CAMERA, point_sigma_px=0.5, time_s=1 / FPS
    )
    with_it, without = following(stretched, reference()), following(None, reference())
    for k in range(3):
        shown = frame(picture(k), k / FPS)
        one, other = (ground.update(shown, boxes(k), motion(k)) for ground in (with_it, without))
        np.testing.assert_array_equal(seen(one).image_to_ground, seen(other).image_to_ground)
    (warning,) = with_it.describe()["warnings"]
    assert "the surveyed points lie elsewhere than stated" in warning and "the reference is trusted" in warning


def test_an_area_of_the_picture_is_refused_where_the_camera_may_move() -> None:
    area_px = [[10, 100], [600, 100], [600, 350]]
    limited = SurveyedGround(seen_at(0, POINTS_M), POINTS_M, (640, 360), area_px=area_px)
    with pytest.raises(GroundError, match="area_px"):
        following(limited)


def test_pictures_of_another_shape_than_the_survey_s_are_refused() -> None:
    with pytest.raises(GroundError, match="survey's shape"):
        following(survey()).prepare((640, 480))
