from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tolerances import DISTORTION_PX, GEOMETRY_REL, ITERATED_INVERSE_PX, NUMERICAL_DERIVATIVE_REL

from standoff.core.camera import DRONE_FIELD_DEG, Camera, CameraPrior, RadialDistortion
from standoff.core.homography import FloatArray

_MATRIX = np.array([[535.9, 0.0, 342.3], [0.0, 536.4, 235.6], [0.0, 0.0, 1.0]])
_LENS = np.array([-0.2664, -0.0386, 0.00178, -0.00028, 0.2384])
_HALF_CENTRE = np.array([[0.0, 0.0, 171.15], [0.0, 0.0, 117.8], [0.0, 0.0, 0.0]])
_FISHEYE = np.array([-0.02, 0.01, -0.004, 0.001])
_INSIDE = (st.floats(0.0, 639.0), st.floats(0.0, 479.0))


def lens_camera() -> Camera:
    return Camera(640, 480, _MATRIX, _LENS)


def fisheye_camera() -> Camera:
    return Camera(640, 480, _MATRIX * np.array([[0.5], [0.5], [1.0]]) + _HALF_CENTRE, _FISHEYE, "fisheye")


def picture_grid(step: int = 20) -> FloatArray:
    x, y = np.meshgrid(np.arange(0.0, 640.0, step), np.arange(0.0, 480.0, step))
    return np.column_stack([x.ravel(), y.ravel()])


@given(*_INSIDE)
def test_distorting_an_undistorted_point_gives_it_back(x: float, y: float) -> None:
    camera, point_px = lens_camera(), np.array([[x, y]])
    np.testing.assert_allclose(camera.distort(camera.undistort(point_px)), point_px, atol=DISTORTION_PX)


def test_undistortion_agrees_with_opencv_all_over_the_picture() -> None:
    points_px = picture_grid()
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-10)
    opencv = cv2.undistortPointsIter(points_px[:, None], _MATRIX, _LENS, None, _MATRIX, stop)[:, 0]
    np.testing.assert_allclose(lens_camera().undistort(points_px), opencv, atol=ITERATED_INVERSE_PX)


def test_distortion_agrees_with_opencv_projection() -> None:
    points_px = picture_grid()
    rays = np.column_stack([(points_px - _MATRIX[:2, 2]) / np.diag(_MATRIX)[:2], np.ones(len(points_px))])
    opencv = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), _MATRIX, _LENS)[0][:, 0]
    np.testing.assert_allclose(lens_camera().distort(points_px), opencv, atol=DISTORTION_PX)


def test_a_camera_without_distortion_changes_nothing() -> None:
    camera, points_px = Camera(640, 480, _MATRIX, np.zeros(5)), picture_grid()
    np.testing.assert_allclose(camera.undistort(points_px), points_px, atol=DISTORTION_PX)
    np.testing.assert_allclose(camera.distort(points_px), points_px, atol=DISTORTION_PX)


def test_a_point_that_the_lens_cannot_see_is_nan_and_leaves_its_neighbours_alone() -> None:
    # x (1 - 0.3 x^2) grows to 0.703 at x = 1.054 and falls afterwards: nothing is ever seen beyond 0.703.
    barrel = Camera(640, 480, _MATRIX, np.array([-0.3, 0.0, 0.0, 0.0, 0.0]))
    edge_px = _MATRIX[0, 0] * 2.0 / 3.0 / np.sqrt(0.9)
    centre_px = _MATRIX[:2, 2]
    points_px = centre_px + np.array([[edge_px * 0.99, 0.0], [edge_px * 1.01, 0.0], [3000.0, 0.0], [10.0, 0.0]])
    undistorted = barrel.undistort(points_px)
    assert np.isnan(undistorted).all(axis=1).tolist() == [False, True, True, False]
    np.testing.assert_allclose(barrel.distort(undistorted[[0, 3]]), points_px[[0, 3]], atol=DISTORTION_PX)


@given(st.floats(-3000.0, 3000.0), st.floats(-3000.0, 3000.0))
def test_what_undistortion_returns_is_nan_or_true(x: float, y: float) -> None:
    point_px = np.array([[x, y]])
    undistorted = lens_camera().undistort(point_px)
    if not np.isnan(undistorted).any():
        np.testing.assert_allclose(lens_camera().distort(undistorted), point_px, atol=DISTORTION_PX)


def test_nan_stays_nan_and_no_points_give_no_points() -> None:
    assert np.isnan(lens_camera().undistort(np.array([[np.nan, 3.0]]))).all()
    assert lens_camera().undistort(np.zeros((0, 2))).shape == (0, 2)
    assert lens_camera().distort(np.zeros((0, 2))).shape == (0, 2)


