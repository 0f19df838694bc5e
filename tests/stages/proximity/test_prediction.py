"""Probabilities of a breach against ways to get them that share nothing with the code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ncx2
from stages.proximity.test_meter import positions_of

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.ground_motion import MEMORY_S, SPEED_MPS
from standoff.core.homography import FloatArray
from standoff.core.types import GroundPositions
from standoff.stages.proximity.prediction import Prediction, predict

WORKER, LOADER, EXCAVATOR = (CLASS_BY_NAME[name].id for name in ("worker", "wheel_loader", "excavator"))
FIRST, SECOND = np.array([0]), np.array([1])
FIXED_DRAWS = 0.06
"""What 256 paths may be off: two standard errors of a half."""


def pair(
    offset_m: tuple[float, float],
    velocities_mps: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0)),
    *,
    place_m: float = 0.2,
    speed_mps: float = 0.2,
    classes: tuple[int, int] = (WORKER, LOADER),
) -> GroundPositions:
    rows = positions_of([(0.0, 0.0), offset_m], [*classes], velocity_mps=np.array(velocities_mps))
    state = np.tile(np.diag([place_m**2] * 2 + [speed_mps**2] * 2), (2, 1, 1))
    names = (
        "track_id",
        "class_id",
        "xy_m",
        "velocity_mps",
        "map_factor_m",
        "predicted",
        "standing_s",
        "radius_m",
        "valid",
        "reason",
    )
    return GroundPositions(**{name: getattr(rows, name) for name in names}, state_covariance=state)


def predicted(positions: GroundPositions, reach_m: float, horizon_s: float = 3.0) -> Prediction:
    return predict(positions, FIRST, SECOND, np.array([reach_m]), horizon_s)


def by_small_steps(positions: GroundPositions, reach_m: float, horizon_s: float, seed: int) -> float:
    """Follow 8000 pairs in steps of 25 ms by the differential equation itself."""
    rng, count, step_s = np.random.default_rng(seed), 8000, 0.025
    places, velocities = [], []
    for row in (0, 1):
        mean = np.concatenate([positions.xy_m[row], positions.velocity_mps[row]])
        state = rng.multivariate_normal(mean, positions.state_covariance[row], count)
        places.append(state[:, :2])
        velocities.append(state[:, 2:])
    touched = np.zeros(count, dtype=bool)
    for _ in range(round(horizon_s / step_s) + 1):
        touched |= np.linalg.norm(places[1] - places[0], axis=1) < reach_m
        for row in (0, 1):
            memory_s, speed = MEMORY_S[positions.class_id[row]], SPEED_MPS[positions.class_id[row]]
            places[row] = places[row] + step_s * velocities[row]
            push = speed * np.sqrt(2.0 * step_s / memory_s) * rng.normal(size=(count, 2))
            velocities[row] = velocities[row] * (1.0 - step_s / memory_s) + push
    return float(touched.mean())


@pytest.mark.parametrize("offset_m", [(7.0, 0.0), (0.0, 8.5), (6.5, 6.5)])
@pytest.mark.parametrize("place_m", [0.1, 0.5, 2.0])
def test_now_it_is_the_share_of_a_gaussian_in_a_circle(offset_m: tuple[float, float], place_m: float) -> None:
    reach_m = 7.8
    variance_m2 = 2.0 * place_m**2
    expected = ncx2.cdf(reach_m**2 / variance_m2, 2, np.sum(np.square(offset_m)) / variance_m2)
    found = predicted(pair(offset_m, place_m=place_m), reach_m)
    assert found.breach_now[0] == pytest.approx(expected, abs=FIXED_DRAWS)


@pytest.mark.parametrize(
    ("offset_m", "velocities_mps", "classes"),
    [
        ((12.0, 0.0), ((0.0, 0.0), (-2.5, 0.0)), (WORKER, LOADER)),
        ((9.0, 0.0), ((0.0, 0.0), (0.0, 0.0)), (WORKER, LOADER)),
        ((9.5, 2.0), ((1.2, 0.0), (0.5, -0.5)), (WORKER, LOADER)),
        ((15.0, 0.0), ((1.4, 0.0), (0.0, 0.0)), (WORKER, EXCAVATOR)),
    ],
)
def test_ahead_it_is_the_share_of_paths_that_come_too_near(
    offset_m: tuple[float, float],
    velocities_mps: tuple[tuple[float, float], tuple[float, float]],
    classes: tuple[int, int],
) -> None:
    positions = pair(offset_m, velocities_mps, classes=classes)
    reach_m = float(positions.radius_m.sum())
    for horizon_s in (1.0, 3.0, 5.0):
        expected = by_small_steps(positions, reach_m, horizon_s, seed=int(10 * horizon_s))
        assert predicted(positions, reach_m, horizon_s).breach_ahead[0] == pytest.approx(expected, abs=FIXED_DRAWS)


def test_a_longer_horizon_and_a_larger_circle_never_make_a_breach_less_likely() -> None:
    positions = pair((10.0, 3.0), ((0.8, 0.0), (-0.5, 0.2)))
    by_horizon = [predicted(positions, 7.8, horizon_s).breach_ahead[0] for horizon_s in (1.0, 2.0, 3.0, 4.0, 5.0)]
    by_reach = [predicted(positions, reach_m).breach_ahead[0] for reach_m in np.arange(1.0, 12.0)]
    assert by_horizon == sorted(by_horizon) and by_reach == sorted(by_reach)
    for horizon_s in (1.0, 5.0):
        found = predicted(positions, 7.8, horizon_s)
        assert found.breach_now[0] <= found.breach_ahead[0]


def test_who_is_far_away_or_surely_within_needs_no_paths() -> None:
    far = predicted(pair((200.0, 0.0)), 7.8)
    assert (far.breach_now[0], far.breach_ahead[0]) == (0.0, 0.0)
    within = predicted(pair((2.0, 0.0)), 7.8)
    assert (within.breach_now[0], within.breach_ahead[0]) == (1.0, 1.0)


def test_the_likeliest_paths_tell_the_closest_approach() -> None:
    found = predicted(pair((10.0, 4.0), ((0.0, 0.0), (-3.0, 0.0))), 1.0, 5.0)
    # A velocity is forgotten within MEMORY_S, so that much of it is travelled in all.
    times_s = 0.25 * np.arange(1, 21)
    memory_s = MEMORY_S[LOADER]
    x_m = 10.0 - 3.0 * memory_s * (1.0 - np.exp(-times_s / memory_s))
    distances_m = np.hypot(x_m, 4.0)
    assert found.closest_m[0] == pytest.approx(distances_m.min())
    assert found.closest_in_s[0] == times_s[distances_m.argmin()]
    apart = predicted(pair((10.0, 4.0), ((0.0, 0.0), (3.0, 0.0))), 1.0)
    assert (apart.closest_m[0], apart.closest_in_s[0]) == (pytest.approx(np.hypot(10.0, 4.0)), 0.0)


def test_an_error_that_both_share_makes_no_breach_more_likely() -> None:
    """A map that is shifted moves both, and what is between them stays."""
    shift = np.zeros((2, 2, 10))
    shift[:, :, :2] = 5.0 * np.eye(2)
    apart = pair((9.5, 0.0), place_m=0.05, speed_mps=0.05)

    def with_map(map_factor_m: FloatArray) -> float:
        names = (
            "track_id",
            "class_id",
            "xy_m",
            "velocity_mps",
            "predicted",
            "standing_s",
            "radius_m",
            "valid",
            "reason",
        )
        kept = {name: getattr(apart, name) for name in (*names, "state_covariance")}
        return float(predicted(GroundPositions(**kept, map_factor_m=map_factor_m), 7.8).breach_now[0])

    assert with_map(shift) == with_map(np.zeros((2, 2, 10))) == 0.0
    only_one = shift * np.array([1.0, 0.0])[:, None, None]
    assert with_map(only_one) > 0.1


def test_turning_the_site_changes_little_and_swapping_the_sides_too() -> None:
    one = predicted(pair((9.0, 0.0), ((0.5, 0.1), (-1.0, 0.2))), 7.8).breach_ahead[0]
    turned = predicted(pair((0.0, 9.0), ((-0.1, 0.5), (-0.2, -1.0))), 7.8).breach_ahead[0]
    assert turned == pytest.approx(one, abs=FIXED_DRAWS)


def test_what_is_not_measured_is_not_predicted() -> None:
    positions = positions_of([(0.0, 0.0), (np.nan, np.nan)], [WORKER, LOADER])
    found = predict(positions, FIRST, SECOND, np.array([7.8]), 3.0)
    assert all(np.isnan(column).all() for column in found)


@pytest.mark.parametrize("standing_s", [(0.0, 10.0), (10.0, 0.0)])
def test_who_stands_will_less_likely_be_elsewhere_soon(standing_s: tuple[float, float]) -> None:
    moves = pair((9.5, 0.0))
    stands = replace(moves, standing_s=np.array(standing_s))
    assert predicted(stands, 7.8).breach_ahead[0] < predicted(moves, 7.8).breach_ahead[0]
    both_stand = replace(moves, standing_s=np.array([10.0, 10.0]))
    assert predicted(both_stand, 7.8).breach_ahead[0] < 0.7 * predicted(moves, 7.8).breach_ahead[0]
