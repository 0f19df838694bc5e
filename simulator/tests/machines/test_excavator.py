from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
import shapely
from laws import seeds

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff_sim.machines.digging import Link
from standoff_sim.machines.excavator import LIMITS, Excavator, build_excavator, make_excavator, reach
from standoff_sim.machines.excavator_sizes import SIZES
from standoff_sim.scene.scene import Batch

_TRIANGLES = 8000
_BOUNDED = ("boom_deg", "arm_deg", "bucket_deg")


def _points_m(batches: Iterable[Batch]) -> FloatArray:
    return np.concatenate(
        [batch.mesh.vertices_m @ pose[:3, :3].T + pose[:3, 3] for batch in batches for pose in batch.poses]
    ).astype(np.float64)


def _random_joints(rng: np.random.Generator) -> dict[str, float]:
    joints = {name: float(rng.uniform(*LIMITS[name])) for name in _BOUNDED}
    return {**joints, "swing_deg": float(rng.uniform(-360, 360)), "track_m": 1.7, "load": float(rng.uniform())}


@pytest.fixture(params=range(len(SIZES)))
def excavator(request: pytest.FixtureRequest) -> Excavator:
    return build_excavator(SIZES[request.param], np.random.default_rng(request.param))


def test_it_stands_on_the_ground(excavator: Excavator) -> None:
    assert _points_m(excavator.parts({}))[:, 2].min() == pytest.approx(0.0, abs=0.03)


def test_its_size_is_a_real_machines(excavator: Excavator) -> None:
    prior = CLASS_BY_NAME["excavator"]
    points_m = _points_m(excavator.parts({}))
    across_m = np.ptp(excavator.footprint_m[:, 1])
    assert 0.6 * prior.height_m < points_m[:, 2].max() < 1.4 * 1.04 * prior.height_m
    assert 0.6 * prior.width_m < across_m < 1.4 * prior.width_m
    long_reach = excavator.linkage.boom_m > 7.0
    assert 0.6 * prior.length_m < np.ptp(points_m[:, 0]) < (1.8 if long_reach else 1.5) * prior.length_m
    assert excavator.height_m == pytest.approx(points_m[:, 2].max(), abs=1e-5)


def test_the_footprint_encloses_what_is_near_the_ground(excavator: Excavator) -> None:
    away = excavator.parts(reach(excavator, 0.7 * _longest_m(excavator), 2.0, -100.0))
    points_m = _points_m(away)
    low = points_m[points_m[:, 2] < 0.25]
    outline = shapely.Polygon(excavator.footprint_m)
    assert outline.exterior.is_ccw
    assert len(low) > 100
    assert shapely.contains_xy(outline.buffer(0.03), low[:, :2]).all()
    assert outline.area < 1.1 * shapely.MultiPoint(low[:, :2]).convex_hull.area


def _longest_m(model: Excavator) -> float:
    return model.scale * (model.linkage.boom_m + model.linkage.arm_m + model.linkage.bucket_m)


def test_it_has_a_budget_of_triangles(excavator: Excavator) -> None:
    count = sum(len(batch.mesh.triangles) * len(batch.poses) for batch in excavator.parts({"load": 1.0}))
    assert 3000 < count < _TRIANGLES


@pytest.mark.parametrize("seed", seeds(4))
def test_the_tool_tip_is_the_end_of_the_bucket(excavator: Excavator, seed: int) -> None:
    joints = _random_joints(np.random.default_rng(seed))
    frames = excavator.linkage.frames({**joints})
    (bucket,) = (skin.at(frames[Link.BUCKET]) for skin in excavator.skins[Link.BUCKET])
    corners_m = excavator.scale * _points_m([bucket])
    pivot_m = excavator.scale * frames[Link.BUCKET][:3, 3]
    along = excavator.tool_tip_m(joints) - pivot_m
    ahead_m = (corners_m - pivot_m) @ (along / np.linalg.norm(along))
    edge = corners_m[ahead_m > ahead_m.max() - 0.002]
    # A bucket without teeth ends in a plate 4.5 cm thick, of which the tip is the middle.
    half_plate_m = 0.024 if excavator.linkage.bucket_m == 1.25 else 0.0
    np.testing.assert_allclose(edge.mean(axis=0), excavator.tool_tip_m(joints), atol=0.01 + half_plate_m)


@pytest.mark.parametrize("seed", seeds(4))
def test_every_cylinder_ends_at_its_pivots(excavator: Excavator, seed: int) -> None:
    joints = _random_joints(np.random.default_rng(seed))
    frames = excavator.linkage.frames(joints)
    batches = {id(batch.mesh): batch for batch in excavator.parts(joints)}
    for mount in excavator.rams:
        barrel, rod = batches[id(mount.ram.barrel)], batches[id(mount.ram.rod)]
        barrel_long_m, rod_long_m = (
            excavator.scale * float(mesh.vertices_m[:, 0].max()) for mesh in (mount.ram.barrel, mount.ram.rod)
        )
        for index, side_m in enumerate(mount.sides_m):
            shift = np.array([0.0, side_m, 0.0])
            held_m = excavator.scale * (frames[mount.barrel_link] @ [*(mount.barrel_m + shift), 1.0])[:3]
            moved_m = excavator.scale * (frames[mount.rod_link] @ [*(mount.rod_m + shift), 1.0])[:3]
            np.testing.assert_allclose(barrel.poses[index, :3, 3], held_m, atol=1e-4)
            np.testing.assert_allclose(rod.poses[index, :3, 3], moved_m, atol=1e-4)
            ahead = (moved_m - held_m) / np.linalg.norm(moved_m - held_m)
            np.testing.assert_allclose(barrel.poses[index, :3, 0] / excavator.scale, ahead, atol=1e-4)
            np.testing.assert_allclose(rod.poses[index, :3, 0] / excavator.scale, -ahead, atol=1e-4)
            assert barrel_long_m + rod_long_m > np.linalg.norm(moved_m - held_m) - 0.02


