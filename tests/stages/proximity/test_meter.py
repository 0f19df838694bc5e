from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tolerances import GEOMETRY_REL

from standoff.core.classes import CLASSES, Role
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import GroundMap, GroundPositions, NoGroundMap, Proximities
from standoff.stages.proximity import ProximityMeter, ProximityParams

GROUND = GroundMap(np.eye(3), np.zeros((9, 9)), (1920, 1080), "exact", 0.02)
WORKER, EXCAVATOR, LOADER, REFERENCE = 0, 1, 2, 6


def positions_of(
    xy_m: list[tuple[float, float]] | FloatArray,
    class_id: list[int],
    *,
    track_id: list[int] | None = None,
    velocity_mps: FloatArray | None = None,
    covariance_m2: FloatArray | None = None,
    map_factor_m: FloatArray | None = None,
) -> GroundPositions:
    """Return positions with ids 1, 2 ... ; NaN coordinates make an invalid row."""
    place = np.array(xy_m, dtype=np.float64).reshape(-1, 2)
    count = len(place)
    valid: BoolArray = np.asarray(np.isfinite(place).all(axis=1))
    factor_m = np.zeros((count, 2, 10)) if map_factor_m is None else map_factor_m
    state = np.zeros((count, 4, 4))
    whole_m2 = np.tile(np.eye(2) * 0.01, (count, 1, 1)) if covariance_m2 is None else covariance_m2
    state[:, :2, :2] = whole_m2 - factor_m @ factor_m.transpose(0, 2, 1)
    return GroundPositions(
        track_id=np.array(track_id or range(1, count + 1), dtype=np.int64),
        class_id=np.array(class_id, dtype=np.int64),
        xy_m=place,
        velocity_mps=np.zeros((count, 2)) if velocity_mps is None else velocity_mps,
        state_covariance=state,
        map_factor_m=factor_m,
        predicted=np.zeros(count, dtype=np.bool_),
        standing_s=np.zeros(count),
        radius_m=np.array([CLASSES[i].action_radius_m for i in class_id]),
        valid=valid,
        reason=np.where(valid, "", "beyond the horizon").astype(object),
    )


def measured(positions: GroundPositions, params: ProximityParams | None = None) -> Proximities:
    return ProximityMeter(params).update(0.0, positions, GROUND)


def test_a_worker_and_a_machine_are_measured_centre_to_centre_and_by_their_gap() -> None:
    found = measured(positions_of([(0.0, 0.0), (12.0, 16.0)], [WORKER, LOADER]))
    assert (found.track_a.tolist(), found.track_b.tolist()) == ([1], [2])
    assert found.distance_m[0] == 20.0
    assert found.gap_m[0] == pytest.approx(20.0 - 2.0 - 5.8)
    assert found.sigma_m[0] == pytest.approx(np.sqrt(0.02))
    assert not found.filtered[0]


def classes_of(side: str) -> set[int]:
    """Return what a side of a pair stands for, from the words of its documentation."""
    roles = {"person": {Role.PERSON}, "equipment": {Role.EQUIPMENT}, "any": {Role.PERSON, Role.EQUIPMENT}}
    return {c.id for c in CLASSES if c.name == side or c.role in roles.get(side, set())}


SIDES = st.sampled_from(["person", "equipment", "any", "worker", "excavator", "wheel_loader", "reference"])


