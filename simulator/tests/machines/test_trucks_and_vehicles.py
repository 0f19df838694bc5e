"""Dump trucks, rollers, dozers, road vehicles: size, stance, joints, colours."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import shapely

from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff_sim.machines.dozer import Dozer, make_dozer
from standoff_sim.machines.dump_truck import Hauler, Tipper, make_dump_truck
from standoff_sim.machines.roller import Roller, make_roller
from standoff_sim.machines.vehicle import Car, Truck, make_car, make_truck, make_vehicle
from standoff_sim.scene.scene import Batch

Machine = Tipper | Hauler | Roller | Dozer | Car | Truck
Maker = Callable[[np.random.Generator], Machine]
_MAKERS: tuple[Maker, ...] = (make_dump_truck, make_roller, make_dozer, make_car, make_truck)
_SEEDS = range(8)
_TRIANGLES = 9000


def _points_m(batches: tuple[Batch, ...]) -> FloatArray:
    return np.concatenate(
        [batch.mesh.vertices_m @ pose[:3, :3].T + pose[:3, 3] for batch in batches for pose in batch.poses]
    ).astype(np.float64)


def _drawn(maker: Maker, kind: type[Machine], seed: int = 0) -> Machine:
    """Return the first machine of a kind that generators from a seed on make."""
    drawn = (maker(np.random.default_rng(number)) for number in range(seed, seed + 100))
    return next(machine for machine in drawn if isinstance(machine, kind))


@pytest.fixture(params=[(maker, seed) for maker in _MAKERS for seed in _SEEDS])
def machine(request: pytest.FixtureRequest) -> Machine:
    maker, seed = request.param
    drawn: Machine = maker(np.random.default_rng(seed))
    return drawn


def test_it_stands_on_the_ground(machine: Machine) -> None:
    assert _points_m(machine.parts({}))[:, 2].min() == pytest.approx(0.0, abs=0.03)


def test_its_size_is_that_of_its_class(machine: Machine) -> None:
    prior = CLASSES[machine.class_id]
    points_m = _points_m(machine.parts({}))
    share = np.ptp(points_m, axis=0) / [prior.length_m, prior.width_m, prior.height_m]
    # A lorry is a vehicle, but the class's size is a car's.
    most = 2.3 if isinstance(machine, Truck) else 1.4
    assert (share > 0.6).all(), share
    assert (share < most).all(), share


def test_its_height_is_its_highest_point(machine: Machine) -> None:
    assert machine.height_m == pytest.approx(_points_m(machine.parts({}))[:, 2].max(), abs=1e-5)


def test_its_footprint_encloses_what_touches_the_ground(machine: Machine) -> None:
    raised = {"blade_m": 0.9} if isinstance(machine, Dozer) else {}
    points_m = _points_m(machine.parts(raised))
    low = points_m[points_m[:, 2] < 0.1]
    outline = shapely.Polygon(machine.footprint_m)
    assert outline.exterior.is_ccw
    assert len(low) > 20
    assert shapely.contains_xy(outline.buffer(0.08), low[:, :2]).all()


def test_it_has_triangles_enough_and_not_too_many(machine: Machine) -> None:
    count = sum(len(batch.mesh.triangles) * len(batch.poses) for batch in machine.parts({}))
    assert 1000 < count < _TRIANGLES


def test_no_paint_is_brighter_than_paint_gets(machine: Machine) -> None:
    for batch in machine.parts({}):
        tinted = batch.mesh.albedo[None] * (1 + batch.mesh.tintable[None, :, None] * (batch.tint[:, None] - 1))
        assert tinted.min() >= 0.0
        assert tinted.max() <= 0.85
        assert ((batch.dust >= 0.0) & (batch.dust <= 1.0)).all()


def test_every_triangle_faces_the_side_that_its_normals_say(machine: Machine) -> None:
    for batch in machine.parts({}):
        corners = batch.mesh.vertices_m[batch.mesh.triangles].astype(np.float64)
        facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        agreement = np.einsum("ij,ikj->i", facing, batch.mesh.normals[batch.mesh.triangles])
        area = np.linalg.norm(facing, axis=1)
        assert (agreement[area > 1e-7] > 0.0).mean() > 0.98


@pytest.mark.parametrize("maker", [*_MAKERS, make_vehicle])
def test_the_same_generator_state_gives_the_same_machine(maker: Maker) -> None:
    first, second = (
        maker(np.random.default_rng(7)).parts({"travel_m": 1.0} if maker is make_car else {}) for _ in "ab"
    )
    for one, other in zip(first, second, strict=True):
        assert one.mesh is other.mesh
        assert np.array_equal(one.poses, other.poses)
        assert np.array_equal(one.tint, other.tint)
        assert np.array_equal(one.dust, other.dust)


@pytest.mark.parametrize("maker", _MAKERS)
def test_machines_of_different_seeds_share_meshes(maker: Maker) -> None:
    meshes = {id(batch.mesh) for seed in range(40) for batch in maker(np.random.default_rng(seed)).parts({})}
    assert len(meshes) < 60


@pytest.mark.parametrize("kind", [Tipper, Hauler])
def test_the_bed_tips_up_and_back_down(kind: type[Machine]) -> None:
    truck = _drawn(make_dump_truck, kind)
    rest_m, tipped_m = (_points_m(truck.parts({"bed_deg": angle})) for angle in (0.0, 50.0))
    moving = ~np.isclose(rest_m, tipped_m, atol=1e-6).all(axis=1)
    assert tipped_m[:, 2].max() > rest_m[:, 2].max() + 1.5
    assert tipped_m[moving, 0].mean() < rest_m[moving, 0].mean()
    assert np.array_equal(rest_m, _points_m(truck.parts({"bed_deg": 0.0})))


@pytest.mark.parametrize("kind", [Tipper, Hauler])
def test_a_load_grows_inside_the_bed(kind: type[Machine]) -> None:
    truck = _drawn(make_dump_truck, kind)
    assert isinstance(truck, Tipper | Hauler)
    cargo = truck.bed.cargo.mesh
    tops = []
    for load in (0.1, 0.5, 1.0):
        heap = _points_m(tuple(batch for batch in truck.parts({"load": load}) if batch.mesh is cargo))
        tops.append(heap[:, 2].max())
        assert shapely.contains_xy(shapely.Polygon(truck.footprint_m).buffer(0.1), heap[:, :2]).all()
    assert tops == sorted(tops)
    assert not any(batch.mesh is cargo for batch in truck.parts({"load": 0.0}))


@pytest.mark.parametrize(("maker", "kind"), [(make_dump_truck, Hauler), (make_roller, Roller)])
def test_an_articulated_machine_bends_to_the_left_for_positive_angles(maker: Maker, kind: type[Machine]) -> None:
    machine = _drawn(maker, kind)
    straight_m, bent_m = (_points_m(machine.parts({"steer_deg": angle})) for angle in (0.0, 30.0))
    front, rear = straight_m[:, 0].argmax(), straight_m[:, 0].argmin()
    assert bent_m[front, 1] > straight_m[front, 1] + 0.3
    assert bent_m[rear, 1] > straight_m[rear, 1] + 0.3


@pytest.mark.parametrize("maker", [make_car, make_truck])
def test_front_wheels_steer_and_rear_wheels_do_not(maker: Maker) -> None:
    machine = maker(np.random.default_rng(3))
    changed = [
        pose[0, 3]
        for before, after in zip(machine.parts({}), machine.parts({"steer_deg": 20.0}), strict=True)
        for pose, other in zip(before.poses, after.poses, strict=True)
        if not np.allclose(pose, other)
    ]
    assert len(changed) in (2, 4)
    assert min(changed) > 0.0


@pytest.mark.parametrize(("maker", "joint"), [*((maker, "travel_m") for maker in _MAKERS[:2]), (make_car, "travel_m")])
def test_wheels_and_drums_roll_without_slipping(maker: Maker, joint: str) -> None:
    machine = maker(np.random.default_rng(2))
    step_m = 0.01
    rolling = [
        (before, after)
        for before, after in zip(machine.parts({}), machine.parts({joint: step_m}), strict=True)
        if not np.array_equal(before.poses, after.poses)
    ]
    assert rolling
    for before, after in rolling:
        for pose, other in zip(before.poses, after.poses, strict=True):
            assert np.allclose(pose[:3, 3], other[:3, 3])
            scale = np.linalg.norm(pose[:3, 0])
            turned = other[:3, :3] @ np.linalg.inv(pose[:3, :3])
            ground = np.array([0.0, 0.0, -pose[2, 3]])
            # The lowest point of a wheel that rolls forwards goes backwards as fast as the machine goes ahead.
            assert (turned @ ground - ground)[0] == pytest.approx(-step_m, rel=2e-2)
            assert 0.8 < scale < 1.2


@pytest.mark.parametrize("seed", _SEEDS)
def test_the_blade_edge_is_as_high_as_its_joint_says(seed: int) -> None:
    dozer = make_dozer(np.random.default_rng(seed))
    blade = dozer.blade[0].mesh
    for height_m in (-0.3, 0.0, 0.4, 0.9):
        tip = dozer.tool_tip_m({"blade_m": height_m})
        assert tip is not None
        assert tip[2] == pytest.approx(height_m, abs=1e-9)
        plate = _points_m(tuple(batch for batch in dozer.parts({"blade_m": height_m}) if batch.mesh is blade))
        assert plate[:, 2].min() == pytest.approx(height_m, abs=0.06)
        assert abs(plate[:, 0].max() - tip[0]) < 0.6


def test_trucks_and_rollers_have_no_tool() -> None:
    for maker in (make_dump_truck, make_roller, make_car, make_truck):
        assert maker(np.random.default_rng(1)).tool_tip_m({}) is None


def test_a_mixers_drum_turns_in_place() -> None:
    mixer = next(
        truck for truck in (make_truck(np.random.default_rng(seed)) for seed in range(50)) if truck.drum is not None
    )
    before, after = (mixer.parts({"drum_deg": angle})[-1].poses[0] for angle in (0.0, 60.0))
    assert np.allclose(before[:, 0], after[:, 0])
    assert np.allclose(before[:, 3], after[:, 3])
    assert not np.allclose(before[:, 1], after[:, 1])


def test_an_unknown_joint_is_refused(machine: Machine) -> None:
    with pytest.raises(ValueError, match="no such joint"):
        machine.parts({"wings_deg": 1.0})


def test_vehicles_are_of_many_kinds_and_mostly_grey() -> None:
    drawn = [make_vehicle(np.random.default_rng(seed)) for seed in range(200)]
    cars = [vehicle for vehicle in drawn if isinstance(vehicle, Car)]
    assert 140 < len(cars) < 195
    assert len({car.footprint_m.tobytes() for car in cars}) > 100
    assert len({id(car.body.mesh) for car in cars}) >= 8
    spread = np.array([np.ptp(car.body.tint) / max(car.body.tint) for car in cars])
    assert (spread < 0.25).mean() > 0.6