@given(*_INSIDE, st.sampled_from([(1280, 960), (320, 240), (1920, 1440)]))
def test_scaling_the_picture_keeps_the_rays(x: float, y: float, size_px: tuple[int, int]) -> None:
    camera = lens_camera()
    scaled, factor = camera.scaled_to(*size_px), size_px[0] / 640.0
    point_px = np.array([[x, y]])
    resized_px = (point_px + 0.5) * factor - 0.5
    ray = (camera.undistort(point_px) - camera.matrix[:2, 2]) / np.diag(camera.matrix)[:2]
    resized_ray = (scaled.undistort(resized_px) - scaled.matrix[:2, 2]) / np.diag(scaled.matrix)[:2]
    np.testing.assert_allclose(resized_ray, ray, atol=1e-9)


def test_another_shape_of_picture_is_refused() -> None:
    with pytest.raises(ValueError, match="aspect ratio"):
        lens_camera().scaled_to(1920, 1080)


@pytest.mark.parametrize(
    ("matrix", "distortion"),
    [
        (np.eye(2), np.zeros(5)),
        (_MATRIX, np.zeros(8)),
        (_MATRIX * np.nan, np.zeros(5)),
        (_MATRIX, np.full(5, np.inf)),
        (np.diag([-500.0, 500.0, 1.0]), np.zeros(5)),
        (_MATRIX, np.zeros(4)),
    ],
)
def test_a_camera_that_cannot_be_is_refused(matrix: FloatArray, distortion: FloatArray) -> None:
    with pytest.raises(ValueError, match=r"must be"):
        Camera(640, 480, matrix, distortion)


def test_a_camera_is_not_changed_by_changing_what_it_was_made_of() -> None:
    matrix = _MATRIX.copy()
    camera = Camera(640, 480, matrix, _LENS)
    matrix[0, 0] = 1.0
    assert camera.matrix[0, 0] == _MATRIX[0, 0]
    with pytest.raises(ValueError, match="read-only"):
        camera.matrix[0, 0] = 1.0


def test_a_refocused_camera_has_longer_focal_lengths_and_another_k1_and_nothing_else() -> None:
    camera, other = lens_camera(), lens_camera().refocused(1.25, -0.1)
    np.testing.assert_allclose(np.diag(other.matrix)[:2], 1.25 * np.diag(camera.matrix)[:2], rtol=1e-12)
    np.testing.assert_array_equal(other.matrix[:2, 2], camera.matrix[:2, 2])
    assert other.distortion.tolist() == [-0.1, *camera.distortion.tolist()[1:]]


@given(st.floats(-0.5, 0.5))
def test_a_lens_of_k1_alone_is_the_limit_of_lenses_with_a_little_k2(k1: float) -> None:
    points_px = np.column_stack([np.linspace(-2000.0, 2600.0, 200), np.linspace(-900.0, 1400.0, 200)])
    plain, nearly = (Camera(640, 480, _MATRIX, np.array([k1, k2, 0.0, 0.0, 0.0])) for k2 in (0.0, 1e-12))
    np.testing.assert_allclose(plain.distort(points_px), nearly.distort(points_px), atol=DISTORTION_PX)


@given(st.floats(-0.5, 0.5), st.floats(-0.2, 0.2))
def test_a_lens_folds_where_its_polynomial_first_stops_growing(k1: float, k2: float) -> None:
    fold_r2 = Camera(640, 480, _MATRIX, np.array([k1, k2, 0.0, 0.0, 0.0])).first_fold_r2()
    r2 = np.linspace(0.0, min(fold_r2, 50.0), 200)[:-1]
    assert (1.0 + r2 * (3.0 * k1 + r2 * 5.0 * k2) > 0.0).all()
    if np.isfinite(fold_r2):
        slope = 1.0 + fold_r2 * (3.0 * k1 + fold_r2 * 5.0 * k2)
        terms = 1.0 + fold_r2 * (abs(3.0 * k1) + fold_r2 * abs(5.0 * k2))
        assert abs(slope) <= GEOMETRY_REL * terms


def test_without_distortion_a_point_stays_where_it_is_and_what_is_not_finite_is_nan() -> None:
    camera = Camera(640, 480, _MATRIX, np.zeros(5))
    points_px = np.array([[10.5, 20.25], [np.inf, 1.0], [np.nan, 1.0]])
    for moved in (camera.distort(points_px), camera.undistort(points_px)):
        np.testing.assert_array_equal(moved, [[10.5, 20.25], [np.nan, np.nan], [np.nan, np.nan]])
        assert moved is not points_px


def test_an_unknown_camera_has_a_drone_s_field_in_any_picture() -> None:
    for width, height in ((1920, 1080), (1080, 1920), (640, 480)):
        prior = CameraPrior.unknown(width, height)
        half = max(width, height) / 2.0 / prior.camera.matrix[0, 0]
        assert 2.0 * np.rad2deg(np.arctan(half)) == pytest.approx(DRONE_FIELD_DEG)
        assert prior.focal_sigma > CameraPrior.calibrated(prior.camera).focal_sigma


