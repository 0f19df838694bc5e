from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import seeds
from moving_models import MovingModel
from tolerances import GEOMETRY_REL

from standoff.core.homography import FloatArray
from standoff_sim.movement.driving import MOBILITY, drive, walk
from standoff_sim.movement.motion import (
    STEP_S,
    MotionState,
    Place,
    chained,
    eased,
    end_place,
    fitted,
    held,
    place_on_ground,
    sample,
    shifted,
    shortest_s,
    turned,
    with_joints,
    wrapped,
)
from standoff_sim.scene.scene import GroundSurface, Motion

angles = st.floats(-3.1, 3.1)
offsets = st.floats(-40.0, 40.0)


@dataclass(frozen=True, eq=False)
class Slope:
    """A plane as ground: z = 1 + east x + north y."""

    east: float
    north: float

    def height_at(self, xy_m: FloatArray) -> FloatArray:
        heights: FloatArray = 1.0 + xy_m @ np.array([self.east, self.north])
        return heights


def _slope(east: float, north: float) -> GroundSurface:
    return Slope(east, north)  # type: ignore[return-value]


def _derivatives(motion: Motion) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return speeds and accelerations along and across the way, by differences of positions."""
    velocity = np.gradient(motion.xy_m, STEP_S, axis=0)
    speed = np.linalg.norm(velocity, axis=1)
    change = np.gradient(velocity, STEP_S, axis=0)
    ahead = velocity / np.maximum(speed, 1e-6)[:, None]
    along = (change * ahead).sum(axis=1)
    across = np.linalg.norm(change - along[:, None] * ahead, axis=1)
    return speed, np.abs(along), across


@pytest.mark.parametrize("kind", sorted(set(MOBILITY) - {"worker"}))
@pytest.mark.parametrize("seed", seeds(6))
def test_a_drive_keeps_to_every_limit_of_its_machine(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    reverse = bool(seed % 2)
    along_m = -rng.uniform(15, 30) if reverse else rng.uniform(15, 30)
    start = Place(0.0, 0.0, rng.uniform(-0.5, 0.5))
    motion = drive(
        MovingModel(kind), start, Place(along_m, rng.uniform(-12, 12), rng.uniform(-0.8, 0.8)), reverse=reverse
    )
    speed, along, across = _derivatives(motion)
    limits = MOBILITY[kind]
    assert speed.max() <= limits.speed_mps
    assert along.max() <= limits.acceleration_mps2
    assert across.max() <= limits.lateral_mps2
    assert speed.max() > 0.3 * limits.speed_mps


@given(offsets, offsets, angles, angles, st.booleans())
def test_a_drive_begins_and_ends_at_rest_in_its_places(
    x_m: float, y_m: float, first_rad: float, last_rad: float, reverse: bool
) -> None:
    start, end = Place(0.0, 0.0, first_rad), Place(x_m + np.copysign(8.0, x_m), y_m, last_rad)
    motion = drive(MovingModel("dump_truck"), start, end, reverse=reverse)
    np.testing.assert_allclose(motion.xy_m[[0, -1]], [start.xy_m, end.xy_m], atol=1e-6)
    assert motion.heading_rad[0] == pytest.approx(first_rad, abs=1e-6)
    assert wrapped(float(motion.heading_rad[-1]) - last_rad) == pytest.approx(0.0, abs=1e-6)
    assert np.linalg.norm(sample(motion, 0.0).velocity_mps) < 0.01
    travelled_m = motion.joints["travel_m"]
    assert (travelled_m[-1] < 0) == reverse


def test_wheels_that_do_not_steer_never_slip_sideways() -> None:
    model = MovingModel("vehicle")
    motion = drive(model, Place(0.0, 0.0, 0.0), Place(15.0, 12.0, 1.6))
    ahead = np.column_stack([np.cos(motion.heading_rad), np.sin(motion.heading_rad)])
    axle_m = motion.xy_m + MOBILITY["vehicle"].pivot_share * 4.8 * ahead
    velocity = np.gradient(axle_m, STEP_S, axis=0)
    sideways = velocity[:, 1] * ahead[:, 0] - velocity[:, 0] * ahead[:, 1]
    assert np.abs(sideways).max() < 1e-3 * np.linalg.norm(velocity, axis=1).max()


def test_front_wheels_point_along_their_own_way() -> None:
    motion = drive(MovingModel("vehicle"), Place(0.0, 0.0, 0.0), Place(15.0, 12.0, 1.6))
    ahead = np.column_stack([np.cos(motion.heading_rad), np.sin(motion.heading_rad)])
    limits = MOBILITY["vehicle"]
    front_m = motion.xy_m + (limits.pivot_share + limits.wheelbase_share) * 4.8 * ahead
    velocity: FloatArray = np.gradient(front_m, STEP_S, axis=0)
    moving = np.linalg.norm(velocity, axis=1) > 0.3
    east, north = velocity.T
    course_rad = np.unwrap(np.arctan2(north, east))
    steered_deg = np.rad2deg(course_rad - motion.heading_rad)
    np.testing.assert_allclose(steered_deg[moving], motion.joints["steer_deg"][moving], atol=0.05)


@pytest.mark.parametrize("seed", seeds(8))
def test_a_walk_passes_through_its_points_at_a_walking_pace(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points_m = np.cumsum(rng.uniform([2.0, -3.0], [5.0, 3.0], (5, 2)), axis=0)
    motion = walk(points_m, rng.uniform(0.8, 1.5))
    speed, along, across = _derivatives(motion)
    assert speed.max() <= 1.5
    assert along.max() <= MOBILITY["worker"].acceleration_mps2
    assert across.max() <= MOBILITY["worker"].lateral_mps2
    for point_m in points_m:
        assert np.linalg.norm(motion.xy_m - point_m, axis=1).min() < 0.03
    np.testing.assert_allclose(np.gradient(motion.joints["stride_m"], STEP_S), speed, atol=0.02)


@given(st.floats(0.1, 4.0), offsets, offsets)
def test_the_velocity_is_the_derivative_of_the_position(time_s: float, x_m: float, y_m: float) -> None:
    motion = walk([(0.0, 0.0), (x_m + np.copysign(6.0, x_m), y_m)], 1.3)
    near = sample(motion, time_s)
    difference_m = sample(motion, time_s + STEP_S).xy_m - sample(motion, time_s - STEP_S).xy_m
    np.testing.assert_allclose(near.velocity_mps, difference_m / (2 * STEP_S), atol=1e-9)


def test_a_motion_is_held_before_and_after() -> None:
    motion = walk([(0.0, 0.0), (5.0, 0.0)], 1.2)
    before, after = sample(motion, -9.0), sample(motion, 99.0)
    np.testing.assert_array_equal(before.xy_m, [0.0, 0.0])
    np.testing.assert_allclose(after.xy_m, [5.0, 0.0], atol=1e-9)
    np.testing.assert_array_equal(np.abs([before.velocity_mps, after.velocity_mps]), np.zeros((2, 2)))
    assert sample(held(Place(1.0, 2.0, 3.0)), 7.0).heading_rad == 3.0


def test_a_chain_is_continuous_and_adds_up_what_was_walked() -> None:
    there = walk([(0.0, 0.0), (5.0, 0.0)], 1.2)
    turn = turned(end_place(there), 3.0, 120.0)
    back = walk([(5.0, 0.0), (0.0, 0.7)], 1.2)
    whole = chained([there, held(end_place(there), 1.0), turn, back])
    assert (np.diff(whole.time_s) > 0).all()
    assert np.linalg.norm(np.diff(whole.xy_m, axis=0), axis=1).max() < 1.3 * STEP_S
    assert np.abs(np.diff(whole.heading_rad)).max() < 0.1
    walked_m = there.joints["stride_m"][-1] + back.joints["stride_m"][-1]
    assert whole.joints["stride_m"][-1] == pytest.approx(walked_m, rel=GEOMETRY_REL)


def test_a_chain_with_a_gap_is_refused() -> None:
    with pytest.raises(ValueError, match="begins at"):
        chained([held(Place(0.0, 0.0), 1.0), held(Place(1.0, 0.0), 1.0)])


@given(st.floats(-50.0, 50.0), st.floats(5.0, 60.0))
def test_an_eased_joint_never_exceeds_the_rate_it_was_timed_for(change: float, rate_ps: float) -> None:
    duration_s = shortest_s(change, rate_ps) + 1e-9
    time_s = np.linspace(0.0, duration_s, 2000)
    values = eased(time_s, [(0.0, 3.0), (duration_s, 3.0 + change)])
    assert values[0] == 3.0
    assert values[-1] == pytest.approx(3.0 + change)
    assert np.abs(np.diff(values)).max() <= rate_ps * duration_s / 1999 * (1 + 1e-6) + 1e-12


def test_turning_takes_the_shorter_way_at_the_given_rate() -> None:
    motion = turned(Place(0.0, 0.0, 3.0), -3.0, 90.0)
    assert motion.heading_rad[-1] == pytest.approx(3.0 + (2 * np.pi - 6.0))
    assert np.rad2deg(np.abs(np.gradient(motion.heading_rad, STEP_S))).max() <= 90.0


def test_joints_are_kept_within_the_models_ranges() -> None:
    motion = with_joints(held(Place(0.0, 0.0), 2.0), {"bed_deg": [(0.0, -5.0), (2.0, 90.0)], "wings": [(0.0, 1.0)]})
    kept = fitted(motion, MovingModel("dump_truck")).joints
    assert set(kept) == {"bed_deg"}
    assert (kept["bed_deg"].min(), kept["bed_deg"].max()) == (0.0, 50.0)


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), angles, offsets, offsets)
def test_a_machine_lies_flat_on_a_slope(east: float, north: float, heading_rad: float, x_m: float, y_m: float) -> None:
    model, ground = MovingModel("wheel_loader"), _slope(east, north)
    placement = MotionState(np.array([x_m, y_m]), heading_rad, np.zeros(2), {})
    pose = place_on_ground(placement, model.footprint_m, ground)
    corners_m = np.column_stack([model.footprint_m, np.zeros(4), np.ones(4)]) @ pose.T
    np.testing.assert_allclose(corners_m[:, 2], ground.height_at(corners_m[:, :2]), atol=1e-9)
    np.testing.assert_allclose(pose[:2, 3], [x_m, y_m])
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
    assert wrapped(float(np.arctan2(pose[1, 0], pose[0, 0])) - heading_rad) == pytest.approx(0.0, abs=1e-9)


def test_a_person_stands_upright_on_a_slope() -> None:
    placement = MotionState(np.array([3.0, 4.0]), 0.5, np.zeros(2), {})
    pose = place_on_ground(placement, MovingModel("worker").footprint_m, _slope(0.2, -0.1))
    np.testing.assert_allclose(pose[:3, 2], [0.0, 0.0, 1.0])
    assert pose[2, 3] == pytest.approx(1.0 + 0.6 - 0.4)


def test_shifting_changes_the_time_alone() -> None:
    motion = walk([(0.0, 0.0), (5.0, 0.0)], 1.2)
    np.testing.assert_allclose(sample(shifted(motion, 2.0), 4.0).xy_m, sample(motion, 2.0).xy_m, atol=1e-12)
