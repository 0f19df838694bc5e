from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from laws import seeds
from moving_models import MovingModel

from standoff_sim import behaviour
from standoff_sim.behaviour.digging import RATES_PS
from standoff_sim.behaviour.encounters import least_distance_m
from standoff_sim.behaviour.stances import ExcavatorArm
from standoff_sim.movement.driving import MOBILITY
from standoff_sim.movement.motion import STEP_S, Place, sample
from standoff_sim.scene.scene import Motion

EXCAVATOR, LOADER, TRUCK = MovingModel("excavator"), MovingModel("wheel_loader"), MovingModel("dump_truck")
ROLLER, DOZER, CAR, WORKER = (MovingModel(kind) for kind in ("roller", "dozer", "vehicle", "worker"))
ORIGIN = Place(0.0, 0.0, 0.4)
DURATION_S = 30.0

Script = Callable[[np.random.Generator], Motion | tuple[Motion, ...]]
SCRIPTS: dict[str, tuple[tuple[MovingModel, ...], Script]] = {
    "truck_loading": (
        (EXCAVATOR, TRUCK),
        lambda rng: behaviour.truck_loading(rng, EXCAVATOR, TRUCK, ORIGIN, ORIGIN.moved(1.0, 7.5), DURATION_S),
    ),
    "digging": ((EXCAVATOR,), lambda rng: behaviour.digging(rng, EXCAVATOR, ORIGIN, DURATION_S)),
    "grading": ((EXCAVATOR,), lambda rng: behaviour.grading(rng, EXCAVATOR, ORIGIN, DURATION_S)),
    "loader_loading": (
        (LOADER, TRUCK),
        lambda rng: behaviour.loader_loading(rng, LOADER, TRUCK, ORIGIN, ORIGIN.moved(-6.0, 10.0), 2 * DURATION_S),
    ),
    "hauling": (
        (EXCAVATOR, TRUCK),
        lambda rng: behaviour.hauling(rng, EXCAVATOR, TRUCK, ORIGIN, ORIGIN.moved(1.0, 7.8, 0.1), 8 * DURATION_S),
    ),
    "heaping": (
        (LOADER,), lambda rng: behaviour.heaping(rng, LOADER, ORIGIN, ORIGIN.moved(-11.0, 11.0, -1.6), 2 * DURATION_S)
    ),
    "errand": (
        (WORKER,),
        lambda rng: behaviour.errand(rng, WORKER, ORIGIN, np.array([[0.0, 0.0], [6.0, 2.0], [9.0, 9.0]]), DURATION_S),
    ),
    "spreading": ((LOADER,), lambda rng: behaviour.spreading(rng, LOADER, ORIGIN, 14.0, DURATION_S)),
    "tipping": ((TRUCK,), lambda rng: behaviour.spreading(rng, TRUCK, ORIGIN, 14.0, DURATION_S)),
    "dozing": ((DOZER,), lambda rng: behaviour.dozing(rng, DOZER, ORIGIN, 18.0, DURATION_S)),
    "rolling": ((ROLLER,), lambda rng: behaviour.rolling(rng, ROLLER, ORIGIN, 20.0, DURATION_S)),
    "driving_through": (
        (CAR,), lambda rng: behaviour.driving_through(rng, CAR, ORIGIN, ORIGIN.moved(30.0, 12.0, 0.6), DURATION_S)
    ),
    "idle": ((EXCAVATOR,), lambda rng: behaviour.idle(rng, EXCAVATOR, ORIGIN, DURATION_S)),
    "walking_past": (
        (WORKER,), lambda rng: behaviour.walking_past(rng, WORKER, [(0.0, 0.0), (9.0, 4.0), (16.0, 1.0)], DURATION_S)
    ),
    "standing_working": ((WORKER,), lambda rng: behaviour.standing_working(rng, WORKER, ORIGIN, DURATION_S)),
    "pair_talking": ((WORKER, WORKER), lambda rng: behaviour.pair_talking(rng, (WORKER, WORKER), ORIGIN, DURATION_S)),
    "carrying_between": (
        (WORKER,), lambda rng: behaviour.carrying_between(rng, WORKER, ORIGIN, Place(7.0, 2.0), DURATION_S)
    ),
    "crossing_behind": (
        (TRUCK, WORKER), lambda rng: behaviour.crossing_behind(rng, TRUCK, WORKER, ORIGIN, DURATION_S)
    ),
    "near_miss": ((LOADER, WORKER), lambda rng: behaviour.near_miss(rng, LOADER, WORKER, ORIGIN, DURATION_S)),
}  # fmt: skip
RATES_OF_ALL = {**RATES_PS, "bucket_deg": 95.0, "lift_deg": 36.0, "bed_deg": 9.0, "blade_m": 0.5, "steer_deg": 25.5}


