from __future__ import annotations

import cv2
import numpy as np
import pytest
import tolerances

from standoff.core.camera import Camera, CameraPrior
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES, POSE, View
from standoff.stages.ground import PointObservation, belief_from_points, fit_points
from standoff.stages.ground.point_fit import views_of_plane
from standoff.stages.ground.solid import HEIGHT, STATE, SolidState
from standoff.stages.ground.solid_fit import Belief

CAMERA = Camera(1280, 720, np.array([[1000.0, 0, 640.0], [0, 1000.0, 360.0], [0, 0, 1]]), np.array([-0.1, 0, 0, 0, 0]))
SQUARE_M = np.array([[0.0, 0.0, 0.0], [2.9, 0.0, 0.0], [2.9, 2.9, 0.0], [0.0, 2.9, 0.0]])
VIEW = View.aimed(CAMERA, np.array([3.0, -18.0, 20.0]), heading_deg=-5.0, pitch_deg=48.0, roll_deg=2.0)


def seen(points_m: FloatArray, view: View = VIEW, sigma_px: float = 0.2) -> PointObservation:
    return PointObservation("a square", points_m, view.project(points_m), np.full(len(points_m), sigma_px))


@pytest.mark.parametrize("pitch_deg", [15.0, 48.0, 90.0])
@pytest.mark.parametrize("roll_deg", [-40.0, 0.0, 170.0])
def test_exact_corners_give_the_camera_however_it_is_held(pitch_deg: float, roll_deg: float) -> None:
    heading = np.deg2rad(20.0)
    away_m = 25.0 * np.array([-np.sin(heading), -np.cos(heading), 0.0]) * np.cos(np.deg2rad(pitch_deg))
    position_m = np.array([1.4, 1.4, 25.0 * np.sin(np.deg2rad(pitch_deg))]) + away_m
    view = View.aimed(CAMERA, position_m, heading_deg=20.0, pitch_deg=pitch_deg, roll_deg=roll_deg)
    found = belief_from_points(CameraPrior.calibrated(CAMERA), seen(SQUARE_M, view)).state.view
    np.testing.assert_allclose(found.position_m, view.position_m, atol=tolerances.FITTED_M)
    np.testing.assert_allclose(found.site_to_camera, view.site_to_camera, atol=tolerances.FITTED_M)


def test_a_plane_seen_from_afar_may_be_tilted_two_ways() -> None:
    straight = Camera(1280, 720, CAMERA.matrix, np.zeros(5))
    view = View(straight, VIEW.position_m, VIEW.site_to_camera)
    first, second = views_of_plane(view.project(SQUARE_M), SQUARE_M[:, :2], straight)
    np.testing.assert_allclose(first.position_m, VIEW.position_m, atol=tolerances.FITTED_M)
    apart_px = np.linalg.norm(second.project(SQUARE_M) - view.project(SQUARE_M), axis=1)
    assert 0.5 < apart_px.max() < 8.0
    assert np.linalg.norm(second.position_m - first.position_m) > 10.0


def test_a_fit_with_a_certain_lens_is_opencvs_pose_of_noisy_corners() -> None:
    rng = np.random.default_rng(0)
    certain = CameraPrior(CAMERA, 1e-9, 1e-9, "camera file")
    for _ in range(5):
        points_px = VIEW.project(SQUARE_M) + rng.normal(0.0, 0.3, (4, 2))
        observation = PointObservation("a square", SQUARE_M, points_px, np.full(4, 0.3))
        # OpenCV's residuals are in the picture as well, with the lens in its model.
        _, turn, shift = cv2.solvePnP(SQUARE_M, points_px, CAMERA.matrix, CAMERA.distortion, flags=cv2.SOLVEPNP_IPPE)
        turn, shift = cv2.solvePnPRefineLM(SQUARE_M, points_px, CAMERA.matrix, CAMERA.distortion, turn, shift)
        position_m = -cv2.Rodrigues(turn)[0].T @ shift.ravel()
        found = belief_from_points(certain, observation).state.view
        np.testing.assert_allclose(found.position_m, position_m, atol=tolerances.PEER_POSE_M)


@pytest.mark.live
def test_the_stated_error_is_that_of_many_trials() -> None:
    rng = np.random.default_rng(1)
    prior = CameraPrior(CAMERA, 1e-6, 1e-6, "camera file")
    square, off = seen(SQUARE_M, sigma_px=0.1), []
    for _ in range(120):
        points_px = square.points_px + rng.normal(0.0, 0.1, (4, 2))
        fit = belief_from_points(prior, PointObservation("a square", SQUARE_M, points_px, square.sigma_px))
        off.append(fit.state.view.change_from(VIEW)[POSE])
    stated = np.linalg.inv(belief_from_points(prior, square).information)[POSE, POSE]
    np.testing.assert_allclose(np.std(off, axis=0), np.sqrt(np.diag(stated)), rtol=tolerances.POSE_SIGMA_REL)


def test_points_correct_what_was_known_and_leave_the_height_alone() -> None:
    sigma = np.array([0.01] * 3 + [0.3] * 3 + [1e-3, 2e-3, 0.05])
    start = VIEW.changed(np.array([0.004, -0.003, 0.005, 0.2, -0.1, 0.15, 0.0, 0.0]))
    prior = Belief(SolidState(start, 0.4), np.diag(1.0 / sigma**2))
    points_m = np.vstack([SQUARE_M, [[10.0, 5.0, 1.0], [-8.0, 9.0, 0.0]]])
    fit = fit_points(prior, seen(points_m))
    assert fit.state.height_m == 0.4
    assert fit.information[HEIGHT, HEIGHT] == pytest.approx(prior.information[HEIGHT, HEIGHT])
    known = np.linalg.eigvalsh(fit.information - prior.information)
    assert known.min() > -1e-6 * known.max() and np.linalg.matrix_rank(fit.information) == STATE
    before, after = (np.linalg.norm(view.position_m - VIEW.position_m) for view in (start, fit.state.view))
    assert after < 0.5 * before
    assert fit.state.view.change_from(VIEW).shape == (CHANGES,)


def test_points_that_no_camera_above_the_ground_can_see_so_are_refused() -> None:
    mirrored = PointObservation("a square", SQUARE_M[::-1], VIEW.project(SQUARE_M), np.full(4, 0.2))
    pinhole_px = CAMERA.undistort(mirrored.points_px)
    assert views_of_plane(pinhole_px, mirrored.points_m[:, :2], CAMERA) == []
    with pytest.raises(GroundError, match="above the ground"):
        belief_from_points(CameraPrior.calibrated(CAMERA), mirrored)
    behind = Belief(SolidState(VIEW, 0.0), np.eye(STATE))
    with pytest.raises(GroundError, match="in front of the camera"):
        fit_points(behind, PointObservation("a point", np.array([[3.0, -60.0, 30.0]]), np.zeros((1, 2)), np.ones(1)))
