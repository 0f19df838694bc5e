from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skimage.transform import ProjectiveTransform
from tolerances import FIRST_ORDER_SIGMA_REL, GEOMETRY_REL

from standoff.core import homography
from standoff.core.homography import FloatArray

_PICTURE = np.array([1920.0, 1080.0])
_TRIAL_SEEDS = [0, 1, *(pytest.param(seed, marks=pytest.mark.live) for seed in (2, 3))]
"""Of views whose errors are compared with thousands of trials."""

_CORNERS_PX = np.array([[860.0, 500.0], [1060.0, 510.0], [1090.0, 640.0], [840.0, 630.0]])


def oblique_map(height_m: float, tilt_deg: float, pan_deg: float, focal_px: float = 1500.0) -> FloatArray:
    """Image to ground of a pinhole camera above the origin; tilt 0 looks straight down, 90 at the horizon."""
    tilt, pan = np.radians([tilt_deg, pan_deg])
    right = np.array([np.cos(pan), np.sin(pan), 0.0])
    ahead = np.array([-np.sin(pan), np.cos(pan), 0.0])
    axis = np.sin(tilt) * ahead - np.cos(tilt) * np.array([0.0, 0.0, 1.0])
    down = np.cross(axis, right)
    rotation = np.stack([right, down, axis])
    shift = -rotation @ np.array([0.0, 0.0, height_m])
    matrix = np.array([[focal_px, 0.0, 959.5], [0.0, focal_px, 539.5], [0.0, 0.0, 1.0]])
    ground_to_image = matrix @ np.column_stack([rotation[:, 0], rotation[:, 1], shift])
    return homography.signed(np.linalg.inv(ground_to_image), np.array([959.5, 1079.0]))


maps = st.builds(oblique_map, st.floats(5.0, 120.0), st.floats(0.0, 75.0), st.floats(-180.0, 180.0))
seeds = st.integers(0, 2**32 - 1)


def random_points(seed: int, count: int = 30) -> FloatArray:
    return np.random.default_rng(seed).uniform(0.0, 1.0, (count, 2)) * (_PICTURE - 1.0)


@given(maps, seeds)
def test_to_the_ground_and_back_is_where_it_started(image_to_ground: FloatArray, seed: int) -> None:
    points_px = random_points(seed)
    ground, valid = homography.apply(image_to_ground, points_px)
    back, back_valid = homography.apply(homography.invert(image_to_ground), ground[valid])
    assert back_valid.all()
    horizon_loss = 1e3  # points just below the horizon lie kilometres away and lose three digits on the way back
    np.testing.assert_allclose(back, points_px[valid], rtol=0, atol=GEOMETRY_REL * horizon_loss * _PICTURE.max())


@given(maps, seeds)
def test_a_fit_recovers_the_map(image_to_ground: FloatArray, seed: int) -> None:
    points_px = random_points(seed)
    ground, valid = homography.apply(image_to_ground, points_px)
    near = valid & (np.linalg.norm(np.nan_to_num(ground), axis=1) < 500.0)
    if near.sum() < 6:
        return
    fitted = homography.fit(points_px[near], ground[near])
    wanted = homography.signed(image_to_ground, points_px[near].mean(axis=0))
    mapped = homography.apply(fitted, points_px[near])[0]
    np.testing.assert_allclose(mapped, homography.apply(wanted, points_px[near])[0], atol=1e-5)


@given(maps, seeds)
def test_a_point_beyond_the_horizon_is_nan_never_far_away(image_to_ground: FloatArray, seed: int) -> None:
    points_px = random_points(seed, 200) + np.array([0.0, -1500.0])
    ground, valid = homography.apply(image_to_ground, points_px)
    w = points_px @ image_to_ground[2, :2] + image_to_ground[2, 2]
    np.testing.assert_array_equal(valid, w > 0)
    assert np.isnan(ground[~valid]).all()
    assert np.isfinite(ground[valid]).all()
    assert np.isnan(homography.point_jacobian(image_to_ground, points_px)[~valid]).all()