@given(
    pairs=st.lists(st.tuples(SIDES, SIDES), min_size=1, max_size=3),
    class_id=st.lists(st.integers(0, len(CLASSES) - 1), max_size=8),
    seed=st.integers(0, 10),
)
def test_every_configured_pair_has_exactly_one_row(
    pairs: list[tuple[str, str]], class_id: list[int], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    track_id = (1 + rng.permutation(len(class_id))).tolist()
    positions = positions_of(rng.normal(size=(len(class_id), 2)), class_id, track_id=track_id)
    found = measured(positions, ProximityParams(pairs=tuple(pairs)))
    expected = {
        tuple(sorted((track_i, track_j)))
        for (track_i, class_i), (track_j, class_j) in itertools.permutations(zip(track_id, class_id, strict=True), 2)
        if any(class_i in classes_of(a) and class_j in classes_of(b) for a, b in pairs)
    }
    rows = list(zip(found.track_a.tolist(), found.track_b.tolist(), strict=True))
    assert rows == sorted(expected)


def test_a_pair_that_cannot_be_measured_keeps_its_row() -> None:
    nowhere = (np.nan, np.nan)
    found = measured(positions_of([(0.0, 0.0), nowhere, (30.0, 0.0)], [WORKER, EXCAVATOR, LOADER]))
    assert found.track_b.tolist() == [2, 3]
    for column in (found.distance_m, found.gap_m, found.sigma_m, found.closing_mps, found.time_to_contact_s):
        assert np.isnan(column[0])
        assert np.isfinite(column[1]) or column is found.time_to_contact_s
    without = ProximityMeter().update(
        0.0, positions_of([nowhere, nowhere], [WORKER, LOADER]), NoGroundMap("reference not found")
    )
    assert len(without) == 1
    assert np.isnan(without.gap_m[0])


COORDINATES = st.floats(-100, 100)


@given(
    places=st.lists(st.tuples(COORDINATES, COORDINATES), min_size=4, max_size=4),
    turn=st.floats(0, 2 * np.pi),
    shift=st.tuples(COORDINATES, COORDINATES),
    order=st.permutations(range(4)),
)
def test_nothing_depends_on_where_north_is_or_in_which_order_the_rows_come(
    places: list[tuple[float, float]], turn: float, shift: tuple[float, float], order: list[int]
) -> None:
    rng = np.random.default_rng(3)
    spread = rng.normal(size=(4, 2, 2))
    factor_m = rng.normal(size=(4, 2, 10)) * 0.1
    covariance = spread @ spread.transpose(0, 2, 1) + factor_m @ factor_m.transpose(0, 2, 1)
    velocity = rng.normal(size=(4, 2))
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    here = positions_of(places, [0, 0, 1, 2], velocity_mps=velocity, covariance_m2=covariance, map_factor_m=factor_m)
    there = positions_of(
        np.array(places) @ rotation.T + shift,
        [0, 0, 1, 2],
        velocity_mps=velocity @ rotation.T,
        covariance_m2=rotation @ covariance @ rotation.T,
        map_factor_m=rotation @ factor_m,
    )
    first, second = measured(here), measured(there[np.array(order)])
    np.testing.assert_array_equal(first.track_a, second.track_a)
    np.testing.assert_array_equal(first.track_b, second.track_b)
    np.testing.assert_allclose(first.distance_m, second.distance_m, atol=1e3 * GEOMETRY_REL)
    well_apart = first.distance_m > 10.0
    np.testing.assert_allclose(first.sigma_m[well_apart], second.sigma_m[well_apart], rtol=1e3 * GEOMETRY_REL)
    np.testing.assert_allclose(first.closing_mps[well_apart], second.closing_mps[well_apart], atol=1e3 * GEOMETRY_REL)


def test_an_error_that_both_share_through_the_map_does_not_count() -> None:
    shared = np.zeros((2, 2, 10))
    shared[:, 0, 0] = shared[:, 1, 1] = 3.0
    covariance = np.tile(np.eye(2) * (0.01 + 9.0), (2, 1, 1))
    found = measured(positions_of([(0.0, 0.0), (20.0, 0.0)], [0, 1], covariance_m2=covariance, map_factor_m=shared))
    assert found.sigma_m[0] == pytest.approx(np.sqrt(0.02))


def test_only_the_error_along_the_pair_counts_until_the_pair_is_nearer_than_its_error() -> None:
    covariance = np.tile(np.diag([0.01, 4.0]), (2, 1, 1))
    for x_m, variance in ((20.0, 0.02), (1.0, 8.0), (0.0, 8.0)):
        found = measured(positions_of([(0.0, 0.0), (x_m, 0.0)], [0, 1], covariance_m2=covariance))
        assert found.sigma_m[0] == pytest.approx(np.sqrt(variance))


@pytest.mark.parametrize(
    ("velocity_mps", "closing_mps", "contact_s"),
    [
        ([[0.0, 0.0], [-2.0, 5.0]], 2.0, (20.0 - 7.8) / 2.0),
        ([[1.0, 0.0], [-1.0, 0.0]], 2.0, (20.0 - 7.8) / 2.0),
        ([[0.0, 0.0], [3.0, 0.0]], -3.0, np.inf),
        ([[0.0, 0.0], [0.0, 3.0]], 0.0, np.inf),
        ([[np.nan, np.nan], [3.0, 0.0]], np.nan, np.nan),
    ],
)
def test_closing_speed_and_time_to_contact(
    velocity_mps: list[list[float]], closing_mps: float, contact_s: float
) -> None:
    places = [(0.0, 0.0), (20.0, 0.0)]
    found = measured(positions_of(places, [WORKER, LOADER], velocity_mps=np.array(velocity_mps)))
    np.testing.assert_allclose(found.closing_mps, [closing_mps])
    np.testing.assert_allclose(found.time_to_contact_s, [contact_s])


def test_contact_is_now_where_the_circles_touch_whatever_the_speed() -> None:
    unknown = np.full((2, 2), np.nan)
    for x_m in (0.0, 7.0):
        found = measured(positions_of([(0.0, 0.0), (x_m, 0.0)], [WORKER, LOADER], velocity_mps=unknown))
        assert found.gap_m[0] < 0
        assert found.time_to_contact_s[0] == 0.0
        assert np.isnan(found.closing_mps[0])


def distances(
    places_m: list[float], params: ProximityParams, *, ground: GroundMap = GROUND, step_s: float = 0.1
) -> tuple[list[float], list[bool], list[float]]:
    """Return distance, filtered and sigma of one pair over time; NaN places are not located."""
    meter = ProximityMeter(params)
    rows = [
        meter.update(step_s * i, positions_of([(0.0, 0.0), (x_m, 0.0 * x_m)], [WORKER, LOADER]), ground)
        for i, x_m in enumerate(places_m)
    ]
    return (
        [float(row.distance_m[0]) for row in rows],
        [bool(row.filtered[0]) for row in rows],
        [float(row.sigma_m[0]) for row in rows],
    )


def test_a_replaced_distance_is_marked_and_its_sigma_tells_how_far_it_was_moved() -> None:
    found_m, filtered, sigma_m = distances([20.0, 20.0, 35.0, 20.0], ProximityParams(outlier_filter="paper"))
    assert found_m == [20.0, 20.0, 20.0, 20.0]
    assert filtered == [False, False, True, False]
    assert sigma_m[2] == pytest.approx(np.hypot(15.0, sigma_m[0]))


def test_the_papers_threshold_is_pixels_of_the_rectified_plane_unless_given_in_metres() -> None:
    coarse = GroundMap(np.eye(3), np.zeros((9, 9)), (1920, 1080), "exact", 0.2)

    def is_replaced(jump_m: float, threshold_m: float | None, ground: GroundMap) -> bool:
        params = ProximityParams(outlier_filter="paper", outlier_threshold_m=threshold_m)
        return distances([20.0, 20.0, 20.0 + jump_m], params, ground=ground)[1][2]

    assert is_replaced(1.01, None, GROUND)
    assert not is_replaced(0.99, None, GROUND)
    assert is_replaced(10.1, None, coarse)
    assert not is_replaced(9.9, None, coarse)
    assert not is_replaced(5.0, 6.0, GROUND)
    assert is_replaced(5.0, 4.0, coarse)


@pytest.mark.parametrize(
    "params",
    [ProximityParams(), ProximityParams(outlier_filter="paper", outlier_threshold_px=None)],
)
def test_without_filter_or_threshold_everything_passes(params: ProximityParams) -> None:
    places_m = [20.0, 20.0, 95.0, 20.0]
    assert distances(places_m, params)[0] == places_m


def test_the_papers_filter_repeats_a_stale_distance_for_ever() -> None:
    jump_m = [40.0, 40.0, *[9.0] * 30]
    frozen_m, _, _ = distances(jump_m, ProximityParams(outlier_filter="paper"))
    assert set(frozen_m) == {40.0}


def test_a_frame_without_measurement_and_the_end_of_a_track_clear_the_filter() -> None:
    params = ProximityParams(outlier_filter="paper")
    found_m, filtered, _ = distances([20.0, 20.0, np.nan, 95.0, 95.0], params)
    assert np.isnan(found_m[2])
    assert found_m[3:] == [95.0, 95.0]
    assert not any(filtered)
    meter = ProximityMeter(params)
    for i, x_m in enumerate((20.0, 20.0)):
        meter.update(0.1 * i, positions_of([(0.0, 0.0), (x_m, 0.0)], [WORKER, LOADER]), GROUND)
    assert len(meter.update(0.2, positions_of([(0.0, 0.0)], [WORKER]), GROUND)) == 0
    back = meter.update(0.3, positions_of([(0.0, 0.0), (95.0, 0.0)], [WORKER, LOADER]), GROUND)
    assert back.distance_m.tolist() == [95.0]


def test_a_reset_forgets_and_leaves_other_streams_alone() -> None:
    params = ProximityParams(outlier_filter="paper")
    first, second = ProximityMeter(params), ProximityMeter(params)
    for i in range(3):
        for meter in (first, second):
            meter.update(0.1 * i, positions_of([(0.0, 0.0), (20.0, 0.0)], [WORKER, LOADER]), GROUND)
    first.reset()
    jumped = positions_of([(0.0, 0.0), (60.0, 0.0)], [WORKER, LOADER])
    assert first.update(0.3, jumped, GROUND).distance_m.tolist() == [60.0]
    assert second.update(0.3, jumped, GROUND).distance_m.tolist() == [20.0]


def test_nothing_in_sight_gives_no_rows() -> None:
    assert len(ProximityMeter().update(0.0, GroundPositions.empty(), GROUND)) == 0


def test_a_side_that_nothing_is_called_is_named_with_what_there_is() -> None:
    with pytest.raises(ValueError, match="pairs: nothing is called 'crane'; there are person, equipment, any, worker"):
        ProximityParams(pairs=(("worker", "crane"),))
