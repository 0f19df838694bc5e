from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tolerances import GEOMETRY_REL

from standoff_sim.machines.digging import knee_m
from standoff_sim.machines.joints import settle
from standoff_sim.machines.machine_parts import Crawler, Ram, cab, ram_poses, scoop, strut_pose, wheel
from standoff_sim.machines.paint import Painted, draw_livery, weather
from standoff_sim.machines.running_gear import Axles, Crawlers
from standoff_sim.solids.loose_material import soil_heap
from standoff_sim.solids.mesh import Mesh, srgb

_CRAWLER = Crawler(4.4, 0.95, 0.6, 45)
_coordinate = st.floats(-5.0, 5.0)
_point = st.tuples(_coordinate, _coordinate, _coordinate)


def _facing_outwards(mesh: Mesh) -> float:
    """Return the share of triangles whose winding agrees with the normals."""
    a, b, c = (mesh.vertices_m[mesh.triangles[:, i]].astype(np.float64) for i in range(3))
    winding = np.cross(b - a, c - a)
    return float((np.einsum("ij,ij->i", winding, mesh.normals[mesh.triangles[:, 0]]) > 0).mean())


@given(_point, _point)
def test_a_strut_runs_from_its_start_towards_its_end_and_is_level_across(
    start: tuple[float, float, float], end: tuple[float, float, float]
) -> None:
    length = np.linalg.norm(np.subtract(end, start))
    if length < 1e-3:
        return
    pose = strut_pose(start, end)
    np.testing.assert_allclose(pose @ [length, 0.0, 0.0, 1.0], [*end, 1.0], atol=1e-9)
    np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-9)
    assert np.linalg.det(pose[:3, :3]) > 0
    assert abs(pose[2, 1]) < 1e-9
    assert pose[1, 1] >= -1e-9


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.3, 4.0), st.floats(0.3, 4.0))
def test_two_bars_meet_at_their_own_lengths_from_the_pivots(x: float, z: float, first: float, second: float) -> None:
    start, end = np.array([0.5, 0.2, 1.0]), np.array([0.5 + x, 0.2, 1.0 + z])
    span = float(np.hypot(x, z))
    if not abs(first - second) + 1e-3 < span < first + second - 1e-3:
        return
    knee = knee_m(start, end, first, second)
    assert np.linalg.norm(knee - start) == pytest.approx(first, rel=1e-6)
    assert np.linalg.norm(knee - end) == pytest.approx(second, rel=1e-6)
    assert (end - start)[0] * (knee - start)[2] - (end - start)[2] * (knee - start)[0] > 0.0


def test_all_shoes_are_on_the_ground_or_above_and_within_the_crawler() -> None:
    poses = _CRAWLER.shoe_poses(0.123)
    outside = _CRAWLER.shoe().vertices_m @ np.swapaxes(poses[:, :3, :3], 1, 2) + poses[:, None, :3, 3]
    assert -0.005 < outside[..., 2].min() < 0.02
    assert np.ptp(outside[..., 2]) == pytest.approx(_CRAWLER.height_m, abs=0.03)
    assert np.ptp(outside[..., 0]) == pytest.approx(_CRAWLER.length_m, abs=0.05)


def test_shoes_are_evenly_spaced_along_the_chain() -> None:
    centres = _CRAWLER.shoe_poses(0.37)[:, :3, 3]
    apart = np.linalg.norm(centres - np.roll(centres, 1, axis=0), axis=1)
    assert apart.max() <= _CRAWLER.pitch_m * (1.0 + GEOMETRY_REL)
    assert apart.min() > 0.98 * _CRAWLER.pitch_m


def test_shoes_on_the_ground_stand_still_while_the_machine_rolls_over_them() -> None:
    step_m = 0.02
    before, after = _CRAWLER.shoe_poses(0.0), _CRAWLER.shoe_poses(step_m)
    grounded = (before[:, 2, 3] < 0.06) & (after[:, 2, 3] < 0.06) & (np.abs(before[:, 0, 3]) < 1.5)
    assert grounded.sum() > 10
    np.testing.assert_allclose((after - before)[grounded, 0, 3], -step_m, atol=1e-9)


