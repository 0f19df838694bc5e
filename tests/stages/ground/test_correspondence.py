from __future__ import annotations

import numpy as np
import pytest
from drawn_ground import SIZE_PX, lens, view
from hypothesis import given
from hypothesis import strategies as st

from standoff.core import homography
from standoff.stages.ground.correspondence import camera_misfit_px, turn_from_before
from standoff.stages.ground.shape import ReferenceShape

FOCAL_WIDTHS = (0.4, 6.0)
FOOTING = ReferenceShape.from_sides((2.4, 2.6, 0.6, 2.6), 2.9)
PLANK = ReferenceShape.rectangle(1.0, 4.0)

tilts, yaws, focals = st.floats(5.0, 70.0), st.floats(0.0, 360.0), st.floats(250.0, 1500.0)
turns = st.integers(0, 3)


@given(tilts, yaws, focals, turns, st.sampled_from([FOOTING, PLANK, ReferenceShape.square(2.89)]))
def test_the_true_order_of_corners_is_one_that_a_camera_could_see(
    tilt: float, yaw: float, focal_px: float, turn: int, shape: ReferenceShape
) -> None:
    camera = lens(focal_px)
    corners_px, valid = homography.apply(view(camera, (1.0, 1.0), focal_px / 30.0, tilt, yaw), shape.corners_m)
    assert valid.all()
    # Listed from another corner: corner 0 of the shape is now corner `turn` of the list.
    listed = np.roll(corners_px, turn, axis=0)
    # The unknown focal length is looked for in steps of 6 %.
    assert camera_misfit_px(listed, shape, SIZE_PX, FOCAL_WIDTHS)[turn] < 0.3
    assert camera_misfit_px(listed, shape, SIZE_PX, FOCAL_WIDTHS, camera)[turn] < 1e-3


@given(st.floats(5.0, 40.0), yaws, st.sampled_from([FOOTING, PLANK]))
def test_a_known_camera_tells_the_corners_of_an_uneven_shape_apart(
    tilt: float, yaw: float, shape: ReferenceShape
) -> None:
    camera = lens()
    corners_px, _ = homography.apply(view(camera, (1.0, 1.0), 14.0, tilt, yaw), shape.corners_m)
    misfit = camera_misfit_px(corners_px, shape, SIZE_PX, FOCAL_WIDTHS, camera)
    others = [turn for turn in range(4) if turn not in shape.turns_onto_itself()]
    assert misfit[others].min() > 5.0


@given(tilts, yaws)
def test_any_order_suits_a_square(tilt: float, yaw: float) -> None:
    camera = lens()
    corners_px, _ = homography.apply(view(camera, (1.0, 1.0), 14.0, tilt, yaw), ReferenceShape.square(2.89).corners_m)
    assert camera_misfit_px(corners_px, ReferenceShape.square(2.89), SIZE_PX, FOCAL_WIDTHS, camera).max() < 1e-3


@given(tilts, yaws, st.integers(0, 1000))
def test_the_misfit_is_no_more_than_the_corners_were_moved(tilt: float, yaw: float, seed: int) -> None:
    camera = lens()
    corners_px, _ = homography.apply(view(camera, (1.0, 1.0), 14.0, tilt, yaw), FOOTING.corners_m)
    moves = np.random.default_rng(seed).normal(0.0, 0.02, (4, 2))  # small: the distance is first order
    misfit = camera_misfit_px(corners_px + moves, FOOTING, SIZE_PX, FOCAL_WIDTHS, camera)[0]
    assert misfit <= 1.1 * np.linalg.norm(moves)


@given(st.floats(-40.0, 40.0), st.floats(0.7, 1.4), st.tuples(st.floats(-300, 300), st.floats(-300, 300)), turns)
def test_the_order_survives_any_move_and_zoom_and_turns_up_to_forty_degrees(
    angle_deg: float, zoom: float, shift: tuple[float, float], turn: int
) -> None:
    before = np.array([[0.0, 0.0], [3.0, 100.0], [98.0, 104.0], [103.0, 1.0]])
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    now = zoom * before @ np.array([[c, s], [-s, c]]) + np.array(shift)
    assert turn_from_before(np.roll(now, turn, axis=0), before) == turn


@pytest.mark.parametrize("turn", range(4))
def test_a_long_rectangle_seen_straight_down_fits_two_orders_only(turn: int) -> None:
    corners_px = np.array([[200.0, 100.0], [200.0, 220.0], [230.0, 220.0], [230.0, 100.0]])
    misfit = camera_misfit_px(corners_px, PLANK, SIZE_PX, FOCAL_WIDTHS)
    assert (misfit[turn] < 0.1) == (turn in (1, 3))