@pytest.mark.parametrize("seed", seeds(4))
def test_the_bucket_linkage_stays_closed(excavator: Excavator, seed: int) -> None:
    frames = excavator.linkage.frames(_random_joints(np.random.default_rng(seed)))
    linkage = excavator.linkage
    rod_end = (frames[Link.ROCKER] @ [linkage.rocker_m, 0.0, 0.0, 1.0])[:3]
    ear = (frames[Link.BUCKET] @ [linkage.ear_xz_m[0], 0.0, linkage.ear_xz_m[1], 1.0])[:3]
    np.testing.assert_allclose(rod_end, frames[Link.TIE][:3, 3], atol=1e-9)
    np.testing.assert_allclose((frames[Link.TIE] @ [linkage.tie_m, 0.0, 0.0, 1.0])[:3], ear, atol=1e-9)


@pytest.mark.parametrize(("share", "height_m", "attitude_deg"), [(0.6, 0.0, -100), (0.5, 2.5, -150), (0.65, -1.0, -80)])
def test_reach_brings_the_tip_where_it_is_told(
    excavator: Excavator, share: float, height_m: float, attitude_deg: float
) -> None:
    radius_m = share * _longest_m(excavator)
    joints = {**reach(excavator, radius_m, height_m, attitude_deg), "swing_deg": 37.0}
    tip = excavator.tool_tip_m(joints)
    ahead = np.array([np.cos(np.deg2rad(37.0)), np.sin(np.deg2rad(37.0))])
    assert tip[:2] @ ahead == pytest.approx(radius_m, abs=1e-6)
    assert tip[2] == pytest.approx(height_m, abs=1e-6)
    along = tip - excavator.scale * excavator.linkage.frames(joints)[Link.BUCKET][:3, 3]
    elevation_deg = np.rad2deg(np.arctan2(along[2], along[:2] @ ahead))
    assert elevation_deg == pytest.approx(attitude_deg, abs=1e-6)
    assert all(LIMITS[name][0] <= value <= LIMITS[name][1] for name, value in joints.items())


def test_reach_says_what_is_too_far_and_what_a_joint_cannot_do() -> None:
    model = build_excavator(SIZES[3], np.random.default_rng(0))
    with pytest.raises(ValueError, match="out of the arm's reach"):
        reach(model, 15.0, 0.0, -90.0)
    with pytest.raises(ValueError, match="bucket_deg would be"):
        reach(model, 7.0, 0.0, 60.0)


def test_joints_beyond_their_limits_are_held_there() -> None:
    model = make_excavator(np.random.default_rng(3))
    beyond = {name: LIMITS[name][1] + 50.0 for name in _BOUNDED}
    at_limit = {name: LIMITS[name][1] for name in _BOUNDED}
    np.testing.assert_array_equal(model.tool_tip_m(beyond), model.tool_tip_m(at_limit))
    np.testing.assert_array_equal(_points_m(model.parts(beyond)), _points_m(model.parts(at_limit)))


def test_swinging_turns_everything_but_the_undercarriage() -> None:
    model = build_excavator(SIZES[4], np.random.default_rng(5))
    ahead, turned = model.tool_tip_m({}), model.tool_tip_m({"swing_deg": 90.0})
    np.testing.assert_allclose(turned, [-ahead[1], ahead[0], ahead[2]], atol=1e-9)
    still = [
        np.allclose(one.poses, other.poses, atol=1e-6)
        for one, other in zip(model.parts({}), model.parts({"swing_deg": 90.0}), strict=True)
    ]
    assert sum(still) == 3  # undercarriage, shoes, crawler frames


def test_a_loaded_bucket_shows_soil() -> None:
    model = make_excavator(np.random.default_rng(6))
    assert len(model.parts({"load": 0.5})) == len(model.parts({})) + 1


def test_the_same_generator_gives_the_same_machine() -> None:
    for seed in range(6):
        one, other = (make_excavator(np.random.default_rng(seed)).parts({"load": 1.0}) for _ in range(2))
        for first, second in zip(one, other, strict=True):
            assert first.mesh is second.mesh
            np.testing.assert_array_equal(first.poses, second.poses)
            np.testing.assert_array_equal(first.tint, second.tint)
            np.testing.assert_array_equal(first.dust, second.dust)


def test_machines_differ() -> None:
    rng = np.random.default_rng(7)
    drawn = [make_excavator(rng) for _ in range(60)]
    assert len({model.linkage.boom_m for model in drawn}) >= 7
    assert len({model.ram_tint for model in drawn}) > 50