def _motions(name: str, seed: int) -> list[tuple[MovingModel, Motion]]:
    models, script = SCRIPTS[name]
    made = script(np.random.default_rng(seed))
    return list(zip(models, made if isinstance(made, tuple) else (made,), strict=True))


@pytest.mark.parametrize("name", SCRIPTS)
@pytest.mark.parametrize("seed", seeds(3))
def test_speeds_and_accelerations_are_those_of_the_machine(name: str, seed: int) -> None:
    for model, motion in _motions(name, seed):
        limits = MOBILITY[model.kind]
        velocity = np.gradient(motion.xy_m, STEP_S, axis=0)
        acceleration = np.linalg.norm(np.gradient(velocity, STEP_S, axis=0), axis=1)
        top_mps = 1.6 if model.kind == "worker" else limits.speed_mps
        assert np.linalg.norm(velocity, axis=1).max() <= top_mps
        assert acceleration.max() <= np.hypot(limits.acceleration_mps2, limits.lateral_mps2)


@pytest.mark.parametrize("name", SCRIPTS)
@pytest.mark.parametrize("seed", seeds(3))
def test_joints_keep_to_their_ranges_and_move_no_faster_than_hydraulics_do(name: str, seed: int) -> None:
    for model, motion in _motions(name, seed):
        for joint, values in motion.joints.items():
            low, high = model.joints[joint]
            assert low <= values.min(), joint
            assert values.max() <= high, joint
            if joint in RATES_OF_ALL:
                assert np.abs(np.diff(values)).max() / STEP_S <= RATES_OF_ALL[joint] * 1.001, joint


@pytest.mark.parametrize("name", SCRIPTS)
def test_the_same_generator_gives_the_same_motion(name: str) -> None:
    for (_, first), (_, second) in zip(_motions(name, 5), _motions(name, 5), strict=True):
        np.testing.assert_array_equal(first.xy_m, second.xy_m)
        np.testing.assert_array_equal(first.time_s, second.time_s)
        for joint, values in first.joints.items():
            np.testing.assert_array_equal(values, second.joints[joint])
    differs = [
        sample(first, 15.0).joints != sample(second, 15.0).joints
        or not np.array_equal(sample(first, 15.0).xy_m, sample(second, 15.0).xy_m)
        for (_, first), (_, second) in zip(_motions(name, 5), _motions(name, 6), strict=True)
    ]
    assert any(differs)


@pytest.mark.parametrize("name", sorted(set(SCRIPTS) - {"driving_through", "walking_past"}))
def test_work_goes_on_for_the_whole_clip(name: str) -> None:
    for model, motion in _motions(name, 1):
        assert motion.time_s[0] <= 0.0 or name in ("crossing_behind", "near_miss")
        assert (
            motion.time_s[-1] >= (DURATION_S / 2 if model is WORKER else DURATION_S)
            or "near" in name
            or "cross" in name
        )


