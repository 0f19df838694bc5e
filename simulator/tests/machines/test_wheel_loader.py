from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
import shapely
from laws import seeds

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff_sim.machines.loader_meshes import SIZES
from standoff_sim.machines.wheel_loader import (
    LIMITS,
    WheelLoader,
    build_wheel_loader,
    crank_points_m,
    lift_pivots_m,
    loader_rams,
    make_wheel_loader,
    tilt_pivot_m,
)
from standoff_sim.scene.scene import Batch


def _points_m(batches: Iterable[Batch]) -> FloatArray:
    return np.concatenate(
        [batch.mesh.vertices_m @ pose[:3, :3].T + pose[:3, 3] for batch in batches for pose in batch.poses]
    ).astype(np.float64)


def _random_joints(rng: np.random.Generator) -> dict[str, float]:
    return {name: float(rng.uniform(*LIMITS[name])) for name in ("steer_deg", "lift_deg", "bucket_deg", "load")}


@pytest.fixture(params=range(len(SIZES)))
def loader(request: pytest.FixtureRequest) -> WheelLoader:
    return build_wheel_loader(SIZES[request.param], np.random.default_rng(request.param))


def test_it_stands_on_the_ground(loader: WheelLoader) -> None:
    assert _points_m(loader.parts({}))[:, 2].min() == pytest.approx(0.0, abs=0.03)


def test_its_size_is_a_real_machines(loader: WheelLoader) -> None:
    prior = CLASS_BY_NAME["wheel_loader"]
    extent_m = np.ptp(_points_m(loader.parts({})), axis=0)
    assert 0.6 * prior.height_m < loader.height_m < 1.4 * prior.height_m
    assert 0.6 * prior.length_m < extent_m[0] < 1.4 * prior.length_m
    assert 0.6 * prior.width_m < extent_m[1] < 1.4 * prior.width_m


def test_the_footprint_encloses_the_wheels(loader: WheelLoader) -> None:
    points_m = _points_m(loader.parts({"lift_deg": 30.0}))
    low = points_m[points_m[:, 2] < 0.25]
    outline = shapely.Polygon(loader.footprint_m)
    assert outline.exterior.is_ccw
    assert len(low) > 100
    assert shapely.contains_xy(outline.buffer(0.03), low[:, :2]).all()


def test_it_has_a_budget_of_triangles(loader: WheelLoader) -> None:
    count = sum(len(batch.mesh.triangles) * len(batch.poses) for batch in loader.parts({"load": 1.0}))
    assert 3000 < count < 8000


@pytest.mark.parametrize("seed", seeds(4))
def test_the_tool_tip_is_the_front_of_the_bucket(loader: WheelLoader, seed: int) -> None:
    joints = _random_joints(np.random.default_rng(seed))
    tip = loader.tool_tip_m(joints)
    (bucket,) = (batch for batch in loader.parts(joints) if batch.mesh is loader.meshes.bucket)
    pose = bucket.poses[0].astype(np.float64)
    corners_m = bucket.mesh.vertices_m @ pose[:3, :3].T + pose[:3, 3]
    front = bucket.mesh.vertices_m[:, 0] > bucket.mesh.vertices_m[:, 0].max() - 0.002
    np.testing.assert_allclose(corners_m[front].mean(axis=0), tip, atol=0.01)


