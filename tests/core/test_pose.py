from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from tolerances import DERIVATIVE_REL, DISTORTION_PX, GEOMETRY_REL, TURN_RAD

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES, View, rotation_from_vector, vector_from_rotation, view_from_homography

_CAMERA = Camera(
    1920,
    1080,
    np.array([[1400.0, 0.0, 965.0], [0.0, 1390.0, 533.0], [0.0, 0.0, 1.0]]),
    np.array([-0.1, 0.02, 1e-3, -5e-4, 0.0]),
)


def _view(seed: int, camera: Camera = _CAMERA) -> View:
    rng = np.random.default_rng(seed)
    return View.aimed(
        camera,
        rng.uniform([-30, -30, 15], [30, 30, 60]),
        heading_deg=float(rng.uniform(0, 360)),
        pitch_deg=float(rng.uniform(30, 90)),
        roll_deg=float(rng.uniform(-5, 5)),
    )


def _points_in_view(view: View, seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    height_m = float(rng.uniform(0, 3))
    xy_m = view.to_plane(rng.uniform([0, 300], [1919, 1079], (40, 2)), height_m)
    return np.column_stack([xy_m, np.full(len(xy_m), height_m)])


@pytest.mark.parametrize("seed", range(5))
def test_projection_agrees_with_opencv(seed: int) -> None:
    view = _view(seed)
    points_m = _points_in_view(view, seed)
    rotation, _ = cv2.Rodrigues(view.site_to_camera)
    shift_m = -view.site_to_camera @ view.position_m
    expected_px, _ = cv2.projectPoints(points_m, rotation, shift_m, _CAMERA.matrix, _CAMERA.distortion)
    np.testing.assert_allclose(view.project(points_m), expected_px[:, 0], atol=DISTORTION_PX)


@given(st.integers(0, 10_000))
def test_a_pixel_goes_to_the_plane_and_back(seed: int) -> None:
    view = _view(seed)
    rng = np.random.default_rng(seed)
    pixels = rng.uniform([0, 300], [1919, 1079], (20, 2))
    height_m = float(rng.uniform(0, 3))
    xy_m = view.to_plane(pixels, height_m)
    there = np.isfinite(xy_m).all(axis=1)
    assert there.any()
    back_px = view.project(np.column_stack([xy_m, np.full(20, height_m)]))
    np.testing.assert_allclose(back_px[there], pixels[there], atol=DISTORTION_PX)


@pytest.mark.parametrize("seed", range(5))
def test_the_homography_of_a_plane_is_the_projection_of_its_points(seed: int) -> None:
    view = _view(seed)
    points_m = _points_in_view(view, seed)
    mapped_px, valid = homography.apply(view.plane_to_pinhole(float(points_m[0, 2])), points_m[:, :2])
    assert valid.all()
    np.testing.assert_allclose(mapped_px, view.project_pinhole(points_m), rtol=GEOMETRY_REL)


def test_what_is_behind_the_camera_is_not_in_the_picture() -> None:
    view = View.aimed(_CAMERA, np.array([0.0, 0.0, 20.0]), heading_deg=0.0, pitch_deg=30.0)
    assert np.isnan(view.project(np.array([[0.0, -60.0, 20.0]]))).all()
    assert np.isfinite(view.project(np.array([[0.0, 40.0, 0.0]]))).all()


def test_a_ray_above_the_horizon_meets_no_ground() -> None:
    view = View.aimed(_CAMERA, np.array([0.0, 0.0, 20.0]), heading_deg=0.0, pitch_deg=10.0)
    assert np.isnan(view.to_plane(np.array([[960.0, 20.0]]))).all()


def test_heading_pitch_and_roll_turn_the_way_their_names_say() -> None:
    level = View.aimed(_CAMERA, np.array([0.0, 0.0, 20.0]), heading_deg=90.0, pitch_deg=45.0)
    ahead_px, right_px = level.project(np.array([[25.0, 0.0, 0.0], [20.0, -3.0, 0.0]]))
    centre_px = level.project(np.array([[20.0, 0.0, 0.0]]))[0]
    assert ahead_px[1] < centre_px[1]  # east is up in the picture when the camera heads east
    assert right_px[0] > centre_px[0]  # and south is to the right
    rolled = View.aimed(_CAMERA, np.array([0.0, 0.0, 20.0]), heading_deg=90.0, pitch_deg=45.0, roll_deg=10.0)
    assert rolled.project(np.array([[20.0, -3.0, 0.0]]))[0, 1] < right_px[1]  # camera's right side down: scene tilts up


def test_a_matrix_that_is_no_rotation_is_refused() -> None:
    with pytest.raises(ValueError, match="rotation"):
        View(_CAMERA, np.zeros(3), np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(ValueError, match=r"\(3,\)"):
        View(_CAMERA, np.zeros(2), np.eye(3))


@given(st.integers(0, 10_000), st.floats(0.01, 100.0))
def test_a_map_of_the_ground_gives_the_camera_s_pose_back(seed: int, scale: float) -> None:
    view = _view(seed)
    found = view_from_homography(scale * homography.invert(view.plane_to_pinhole()), _CAMERA)
    np.testing.assert_allclose(found.position_m, view.position_m, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.site_to_camera, view.site_to_camera, atol=1e-7)


def test_a_disturbed_map_gives_the_nearest_pose_and_a_rotation() -> None:
    view = _view(1)
    disturbed = homography.invert(view.plane_to_pinhole()) @ np.diag([1.01, 0.99, 1.0])
    found = view_from_homography(disturbed, _CAMERA)
    assert np.linalg.norm(found.position_m - view.position_m) < 0.1 * np.linalg.norm(view.position_m)


def test_maps_that_no_camera_above_the_ground_has_are_refused() -> None:
    image_to_ground = homography.invert(_view(1).plane_to_pinhole())
    with pytest.raises(GroundError, match="below"):
        view_from_homography(np.diag([-1.0, 1.0, 1.0]) @ image_to_ground, _CAMERA)
    with pytest.raises(GroundError, match="inverse"):
        view_from_homography(np.zeros((3, 3)), _CAMERA)


def _change(seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    change: FloatArray = rng.normal(size=CHANGES) * np.array([0.3] * 3 + [5.0] * 3 + [0.2, 0.02])
    return change


@examples(30)
@given(st.integers(0, 10_000))
def test_derivatives_of_the_projection_are_those_of_small_differences(seed: int) -> None:
    view = _view(seed)
    points_m = _points_in_view(view, seed)
    points_m = points_m[np.isfinite(points_m).all(axis=1)]
    points_px, by_view, by_point = view.project_with_jacobians(points_m)
    np.testing.assert_allclose(points_px, view.project(points_m), atol=DISTORTION_PX)
    for k in range(CHANGES):
        step = np.zeros(CHANGES)
        step[k] = 1e-5
        apart = view.changed(step).project(points_m) - view.changed(-step).project(points_m)
        _assert_slopes(by_view[:, :, k], apart / 2e-5)
    for k in range(3):
        step_m = np.eye(3)[k] * 1e-4
        _assert_slopes(by_point[:, :, k], (view.project(points_m + step_m) - view.project(points_m - step_m)) / 2e-4)


def _assert_slopes(slopes: FloatArray, expected: FloatArray) -> None:
    np.testing.assert_allclose(slopes, expected, rtol=DERIVATIVE_REL, atol=DERIVATIVE_REL * np.abs(expected).max())


def test_what_is_behind_the_camera_has_no_derivatives() -> None:
    view = View.aimed(_CAMERA, np.array([0.0, 0.0, 10.0]), heading_deg=0.0, pitch_deg=45.0)
    for found in view.project_with_jacobians(np.array([[0.0, -50.0, 0.0]])):
        assert np.isnan(found).all()


@given(st.integers(0, 10_000))
def test_a_change_leads_from_one_view_to_the_other(seed: int) -> None:
    view, change = _view(seed), _change(seed)
    changed = view.changed(change)
    np.testing.assert_allclose(changed.change_from(view), change, atol=TURN_RAD)
    back = view.changed(changed.change_from(view))
    np.testing.assert_allclose(back.site_to_camera, changed.site_to_camera, atol=TURN_RAD)
    np.testing.assert_allclose(view.change_from(view), 0.0, atol=TURN_RAD)


def test_two_thousand_changes_in_a_row_leave_a_rotation() -> None:
    view, change = _view(1), np.array([1e-3, -2e-3, 3e-3, 0.0, 0.0, 0.0, 0.0, 0.0])
    for _ in range(2_000):
        view = view.changed(change)
    np.testing.assert_allclose(view.site_to_camera @ view.site_to_camera.T, np.eye(3), atol=TURN_RAD)


def test_a_change_of_the_pose_leaves_the_lens_alone() -> None:
    view = _view(3)
    assert view.changed(np.array([0.1, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0, 0.0])).camera is view.camera


@given(st.integers(0, 10_000), st.floats(0.0, 3.1))
def test_a_rotation_vector_becomes_opencv_s_rotation_and_comes_back(seed: int, angle: float) -> None:
    axis = np.random.default_rng(seed).normal(size=3)
    vector = axis / np.linalg.norm(axis) * angle
    rotation = rotation_from_vector(vector)
    np.testing.assert_allclose(rotation, cv2.Rodrigues(vector)[0], atol=TURN_RAD)
    np.testing.assert_allclose(vector_from_rotation(rotation), vector, atol=TURN_RAD)