def test_after_a_pitch_the_crawler_looks_the_same() -> None:
    one, next_one = _CRAWLER.shoe_poses(0.0), _CRAWLER.shoe_poses(_CRAWLER.pitch_m)
    np.testing.assert_allclose(np.roll(next_one, 1, axis=0), one, atol=1e-9)


def test_a_ram_covers_every_distance_between_its_shortest_and_longest() -> None:
    ram = Ram.spanning(1.5, 2.6, 0.08)
    barrel_m, rod_m = (float(mesh.vertices_m[:, 0].max()) for mesh in (ram.barrel, ram.rod))
    assert barrel_m < 1.5
    assert rod_m < 1.5
    assert barrel_m + rod_m > 2.6
    with pytest.raises(ValueError, match="no cylinder spans"):
        Ram.spanning(1.0, 2.1, 0.08)
    barrel, rod = ram_poses(np.array([1.0, 0.3, 0.2]), np.array([-0.4, 0.3, 1.5]))
    np.testing.assert_allclose(barrel[:3, 0], -rod[:3, 0], atol=1e-12)


@pytest.mark.parametrize("lugs", [0, 14])
def test_a_wheel_has_its_radius_and_width_and_rolls_about_y(lugs: int) -> None:
    mesh = wheel(0.7, 0.5, None, lugs=lugs)
    around_m = np.hypot(mesh.vertices_m[:, 0], mesh.vertices_m[:, 2])
    assert around_m.max() == pytest.approx(0.7, rel=0.02)
    assert np.ptp(mesh.vertices_m[:, 1]) == pytest.approx(0.5, rel=0.25)
    assert _facing_outwards(mesh) == 1.0


def test_wheels_and_tracks_are_placed_where_they_belong() -> None:
    painted = Painted(wheel(0.5, 0.3, None), srgb("#404040"), 0.1)
    (batch,) = Axles(painted, 0.5, np.array([[1.0, 0.5, 0.5], [-1.0, -0.5, 0.5]])).batches(0.5 * np.pi / 2)
    np.testing.assert_allclose(batch.poses[:, :3, 3], [[1.0, 0.5, 0.5], [-1.0, -0.5, 0.5]])
    np.testing.assert_allclose(batch.poses[0, :3, 2], [1.0, 0.0, 0.0], atol=1e-6)
    shoes, frames = Crawlers(_CRAWLER, 2.2, painted, painted).batches(0.0)
    assert len(shoes.poses) == 2 * _CRAWLER.shoes
    np.testing.assert_allclose(frames.poses[:, 1, 3], [-1.1, 1.1], rtol=1e-6)


def test_a_scoop_ends_in_its_teeth() -> None:
    path = [(1.2, 0.0), (0.8, 0.3), (0.3, 0.4), (0.0, 0.2)]
    reach_m = float(scoop(path, 1.0, None, teeth=5, tooth_m=0.2).vertices_m[:, 0].max())
    assert reach_m == pytest.approx(1.2 + 0.2 * 0.8, abs=1e-5)
    assert scoop(path, 1.0, None).vertices_m[:, 0].max() < 1.23


def test_solids_face_outwards() -> None:
    for mesh in (cab(1.7, 1.0, 1.7), soil_heap(1.0, 2.0, 0.4, None), _CRAWLER.shoe(), _CRAWLER.frame()):
        assert _facing_outwards(mesh) > 0.99


def test_joints_are_held_within_limits_and_unknown_ones_named() -> None:
    limits = {"boom_deg": (-40.0, 60.0), "load": (0.0, 1.0)}
    assert settle({"boom_deg": 90.0}, limits, {"boom_deg": 10.0}) == {"boom_deg": 60.0, "load": 0.0}
    assert settle({}, limits, {"boom_deg": 10.0})["boom_deg"] == 10.0
    with pytest.raises(ValueError, match="bom_deg"):
        settle({"bom_deg": 1.0}, limits, {})


def test_paints_are_albedos_that_real_machines_have() -> None:
    rng = np.random.default_rng(0)
    bodies = np.array([draw_livery(rng).body for _ in range(200)])
    assert bodies.min() >= 0.01
    assert bodies.max() <= 0.8
    assert len(np.unique(bodies.round(6), axis=0)) == 200
    assert weather(np.random.default_rng(1), (0.5, 0.4, 0.1), 0.0) == (0.5, 0.4, 0.1)
