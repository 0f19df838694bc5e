"""Everything that measures through a fisheye knows that it is one: none takes it for a pinhole camera."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from drawn_ground import frame
from drawn_solid import SIZE_PX, box_around, drawn, lens, looking_at
from tolerances import FISHEYE_REL, FITTED_M, GROUND_THROUGH_LENS_M

from standoff.core.camera import Camera, CameraPrior
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.pose import View
from standoff.core.types import Detections, GroundMap, NoCameraMotion
from standoff.labels.views import GroundView, read_views, view_line
from standoff.stages.ground import (
    FusedGround,
    GivenPlace,
    PointObservation,
    Reference,
    ReferenceGround,
    ReferenceParams,
    ReferenceShape,
    SurveyedGround,
    belief_from_points,
)
from standoff.stages.ground.edges import Edges
from standoff.stages.ground.marker_fit import PointFit, first_fit
from standoff.stages.ground.size_scale import size_ratios
from standoff.stages.ground.sizes import FISHEYE, NoSizes, SizesEstimator
from standoff.stages.ground.solid import SolidState
from standoff.stages.ground.view_prior import level_prior
from standoff.stages.motion.lens import Lens

CAMERA = Camera(*SIZE_PX, lens(240.0).matrix, np.array([-0.02, 0.01, -0.004, 0.001]), "fisheye")
STILL = NoCameraMotion("one picture")
SQUARE = ReferenceShape.square(2.89)
PLACES_M = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 6.0, 0.0], [4.0, 4.0, 0.0], [-3.0, 2.0, 0.0]])
NOBODY = Detections(np.zeros((0, 4)), np.zeros(0), np.zeros(0, dtype=np.int64))


def _off_axis(height_m: float) -> SolidState:
    """Return the square 35 degrees off the axis, where a pinhole camera would show it a third larger."""
    view = looking_at(CAMERA, (5.4, -0.6), away_m=8.0, heading_deg=25.0, pitch_deg=55.0)
    return SolidState(view, height_m)


def _length_ratios(ground: object, view: View) -> np.ndarray:
    assert isinstance(ground, GroundMap)
    seen_px = view.project(PLACES_M)
    inside = ((seen_px > 0) & (seen_px < SIZE_PX)).all(axis=1)
    assert inside.sum() >= 3
    mapped_m, _ = ground.to_ground(seen_px[inside])
    found, true = (np.linalg.norm(np.diff(at, axis=0), axis=1) for at in (mapped_m, PLACES_M[inside, :2]))
    return np.asarray(found / true)


def test_a_solid_far_off_the_axis_gives_true_lengths() -> None:
    state = _off_axis(0.4)
    box = box_around(SQUARE, state)
    seen = Detections(box[None], np.array([0.9]), np.array([CLASS_BY_NAME["reference"].id]))
    ground = FusedGround([Reference(SQUARE, 0.4)], camera=CameraPrior.calibrated(CAMERA))
    found = ground.update(frame(drawn(SQUARE, state), 0.0), seen, STILL)
    np.testing.assert_allclose(_length_ratios(found, state.view), 1.0, rtol=FISHEYE_REL)


def test_a_flat_reference_far_off_the_axis_gives_true_lengths() -> None:
    state = _off_axis(0.0)
    place = GivenPlace(tuple(box_around(SQUARE, state).tolist()))
    ground = ReferenceGround(SQUARE, ReferenceParams(method="oriented"), place=place, camera=CAMERA)
    found = ground.update(frame(drawn(SQUARE, state), 0.0), NOBODY, STILL)
    np.testing.assert_allclose(_length_ratios(found, state.view), 1.0, rtol=FISHEYE_REL)


def test_surveyed_points_give_the_exact_map() -> None:
    view = _off_axis(0.0).view
    seen_px = view.project(PLACES_M)
    inside = ((seen_px > 0) & (seen_px < SIZE_PX)).all(axis=1)
    ground = SurveyedGround(seen_px[inside], PLACES_M[inside, :2], SIZE_PX, camera=CAMERA)
    found = ground.update(frame(np.zeros(SIZE_PX[::-1], np.uint8)), NOBODY, STILL)
    assert isinstance(found, GroundMap)
    elsewhere_m = np.array([[1.0, 1.5, 0.0], [3.0, 2.5, 0.0]])
    by_opencv = cv2.fisheye.projectPoints(
        elsewhere_m[:, None],
        cv2.Rodrigues(view.site_to_camera)[0],
        -view.site_to_camera @ view.position_m,
        CAMERA.matrix,
        CAMERA.distortion,
    )[0][:, 0]
    np.testing.assert_allclose(found.to_ground(by_opencv)[0], elsewhere_m[:, :2], atol=GROUND_THROUGH_LENS_M)


def test_corners_give_the_camera_s_place() -> None:
    view = _off_axis(0.0).view
    corners_m = np.column_stack([SQUARE.corners_m, np.zeros(4)])
    seen = PointObservation("a square", corners_m, view.project(corners_m), np.full(4, 0.2))
    prior = CameraPrior.calibrated(CAMERA)
    np.testing.assert_allclose(belief_from_points(prior, seen).state.view.position_m, view.position_m, atol=FITTED_M)
    by_marker = first_fit([seen], CAMERA, level_prior(prior), 0.01)
    assert isinstance(by_marker, PointFit)
    np.testing.assert_allclose(by_marker.view.position_m, view.position_m, atol=FITTED_M)


def test_edges_run_straight_and_across_their_gradients() -> None:
    ends = np.array([[-0.2, 0.9], [1.1, -0.3]])
    share = np.linspace(0.0, 1.0, 9)[:, None]
    straight = ends[0] + share * (ends[1] - ends[0])
    bent, by_straight = CAMERA.distorted_with_jacobian(straight)
    along = (by_straight @ (ends[1] - ends[0]))[:, :]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    points_px = bent * 240.0 + CAMERA.matrix[:2, 2]
    found = Edges(points_px, 7.0 * across).undistorted(CAMERA)
    line = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    np.testing.assert_allclose(found.direction @ line, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(found.gradient, axis=1), 7.0 * np.linalg.norm(across, axis=1), rtol=1e-9)


def test_followed_points_lose_the_lens_and_get_it_back() -> None:
    points_px = np.random.default_rng(0).uniform((0, 0), SIZE_PX, (100, 2))
    followed = Lens(CAMERA, SIZE_PX)
    ideal_px = followed.undistorted(points_px)
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-12)
    by_opencv = cv2.fisheye.undistortPoints(
        points_px[:, None], CAMERA.matrix, CAMERA.distortion, P=CAMERA.matrix, criteria=stop
    )
    np.testing.assert_allclose(ideal_px, by_opencv[:, 0], rtol=1e-9)
    np.testing.assert_allclose(followed.distorted(ideal_px), points_px, atol=1e-6)


def test_people_do_not_measure_the_ground_and_judge_it_near_the_axis_only() -> None:
    estimator = SizesEstimator(CameraPrior.calibrated(CAMERA))
    worker = CLASS_BY_NAME["worker"].id
    boxes = np.array([[310.0, 150.0, 325.0, 190.0], [15.0, 20.0, 30.0, 60.0]])
    answer = estimator.update(0.0, Detections(boxes, np.full(2, 0.9), np.full(2, worker)), None)
    assert isinstance(answer, NoSizes) and answer.reason == FISHEYE
    view = View.aimed(CAMERA, np.array([0.0, 0.0, 12.0]), heading_deg=0.0, pitch_deg=80.0)
    log_ratio, _ = size_ratios(view, boxes, np.full(2, worker))
    assert np.isfinite(log_ratio).tolist() == [True, False]


def test_a_set_s_views_keep_the_lens(tmp_path: Path) -> None:
    view = _off_axis(0.0).view
    (tmp_path / "views.jsonl").write_text(view_line("a.jpg", GroundView(view, 0.0)))
    again = read_views(tmp_path / "views.jsonl")["a.jpg"]
    seen_px = view.project(PLACES_M[:3])
    np.testing.assert_allclose(again.to_ground(seen_px), PLACES_M[:3, :2], atol=GROUND_THROUGH_LENS_M)
