from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import seeds

from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff_sim.camera.viewpoints import Obstacles, Passing, draw_flight, draw_view
from standoff_sim.scene.moment import EntityState
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.mesh import Surface, box, rotation, scaling, translation

_SIZE_PX = (320, 180)
_NOTHING = Obstacles.of(())


def _body(x_m: float, y_m: float) -> EntityState:
    centre_m = np.array([x_m, y_m, 0.0])
    return EntityState(1, 0, (), (), centre_m, 0.0, np.zeros(2), np.zeros((4, 2)), np.full(3, np.nan))


def _tower(height_m: float, pose: FloatArray) -> Batch:
    return place(box((2.0, 4.0, height_m), (0.5, 0.5, 0.5), Surface.CONCRETE), pose)


def _views(bodies: list[EntityState], obstacles: Obstacles = _NOTHING, count: int = 60) -> list[View]:
    rng = np.random.default_rng(1)
    return [draw_view(rng, _SIZE_PX, bodies, obstacles) for _ in range(count)]


def _shown(view: View, bodies: list[EntityState]) -> int:
    px = view.project(np.array([body.centre_m for body in bodies]))
    return int(((px >= 0) & (px <= _SIZE_PX)).all(axis=1).sum())


def test_most_views_show_several_bodies_and_people_of_a_useful_size() -> None:
    rng = np.random.default_rng(0)
    bodies = [_body(*rng.normal(0.0, 10.0, 2)) for _ in range(8)]
    views = _views(bodies)
    assert np.mean([_shown(view, bodies) >= 3 for view in views]) > 0.8
    heights_m = np.array([view.position_m[2] for view in views])
    assert heights_m.min() >= 4.0 and heights_m.max() <= 60.0 and np.ptp(heights_m) > 25.0
    assert 0.0 < np.mean(heights_m < 15.0) < 0.3, "some drones come down"
    pitches_deg = np.rad2deg(np.arcsin(-np.array([view.site_to_camera[2, 2] for view in views])))
    assert pitches_deg.min() >= 19.9 and np.ptp(pitches_deg) > 50.0


def test_an_empty_site_can_be_seen() -> None:
    assert all(np.isfinite(view.project(np.zeros((1, 3)))).all() for view in _views([], count=5))


def test_no_view_has_a_tower_in_front_of_it() -> None:
    towers = Obstacles.of([_tower(50.0, translation(x, y, 0.0)) for x in (-18, 18) for y in (-18, 18)])
    bodies = [_body(0.0, 0.0), _body(4.0, 1.0)]
    aware, unaware = (
        np.mean([_is_blocked(view, towers) for view in _views(bodies, obstacles, 150)])
        for obstacles in (towers, _NOTHING)
    )
    assert aware == 0.0 < unaware


def _is_blocked(view: View, obstacles: Obstacles) -> bool:
    middle_px = np.array([[_SIZE_PX[0] / 2, _SIZE_PX[1] / 2]])
    return obstacles.hide(view.position_m, view.position_m + 8.0 * view.rays(middle_px)[0])


@given(
    turn_deg=st.floats(0.0, 360.0), factor=st.floats(0.5, 3.0), x_m=st.floats(-50.0, 50.0), y_m=st.floats(-50.0, 50.0)
)
def test_a_box_hides_what_is_behind_it_however_it_is_placed(
    turn_deg: float, factor: float, x_m: float, y_m: float
) -> None:
    pose = translation(x_m, y_m, 0.0) @ rotation("z", turn_deg) @ scaling(factor, factor, factor)
    tower = Obstacles.of([_tower(8.0, pose)])
    middle = np.array([x_m, y_m, 2.0])
    aside = np.array([0.0, 6.5 + 3.0 * factor, 0.0])
    ahead = np.array([30.0, 0.0, 0.0])
    assert tower.hide(middle - ahead, middle + ahead)
    assert tower.hide(middle, middle + ahead), "a camera inside"
    assert not tower.hide(middle - ahead + aside, middle + ahead + aside)
    assert not tower.hide(middle - 2 * ahead, middle - ahead), "not far enough"


def test_what_is_low_hides_nothing() -> None:
    low = Obstacles.of([_tower(1.0, translation(0.0, 0.0, 0.0))])
    assert not low.hide(np.array([-9.0, 0.0, 0.5]), np.array([9.0, 0.0, 0.5]))


@pytest.mark.parametrize("seed", seeds(4))
def test_a_drone_is_where_it_was_aimed_at_the_time_of_the_picture(seed: int) -> None:
    rng = np.random.default_rng(seed)
    view = _views([_body(0.0, 0.0)], count=1)[0]
    flights = [draw_flight(rng, view, 3.0) for _ in range(20)]
    passing = [flight for flight in flights if isinstance(flight, Passing)]
    assert 0 < len(passing) < len(flights)
    for flight in flights:
        np.testing.assert_array_equal(flight.view(3.0).position_m, view.position_m)
    for flight in passing:
        moved_m = flight.view(4.0).position_m - view.position_m
        assert 0.5 <= np.linalg.norm(moved_m) <= 10.0 and moved_m[2] == 0.0
