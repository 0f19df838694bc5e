from __future__ import annotations

import numpy as np
import pytest
import shapely
from laws import seeds

from standoff_sim.movement.footpaths import Footpaths, rounded


def _circles(rng: np.random.Generator) -> shapely.Geometry:
    return shapely.union_all(
        [shapely.Point(rng.uniform(-20, 20, 2)).buffer(float(rng.uniform(2, 6))) for _ in range(5)]
    )


@pytest.mark.parametrize("seed", seeds(5))
def test_a_way_keeps_off_what_is_avoided_and_is_no_shorter_than_straight(seed: int) -> None:
    rng = np.random.default_rng(seed)
    avoided = _circles(rng)
    paths, found = Footpaths(avoided), 0
    for _ in range(20):
        start_m, end_m = rng.uniform(-30, 30, (2, 2))
        if not paths.are_free(np.array([start_m, end_m])).all():
            continue
        way_m = paths.way(start_m, end_m)
        if way_m is None:
            continue
        found += 1
        np.testing.assert_allclose(way_m[[0, -1]], [start_m, end_m], atol=1e-12)
        line = shapely.LineString(way_m)
        # Rounded corners may cut a little of a corner that lies outside by as much.
        assert line.intersection(avoided).length < 0.2
        assert line.length >= np.linalg.norm(end_m - start_m) - 1e-9
        if not shapely.LineString([start_m, end_m]).intersects(avoided):
            assert line.length == pytest.approx(np.linalg.norm(end_m - start_m))
    assert found > 5


def test_who_is_walled_in_has_no_way_out() -> None:
    wall = shapely.Point(0.0, 0.0).buffer(10.0) - shapely.Point(0.0, 0.0).buffer(8.0)
    assert Footpaths(wall).way(np.array([0.0, 0.0]), np.array([20.0, 0.0])) is None


def test_who_stands_on_avoided_ground_leaves_it_the_nearest_way() -> None:
    way_m = Footpaths(shapely.box(-10.0, -10.0, 10.0, 10.0)).way(np.array([8.0, 0.0]), np.array([30.0, 0.0]))
    assert way_m is not None
    np.testing.assert_allclose(way_m[:, 1], 0.0, atol=1e-9)


def test_rounding_leaves_the_ends_and_straight_legs_where_they_are() -> None:
    way_m = rounded(np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]))
    np.testing.assert_allclose(way_m[[0, -1]], [[0.0, 0.0], [10.0, 10.0]], atol=1e-12)
    straight_m = shapely.LineString([(0, 0), (10, 0), (10, 10)])
    assert max(straight_m.distance(shapely.Point(one)) for one in way_m) < 0.75
    assert np.linalg.norm(np.diff(way_m, axis=0), axis=1).max() <= 2.0 + 1e-9


def test_a_way_that_would_come_back_as_it_went_goes_straight_on() -> None:
    there_m, out_m, on_m = [0.0, 0.0], [3.0, 1.0], [-4.0, 6.0]
    np.testing.assert_allclose(rounded(np.array([there_m, out_m, there_m, on_m])), rounded(np.array([there_m, on_m])))
    half_way_m = [1.5, 0.5]
    straight_m = rounded(np.array([there_m, out_m, out_m, half_way_m]))
    np.testing.assert_allclose(straight_m[[0, -1]], [there_m, half_way_m])
    assert np.linalg.norm(np.diff(straight_m, axis=0), axis=1).sum() == pytest.approx(float(np.linalg.norm(half_way_m)))