@pytest.mark.parametrize("seed", seeds(4))
def test_every_cylinder_ends_at_its_pivots_and_is_long_enough(loader: WheelLoader, seed: int) -> None:
    joints = _random_joints(np.random.default_rng(seed))
    front = np.eye(4)
    angle = np.deg2rad(joints["steer_deg"] / 2)
    front[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    batches = {id(batch.mesh): batch for batch in loader.parts(joints)}
    lift, tilt = loader_rams(loader.size)
    pairs = [(lift, lift_pivots_m(loader.size, joints)),
             (tilt, [(tilt_pivot_m(loader.size), crank_points_m(loader.size, joints)[1])])]  # fmt: skip
    for ram, ends in pairs:
        for index, pivots in enumerate(ends):
            for mesh, pivot_m in zip((ram.barrel, ram.rod), pivots, strict=True):
                expected = loader.scale * (front @ [*pivot_m, 1.0])[:3]
                np.testing.assert_allclose(batches[id(mesh)].poses[index, :3, 3], expected, atol=1e-4)
            reach_m = ram.barrel.vertices_m[:, 0].max() + ram.rod.vertices_m[:, 0].max()
            assert reach_m > np.linalg.norm(pivots[1] - pivots[0]) - 0.02


@pytest.mark.parametrize("seed", seeds(6))
def test_the_crank_keeps_its_length_and_holds_the_bucket(loader: WheelLoader, seed: int) -> None:
    pivot, top, end, ear = crank_points_m(loader.size, _random_joints(np.random.default_rng(seed)))
    assert np.linalg.norm(top - pivot) == pytest.approx(loader.size.crank_m[0])
    assert np.linalg.norm(end - pivot) == pytest.approx(loader.size.crank_m[1])
    assert np.linalg.norm(ear - end) == pytest.approx(loader.size.tie_m)


def test_the_bucket_keeps_its_attitude_while_it_is_lifted(loader: WheelLoader) -> None:
    low, high = (loader.parts({"lift_deg": lift_deg, "bucket_deg": 20.0}) for lift_deg in (-40.0, 40.0))
    poses = [next(b for b in parts if b.mesh is loader.meshes.bucket).poses[0] for parts in (low, high)]
    np.testing.assert_allclose(poses[0][:3, :3], poses[1][:3, :3], atol=1e-6)
    assert poses[1][2, 3] - poses[0][2, 3] > 2.0


def test_steering_left_turns_the_bucket_left_and_the_rear_the_other_way() -> None:
    model = build_wheel_loader(SIZES[2], np.random.default_rng(1))
    straight, turned = model.tool_tip_m({}), model.tool_tip_m({"steer_deg": 30.0})
    assert straight[1] == pytest.approx(0.0, abs=1e-9)
    assert np.rad2deg(np.arctan2(turned[1], turned[0])) == pytest.approx(15.0)
    rear = model.parts({"steer_deg": 30.0})[0].poses[0]
    assert np.rad2deg(np.arctan2(rear[1, 0], rear[0, 0])) == pytest.approx(-15.0, abs=1e-4)


def test_wheels_roll_as_far_as_the_machine_goes() -> None:
    model = build_wheel_loader(SIZES[2], np.random.default_rng(1))
    round_m = 2 * np.pi * model.scale * model.size.tyre_m / 2
    (still, quarter, whole) = (
        next(b for b in model.parts({"travel_m": gone}) if b.mesh is model.meshes.wheel).poses
        for gone in (0.0, round_m / 4, round_m)
    )
    np.testing.assert_allclose(still, whole, atol=1e-5)
    # The top of the wheel goes forwards.
    np.testing.assert_allclose(quarter[0, :3, 2] / model.scale, [1.0, 0.0, 0.0], atol=1e-5)


def test_joints_beyond_their_limits_are_held_there(loader: WheelLoader) -> None:
    np.testing.assert_array_equal(
        loader.tool_tip_m({"lift_deg": 90.0, "steer_deg": -90.0, "bucket_deg": 99.0}),
        loader.tool_tip_m({"lift_deg": 44.0, "steer_deg": -38.0, "bucket_deg": 48.0}),
    )


def test_the_same_generator_gives_the_same_machine() -> None:
    for seed in range(6):
        one, other = (make_wheel_loader(np.random.default_rng(seed)).parts({"load": 1.0}) for _ in range(2))
        for first, second in zip(one, other, strict=True):
            assert first.mesh is second.mesh
            np.testing.assert_array_equal(first.poses, second.poses)
            np.testing.assert_array_equal(first.tint, second.tint)