@pytest.mark.parametrize("seed", seeds(5))
def test_an_excavator_loads_a_truck_every_15_to_20_seconds(seed: int) -> None:
    excavator, truck = behaviour.truck_loading(
        np.random.default_rng(seed), EXCAVATOR, TRUCK, ORIGIN, ORIGIN.moved(1.0, 7.5), 90.0
    )
    load = excavator.joints["load"]
    emptied_s = excavator.time_s[1:][(load[:-1] > 0.5) & (load[1:] <= 0.5)]
    assert len(emptied_s) >= 4
    assert 14.0 <= np.diff(emptied_s).min() <= np.diff(emptied_s).max() <= 21.0
    assert (np.diff(truck.joints["load"]) >= 0).all()
    bed_m = ORIGIN.moved(1.0 - 1.2, 7.5).xy_m
    for time_s in emptied_s:
        placement = sample(excavator, float(time_s))
        tip_m = EXCAVATOR.tool_tip_m(placement.joints)
        assert tip_m is not None
        turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
        assert np.linalg.norm(turn @ tip_m[:2] - bed_m) < 2.0
        assert tip_m[2] > TRUCK.height_m


def test_a_loader_empties_over_the_truck_and_carries_low() -> None:
    loader, truck = behaviour.loader_loading(
        np.random.default_rng(2), LOADER, TRUCK, ORIGIN, ORIGIN.moved(-6.0, 10.0), 90.0
    )
    load, lift = loader.joints["load"], loader.joints["lift_deg"]
    emptied = np.flatnonzero((load[:-1] > 0.5) & (load[1:] <= 0.5))
    assert len(emptied) >= 2
    assert lift[emptied].min() > 35.0
    at_pile = np.linalg.norm(loader.xy_m - ORIGIN.xy_m, axis=1) < 3.0
    assert lift[at_pile].max() < -20.0
    assert truck.joints["load"][-1] > truck.joints["load"][0]


def test_an_excavators_bucket_gets_where_it_shall() -> None:
    arm = ExcavatorArm(EXCAVATOR)
    for reach_m, height_m, openness in [(7.0, 0.0, 0.7), (6.5, 3.5, 0.8), (5.0, -0.5, 0.3), (8.0, 1.0, 0.5)]:
        tip_m = EXCAVATOR.tool_tip_m(arm.at(reach_m, height_m, openness))
        assert tip_m is not None
        assert np.hypot(tip_m[0] - reach_m, tip_m[2] - height_m) < 0.15


@pytest.mark.parametrize("distance_m", [15.0, 20.0])
@pytest.mark.parametrize("seed", seeds(4))
def test_centres_stay_exactly_the_stated_distance_apart(distance_m: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    machine, worker = behaviour.keep_distance(
        rng, EXCAVATOR, WORKER, Place(3.0, -7.0, 0.9), 5.0, distance_m=distance_m, bearing_rad=rng.uniform(-3, 3)
    )
    for time_s in np.linspace(0.0, 6.0, 101).tolist():
        apart_m = np.linalg.norm(sample(machine, time_s).xy_m - sample(worker, time_s).xy_m)
        assert abs(apart_m - distance_m) < 1e-9
    assert np.ptp(machine.joints["swing_deg"]) + np.ptp(machine.joints["boom_deg"]) > 5.0


@pytest.mark.parametrize("meet", [behaviour.crossing_behind, behaviour.near_miss])
@pytest.mark.parametrize("seed", seeds(6))
@pytest.mark.parametrize("closest_m", [2.5, 5.0])
def test_an_encounter_comes_as_close_as_stated_and_no_closer(
    meet: Callable[..., tuple[Motion, Motion]], seed: int, closest_m: float
) -> None:
    driven, walked = meet(np.random.default_rng(seed), TRUCK, WORKER, ORIGIN, 13.0, closest_m=closest_m)
    assert least_distance_m(driven, walked) == pytest.approx(closest_m, abs=0.01)
    time_s = np.arange(0.0, 13.0, 0.1)
    apart_m = [np.linalg.norm(sample(driven, t).xy_m - sample(walked, t).xy_m) for t in time_s.tolist()]
    assert min(apart_m) == pytest.approx(closest_m, abs=0.05)


@pytest.mark.parametrize("kind", ["worker", "excavator", "wheel_loader", "dump_truck", "roller", "dozer", "vehicle"])
def test_a_random_stance_is_within_the_joints_ranges(kind: str) -> None:
    model = MovingModel(kind)
    for seed in range(20):
        stance = behaviour.random_stance(np.random.default_rng(seed), model)
        assert set(stance) == set(model.joints)
        assert all(low <= stance[name] <= high for name, (low, high) in model.joints.items())