def test_what_is_known_of_a_camera_scales_with_the_picture_and_keeps_its_errors() -> None:
    prior = CameraPrior.calibrated(lens_camera())
    half = prior.scaled_to(320, 240)
    assert half.camera.matrix[0, 0] == pytest.approx(prior.camera.matrix[0, 0] / 2.0)
    assert (half.focal_sigma, half.k1_sigma, half.origin) == (prior.focal_sigma, prior.k1_sigma, prior.origin)
    with pytest.raises(ValueError, match="aspect"):
        prior.scaled_to(320, 320)


def test_a_fisheye_is_opencvs_all_over_the_picture() -> None:
    camera, points_px = fisheye_camera(), picture_grid()
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-12)
    opencv = cv2.fisheye.undistortPoints(points_px[:, None], camera.matrix, _FISHEYE, P=camera.matrix, criteria=stop)
    undistorted = camera.undistort(points_px)
    np.testing.assert_allclose(undistorted, opencv[:, 0], rtol=GEOMETRY_REL)
    np.testing.assert_allclose(camera.distort(undistorted), points_px, atol=DISTORTION_PX)
    rays = (undistorted - camera.matrix[:2, 2]) / np.diag(camera.matrix)[:2]
    seen = cv2.fisheye.distortPoints(rays[:, None], camera.matrix, _FISHEYE)[:, 0]
    np.testing.assert_allclose(seen, points_px, atol=DISTORTION_PX)
    # A pinhole camera would put the corner elsewhere by more than half the picture.
    assert np.abs(undistorted - points_px).max() > 320.0


@given(st.floats(-4000.0, 4000.0), st.floats(-4000.0, 4000.0), st.lists(st.floats(-0.4, 0.4), min_size=4, max_size=4))
def test_a_fisheye_of_any_coefficients_says_nan_or_what_is_true(x: float, y: float, k: list[float]) -> None:
    camera, point_px = Camera(640, 480, fisheye_camera().matrix, np.array(k), "fisheye"), np.array([[x, y]])
    undistorted = camera.undistort(point_px)
    if not np.isnan(undistorted).any():
        rays = (undistorted - camera.matrix[:2, 2]) / np.diag(camera.matrix)[:2]
        seen = cv2.fisheye.distortPoints(rays[:, None], camera.matrix, camera.distortion)[:, 0]
        # Near 90 degrees off the axis a pixel of the ideal picture is a billionth of one of the fisheye's.
        np.testing.assert_allclose(seen, point_px, atol=ITERATED_INVERSE_PX)


def test_a_fisheye_shows_nothing_of_an_ideal_picture_from_90_degrees_off_its_axis_on() -> None:
    camera = Camera(640, 480, fisheye_camera().matrix, np.zeros(4), "fisheye")
    focal_px, centre_px = camera.matrix[0, 0], camera.matrix[:2, 2]
    angles = np.deg2rad([0.0, 45.0, 89.0, 90.1, 120.0])
    points_px = centre_px + np.column_stack([focal_px * angles, np.zeros(5)])
    undistorted = camera.undistort(points_px)
    np.testing.assert_allclose(undistorted[:3, 0] - centre_px[0], focal_px * np.tan(angles[:3]), rtol=GEOMETRY_REL)
    assert np.isnan(undistorted[3:]).all()


@pytest.mark.parametrize("camera", [lens_camera(), fisheye_camera()], ids=["brown", "fisheye"])
def test_the_derivatives_of_a_lens_are_differences_of_it(camera: Camera) -> None:
    rays = np.random.default_rng(0).uniform(-0.6, 0.6, (50, 2))
    rays[0] = 0.0
    bent, jacobian = camera.distorted_with_jacobian(rays)
    step = 1e-6
    for axis, move in enumerate(np.eye(2) * step):
        difference = (camera.distorted_with_jacobian(rays + move)[0] - bent) / step
        np.testing.assert_allclose(jacobian[:, :, axis], difference, atol=NUMERICAL_DERIVATIVE_REL)
    more = camera.refocused(1.0, float(camera.distortion[0]) + step)
    assert more.lens == camera.lens
    difference = (more.distorted_with_jacobian(rays)[0] - bent) / step
    np.testing.assert_allclose(camera.distorted_by_k1(rays), difference, atol=NUMERICAL_DERIVATIVE_REL)


def test_a_fisheye_stays_one_in_pictures_of_another_size_and_is_never_told_a_pinhole_s_k1() -> None:
    camera = fisheye_camera()
    half, point_px = camera.scaled_to(320, 240), np.array([[600.0, 30.0]])
    ray = (camera.undistort(point_px) - camera.matrix[:2, 2]) / np.diag(camera.matrix)[:2]
    half_ray = (half.undistort((point_px + 0.5) / 2.0 - 0.5) - half.matrix[:2, 2]) / np.diag(half.matrix)[:2]
    np.testing.assert_allclose(half_ray, ray, atol=1e-9)
    with pytest.raises(ValueError, match="fisheye"):
        CameraPrior.calibrated(camera).with_distortion(RadialDistortion(-0.1, 0.03, 500.0))
