from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from tolerances import GEOMETRY_REL

from standoff.core.homography import FloatArray
from standoff.stages.locate.velocity import VelocityEstimator

COORDINATES = st.floats(-20, 20)
FRAME_GAPS_S = st.lists(st.floats(0.02, 0.1), min_size=41, max_size=41)


def velocity_after(
    times_s: FloatArray, path_m: FloatArray, *, window_s: float = 1.0, min_span_s: float = 0.3
) -> FloatArray:
    """Return the velocity of one track after the last of the given frames."""
    estimator = VelocityEstimator(window_s, min_span_s)
    velocity_mps = np.zeros((1, 2))
    for time_s, xy_m in zip(times_s.tolist(), path_m, strict=True):
        velocity_mps = estimator.update(time_s, np.array([1]), xy_m[None], np.array([True]), np.array([True]))
    last: FloatArray = velocity_mps[0]
    return last


@given(start=st.tuples(COORDINATES, COORDINATES), velocity=st.tuples(COORDINATES, COORDINATES), gaps_s=FRAME_GAPS_S)
def test_a_straight_motion_has_the_same_velocity_when_every_second_frame_is_dropped(
    start: tuple[float, float], velocity: tuple[float, float], gaps_s: list[float]
) -> None:
    times_s = np.cumsum(gaps_s)
    path_m = np.array(start) + times_s[:, None] * np.array(velocity)
    for step in (1, 2):
        found = velocity_after(times_s[::step], path_m[::step])
        np.testing.assert_allclose(found, velocity, rtol=GEOMETRY_REL, atol=GEOMETRY_REL)


@given(gaps_s=FRAME_GAPS_S, factor=st.sampled_from([0.25, 0.5, 2.0, 8.0]))
def test_velocity_scales_with_the_clock(gaps_s: list[float], factor: float) -> None:
    times_s = np.cumsum(gaps_s)
    path_m = np.column_stack([np.sin(times_s), times_s**2])
    found = velocity_after(times_s, path_m)
    slower = velocity_after(times_s * factor, path_m, window_s=factor, min_span_s=0.3 * factor)
    np.testing.assert_allclose(slower * factor, found, rtol=GEOMETRY_REL, atol=GEOMETRY_REL)


def test_velocity_agrees_with_a_polynomial_fit_over_the_window() -> None:
    for seed in range(5):
        rng = np.random.default_rng(seed)
        times_s = np.sort(rng.uniform(0.0, 3.0, 60))
        path_m = rng.normal(size=(60, 2)).cumsum(axis=0)
        recent = times_s >= times_s[-1] - 1.0
        expected = np.polyfit(times_s[recent], path_m[recent], 1)[0]
        np.testing.assert_allclose(velocity_after(times_s, path_m), expected, rtol=GEOMETRY_REL)


def test_velocity_is_unknown_until_three_points_span_the_least_time() -> None:
    path_m = np.column_stack([np.arange(5.0), np.zeros(5)])
    assert np.isnan(velocity_after(np.array([0.0, 0.5]), path_m[:2])).all()
    assert np.isnan(velocity_after(np.array([0.0, 0.1, 0.2]), path_m[:3])).all()
    assert np.isfinite(velocity_after(np.array([0.0, 0.1, 0.3]), path_m[:3])).all()
    assert np.isnan(velocity_after(np.array([0.0, 0.1, 0.2, 0.25, 0.28]), path_m)).all()


def test_untrusted_positions_add_nothing_and_ended_tracks_are_forgotten() -> None:
    estimator = VelocityEstimator(1.0, 0.3)
    both, one = np.array([4, 9]), np.array([9])
    for step in range(5):
        xy_m = np.array([[step, 0.0], [0.0, step]])
        found = estimator.update(0.1 * step, both, xy_m, np.array([True, True]), np.array([True, step != 2]))
    np.testing.assert_allclose(found, [[10.0, 0.0], [0.0, 10.0]], rtol=GEOMETRY_REL, atol=GEOMETRY_REL)
    estimator.update(0.5, one, np.array([[0.0, 5.0]]), np.array([True]), np.array([True]))
    returned = estimator.update(
        0.6, both, np.array([[6.0, 0.0], [0.0, 6.0]]), np.array([True, True]), np.array([True, True])
    )
    assert np.isnan(returned[0]).all()
    assert np.isfinite(returned[1]).all()


@given(velocity=st.tuples(COORDINATES, COORDINATES), gap_s=st.floats(0.6, 30.0))
def test_a_film_of_few_frames_has_velocities_too(velocity: tuple[float, float], gap_s: float) -> None:
    times_s: FloatArray = gap_s * np.arange(6.0)
    path_m = times_s[:, None] * np.array(velocity)
    assert np.isnan(velocity_after(times_s[:2], path_m[:2])).all()
    found = velocity_after(times_s, path_m)
    np.testing.assert_allclose(found, velocity, rtol=GEOMETRY_REL, atol=GEOMETRY_REL)


def test_where_nobody_was_seen_for_long_old_places_tell_no_velocity() -> None:
    estimator = VelocityEstimator(1.0, 0.3)
    one = np.array([1])
    for index in range(60):
        seen, trusted = np.array([True]), np.array([index < 10 or index > 57])
        found = estimator.update(0.1 * index, one, np.array([[0.1 * index, 0.0]]), seen, trusted)
    assert np.isnan(found).all()
