"""The probability of being in a zone, against random trials and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from scipy.stats import norm
from tolerances import TRIALS_SHARE

from standoff.core.homography import FloatArray
from standoff.core.zones import Zone
from standoff.stages.hazard.inside_zone import probability_inside

CONCAVE = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [3.0, 1.0], [0.0, 4.0]])
ASIDE = np.array([9.0, 1.0])
HOLE = np.array([[0.5, 0.2], [1.5, 0.2], [1.5, 1.2]])
ZONE = Zone("yard", "no_go", [[CONCAVE, HOLE], [CONCAVE + ASIDE]])


def spread(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    root = rng.normal(size=(2, 2)) * rng.uniform(0.1, 3.0)
    return rng.uniform([-2.0, -2.0], [16.0, 7.0]), root @ root.T


def probability(zone: Zone, xy_m: FloatArray, covariance_m2: FloatArray) -> float:
    return float(probability_inside(zone.outline_m, xy_m[None], covariance_m2[None])[0])


def test_the_probability_of_being_inside_is_the_share_of_random_trials() -> None:
    for seed in range(25):
        rng = np.random.default_rng(seed)
        xy_m, covariance_m2 = spread(rng)
        trials = ZONE.contains(rng.multivariate_normal(xy_m, covariance_m2, 40_000)).mean()
        assert probability(ZONE, xy_m, covariance_m2) == pytest.approx(trials, abs=TRIALS_SHARE)


@given(st.floats(-4.0, 4.0), st.floats(0.05, 3.0), st.floats(-3.1, 3.1))
@examples(60)
def test_before_a_long_wall_it_is_the_normal_distribution(away_m: float, sigma_m: float, turn: float) -> None:
    wall = np.array([[0.0, -500.0], [0.0, 500.0], [-500.0, 500.0], [-500.0, -500.0]])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    covariance_m2 = rotation @ np.diag([sigma_m**2, (3.0 * sigma_m) ** 2]) @ rotation.T
    zone = Zone("behind the wall", "no_go", [[wall @ rotation.T]])
    found = probability(zone, rotation @ np.array([away_m, 1.0]), covariance_m2)
    assert found == pytest.approx(norm.cdf(-away_m / sigma_m), abs=1e-5)


@given(st.integers(0, 1000), st.floats(-1e4, 1e4), st.floats(-3.1, 3.1))
@examples(40)
def test_a_zone_that_moves_and_turns_with_somebody_changes_nothing(seed: int, shift_m: float, turn: float) -> None:
    xy_m, covariance_m2 = spread(np.random.default_rng(seed))
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    shift = np.array([shift_m, -2.0 * shift_m])
    moved = Zone("moved", "no_go", [[ring @ rotation.T + shift for ring in p] for p in ZONE.polygons_m])
    there = xy_m @ rotation.T + shift
    turned = rotation @ covariance_m2 @ rotation.T
    assert probability(moved, there, turned) == pytest.approx(probability(ZONE, xy_m, covariance_m2), abs=1e-6)
    assert moved.gap_m(there[None])[0][0] == pytest.approx(ZONE.gap_m(xy_m[None])[0][0], abs=1e-6)


def test_a_hole_takes_away_what_it_covers_and_parts_of_a_plane_add_up() -> None:
    xy_m, covariance_m2 = np.array([1.2, 0.7]), np.diag([0.4, 0.2])
    whole, hole = (Zone("a", "no_go", [[ring]]) for ring in (CONCAVE, HOLE))
    holed = Zone("a", "no_go", [[CONCAVE, HOLE]])
    expected = probability(whole, xy_m, covariance_m2) - probability(hole, xy_m, covariance_m2)
    assert probability(holed, xy_m, covariance_m2) == pytest.approx(expected, abs=1e-12)
    corners = [np.array(c, dtype=float) * 300.0 for c in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    quarters = [Zone("q", "no_go", [[np.array([xy_m, corners[k], corners[(k + 1) % 4]])]]) for k in range(4)]
    assert sum(probability(one, xy_m, covariance_m2) for one in quarters) == pytest.approx(1.0, abs=1e-9)


def test_which_way_round_and_in_which_order_a_zone_was_drawn_changes_nothing() -> None:
    xy_m, covariance_m2 = np.array([[1.2, 0.7], [10.0, 2.0]]), np.tile(np.diag([0.4, 0.2]), (2, 1, 1))
    other = Zone("a", "no_go", [[CONCAVE[::-1] + ASIDE], [np.roll(CONCAVE, 2, axis=0)[::-1], HOLE[::-1]]])
    np.testing.assert_allclose(
        probability_inside(other.outline_m, xy_m, covariance_m2),
        probability_inside(ZONE.outline_m, xy_m, covariance_m2),
        atol=1e-12,
    )
    np.testing.assert_allclose(other.gap_m(xy_m)[0], ZONE.gap_m(xy_m)[0], atol=1e-12)


def test_places_without_error_or_without_a_place_are_inside_outside_or_unknown() -> None:
    places = np.array([[1.0, 2.0], [-1.0, 2.0], [np.nan, 1.0], [1.0, 2.0], [1.0, 2.0]])
    covariance_m2 = np.zeros((5, 2, 2))
    covariance_m2[3] = np.nan
    covariance_m2[4] = [[1e14, 1e14], [1e14, 1e14]]
    found = probability_inside(ZONE.outline_m, places, covariance_m2)
    np.testing.assert_allclose(found[:2], [1.0, 0.0], atol=1e-12)
    assert np.isnan(found[2:4]).all()
    assert 0.0 <= found[4] < 1e-4