def test_a_point_on_the_horizon_or_not_finite_is_invalid() -> None:
    image_to_ground = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    ground, valid = homography.apply(
        image_to_ground, np.array([[3.0, 0.0], [np.nan, 1.0], [np.inf, 1.0], [1.0, 1e-320]])
    )
    assert not valid.any()
    assert np.isnan(ground).all()


def test_a_camera_over_the_ground_sees_the_horizon_where_geometry_puts_it() -> None:
    image_to_ground = oblique_map(20.0, 70.0, 0.0)
    horizon_y = 539.5 - 1500.0 * np.tan(np.radians(20.0))
    rows = np.array([[100.0, horizon_y - 0.01], [100.0, horizon_y + 0.01]])
    assert homography.apply(image_to_ground, rows)[1].tolist() == [False, True]


def test_no_points_give_no_points() -> None:
    mapped, valid = homography.apply(np.eye(3), np.zeros((0, 2)))
    assert mapped.shape == (0, 2)
    assert valid.shape == (0,)


@pytest.mark.parametrize("seed", range(5))
def test_the_jacobians_are_the_slopes_of_apply(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image_to_ground = oblique_map(rng.uniform(10, 60), rng.uniform(0, 60), rng.uniform(-180, 180))
    points_px = rng.uniform([200, 500], [1700, 1000], (8, 2))
    step_px = 1e-3
    for axis, step in enumerate(np.eye(2) * step_px):
        ahead, behind = (homography.apply(image_to_ground, points_px + s)[0] for s in (step, -step))
        slope = (ahead - behind) / (2 * step_px)
        np.testing.assert_allclose(
            homography.point_jacobian(image_to_ground, points_px)[:, :, axis], slope, rtol=1e-5, atol=1e-8
        )
    by_entries = homography.parameter_jacobian(image_to_ground, points_px)
    for entry in range(9):
        change = np.zeros(9)
        change[entry] = 1e-7 * max(abs(image_to_ground.ravel()[entry]), 1e-5)
        ahead, behind = (homography.apply(image_to_ground + s * change.reshape(3, 3), points_px)[0] for s in (1, -1))
        slope = (ahead - behind) / (2 * change[entry])
        np.testing.assert_allclose(by_entries[:, :, entry], slope, rtol=1e-4, atol=1e-6 * np.abs(slope).max())


def test_a_common_factor_of_all_entries_moves_no_point() -> None:
    image_to_ground = oblique_map(30.0, 50.0, 20.0)
    by_entries = homography.parameter_jacobian(image_to_ground, _CORNERS_PX)
    assert np.isnan(homography.parameter_jacobian(-image_to_ground, _CORNERS_PX)).all()
    moved = by_entries @ image_to_ground.ravel()
    assert np.abs(moved).max() < GEOMETRY_REL * np.abs(by_entries).max()


@pytest.mark.parametrize("seed", _TRIAL_SEEDS)
def test_the_covariance_of_a_four_point_fit_is_that_of_random_trials(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image_to_ground = oblique_map(rng.uniform(20, 40), rng.uniform(20, 55), rng.uniform(-180, 180))
    anchors_m = homography.apply(image_to_ground, _CORNERS_PX)[0]
    sigma_px = 0.1
    fitted = homography.fit(_CORNERS_PX, anchors_m)
    covariance = homography.fit_covariance(fitted, _CORNERS_PX, np.tile(np.eye(2) * sigma_px**2, (4, 1, 1)))
    assert np.linalg.matrix_rank(covariance / np.abs(covariance).max(), tol=1e-14) <= 8
    target_px = np.array([[900.0, 560.0], [1100.0, 760.0], [700.0, 580.0]])
    by_entries = homography.parameter_jacobian(fitted, target_px)
    predicted = np.einsum("nij,jk,nlk->nil", by_entries, covariance, by_entries)
    trials = [homography.fit(_CORNERS_PX + rng.normal(0, sigma_px, (4, 2)), anchors_m) for _ in range(2000)]
    seen = np.stack([homography.apply(trial, target_px)[0] for trial in trials])
    for i in range(len(target_px)):
        for axis in range(2):
            assert np.sqrt(predicted[i, axis, axis]) == pytest.approx(seen[:, i, axis].std(), rel=FIRST_ORDER_SIGMA_REL)


@pytest.mark.parametrize("seed", _TRIAL_SEEDS)
def test_the_error_of_a_distance_through_the_map_is_that_of_random_trials(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    image_to_ground = oblique_map(rng.uniform(20, 40), rng.uniform(20, 55), rng.uniform(-180, 180))
    anchors_m = homography.apply(image_to_ground, _CORNERS_PX)[0]
    pair_px, sigma_px = np.array([[880.0, 560.0], [1150.0, 700.0]]), 0.15
    fitted = homography.fit(_CORNERS_PX, anchors_m)
    covariance = homography.fit_covariance(fitted, _CORNERS_PX, np.tile(np.eye(2) * sigma_px**2, (4, 1, 1)))
    ends_m = homography.apply(fitted, pair_px)[0]
    direction = (ends_m[1] - ends_m[0]) / np.linalg.norm(ends_m[1] - ends_m[0])
    by_entries = homography.parameter_jacobian(fitted, pair_px)
    slope = direction @ (by_entries[1] - by_entries[0])
    sigma_m = np.sqrt(slope @ covariance @ slope)
    trials = [homography.fit(_CORNERS_PX + rng.normal(0, sigma_px, (4, 2)), anchors_m) for _ in range(2000)]
    distances = [float(np.linalg.norm(np.diff(homography.apply(trial, pair_px)[0], axis=0))) for trial in trials]
    assert sigma_m == pytest.approx(np.std(distances), rel=FIRST_ORDER_SIGMA_REL)


@given(maps, st.floats(-np.pi, np.pi), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), seeds)
def test_distances_do_not_change_when_the_site_is_turned_or_shifted(
    image_to_ground: FloatArray, angle: float, east_m: float, north_m: float, seed: int
) -> None:
    anchors_m, valid = homography.apply(image_to_ground, _CORNERS_PX)
    near = np.abs(np.nan_to_num(anchors_m, nan=np.inf)).max() < 300.0
    if not (valid.all() and near):
        return
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned_m = anchors_m @ turn.T + np.array([east_m, north_m])
    points_px = np.random.default_rng(seed).uniform([800, 480], [1100, 660], (6, 2))
    plain, moved = (homography.apply(homography.fit(_CORNERS_PX, m), points_px) for m in (anchors_m, turned_m))
    np.testing.assert_array_equal(plain[1], moved[1])
    both = plain[1] & (np.abs(np.nan_to_num(plain[0])).max(axis=1) < 300.0)
    expected = np.linalg.norm(plain[0][both][:, None] - plain[0][both], axis=2)
    np.testing.assert_allclose(np.linalg.norm(moved[0][both][:, None] - moved[0][both], axis=2), expected, atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_apply_agrees_with_opencv_and_scikit_image(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image_to_ground = oblique_map(rng.uniform(5, 60), rng.uniform(0, 55), rng.uniform(-180, 180))
    points_px = rng.uniform([0, 400], _PICTURE - 1, (50, 2))
    ours, valid = homography.apply(image_to_ground, points_px)
    assert valid.all()
    np.testing.assert_allclose(
        ours, cv2.perspectiveTransform(points_px[:, None], image_to_ground)[:, 0], rtol=GEOMETRY_REL
    )
    np.testing.assert_allclose(ours, ProjectiveTransform(image_to_ground)(points_px), rtol=GEOMETRY_REL)


@pytest.mark.parametrize("seed", range(5))
def test_a_four_point_fit_agrees_with_opencv_and_scikit_image(seed: int) -> None:
    rng = np.random.default_rng(seed)
    # findHomography rounds its points to float32: eighths of a pixel and of a metre survive that.
    source = np.round(8.0 * (_CORNERS_PX + rng.normal(0, 10, (4, 2)))) / 8.0
    target = np.array([[0.0, 0.0], [2.875, 0.0], [2.875, 2.875], [0.0, 2.875]])
    points_px = rng.uniform([850, 500], [1060, 630], (20, 2))
    ours = homography.apply(homography.fit(source, target), points_px)[0]
    opencv, _ = cv2.findHomography(source, target, 0)
    np.testing.assert_allclose(ours, cv2.perspectiveTransform(points_px[:, None], opencv)[:, 0], atol=1e-7)
    scikit = ProjectiveTransform.from_estimate(source, target)
    np.testing.assert_allclose(ours, scikit(points_px), atol=1e-7)


@pytest.mark.parametrize("seed", range(5))
def test_an_over_determined_fit_agrees_with_scikit_image(seed: int) -> None:
    rng = np.random.default_rng(seed)
    source = rng.uniform([0, 400], _PICTURE - 1, (12, 2))
    target = homography.apply(oblique_map(25.0, 45.0, 10.0), source)[0] + rng.normal(0, 0.02, (12, 2))
    scikit = ProjectiveTransform.from_estimate(source, target)
    # Both minimise the algebraic error of normalised points, each with its own measure of spread.
    np.testing.assert_allclose(homography.apply(homography.fit(source, target), source)[0], scikit(source), atol=2e-3)


@pytest.mark.parametrize(
    "source",
    [
        np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]),
        np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [0.0, 5.0]]),
        np.array([[0.0, 0.0], [0.0, 0.0], [2.0, 2.0], [0.0, 5.0]]),
        np.array([[1.0, 1.0]] * 4),
        np.array([[0.0, 0.0], [1.0, 0.0], [np.nan, 1.0], [0.0, 1.0]]),
        np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]),
    ],
    ids=["all on a line", "three on a line", "two the same", "all the same", "nan", "three points"],
)
@pytest.mark.filterwarnings("ignore:(divide by zero|invalid value):RuntimeWarning")
def test_points_that_determine_nothing_are_refused(source: FloatArray) -> None:
    target = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])[: len(source)]
    with pytest.raises(np.linalg.LinAlgError):
        homography.fit(source, target)


def test_signed_puts_the_given_point_in_front_and_has_norm_one() -> None:
    matrix = oblique_map(30.0, 40.0, 0.0)
    for factor in (-7.0, 3.0):
        signed = homography.signed(factor * matrix, np.array([960.0, 900.0]))
        np.testing.assert_allclose(signed, matrix, rtol=1e-12)
        assert np.linalg.norm(signed) == pytest.approx(1.0)


@given(maps, seeds)
def test_stretches_are_the_singular_values_of_a_map(ground_map: FloatArray, seed: int) -> None:
    jacobian = homography.point_jacobian(ground_map, random_points(seed))
    jacobian = jacobian[np.isfinite(jacobian).all(axis=(1, 2))]
    longest, shortest = np.linalg.svd(jacobian, compute_uv=False).T.reshape(2, -1)
    np.testing.assert_allclose(homography.stretches(jacobian), (longest, shortest), rtol=GEOMETRY_REL)


@given(st.floats(0.0, 7.0), st.floats(1e-6, 1e6))
def test_a_turn_stretches_nothing_more_one_way_than_another(angle: float, scale: float) -> None:
    turn = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    longest, shortest = homography.stretches(turn[None])
    assert shortest <= longest
    np.testing.assert_allclose(shortest, longest, rtol=GEOMETRY_REL)
