"""Excavators: dig and load a truck, dig and heap up beside, level the ground."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from standoff_sim.behaviour.stances import ExcavatorArm, Joints, TimedStance, stance_keys
from standoff_sim.movement.motion import STEP_S, Key, Place, fitted, held, with_joints
from standoff_sim.scene.scene import Model, Motion

RATES_PS = MappingProxyType({"swing_deg": 55.0, "boom_deg": 30.0, "arm_deg": 45.0, "bucket_deg": 95.0})
"""20-25 t crawlers swing at 9-11 rpm (54-66 deg/s) at most; a boom rises in 3-4 s, arm and bucket move in 2.5 s."""

_CYCLE_S = (15.0, 20.0)  # of loading trucks at 90 deg swing, as production handbooks have it
_BUCKETS_A_TRUCK = (5, 8)
OVER_BED_M = 1.3
"""Of the open bucket's edge, which dips a little as it opens."""
BED_M = -1.2
"""Middle of a truck's bed, ahead of its middle."""

Cycle = Callable[[], list[TimedStance]]


def truck_loading(
    rng: np.random.Generator, excavator: Model, truck: Model, place: Place, truck_place: Place, duration_s: float
) -> tuple[Motion, Motion]:
    """Dig ahead, swing, empty the bucket into a waiting truck, 15-20 s a cycle.

    Args:
        rng: Decides on rhythm and aim.
        excavator: With a bucket.
        truck: With joint `load` or without.
        place: Excavator; it digs within 25 degrees of straight ahead.
        truck_place: Its load bed should be within the excavator's reach, 5-9 m from its middle.
        duration_s: Of the motion.

    Returns:
        Motions of excavator and truck.
    """
    bed_m = truck_place.moved(BED_M).xy_m
    reach_m = float(np.hypot(*(bed_m - place.xy_m)))
    swing_deg = near_zero(excavator, float(np.rad2deg(place.bearing_to(bed_m))))
    arm = ExcavatorArm(excavator)
    motion, emptied_s = _cycles(
        rng, excavator, place, duration_s,
        lambda: dig(rng, arm, 0.0) + empty_over(rng, arm, swing_deg, reach_m, truck.height_m + OVER_BED_M),
    )  # fmt: skip
    return motion, _filling(rng, truck, truck_place, duration_s, emptied_s)


def digging(rng: np.random.Generator, excavator: Model, place: Place, duration_s: float) -> Motion:
    """Dig ahead and heap up to one side."""
    arm = ExcavatorArm(excavator)
    side_deg = float(rng.choice([-1.0, 1.0]) * rng.uniform(60.0, 110.0))
    reach_m = arm.ground_reach_m * rng.uniform(0.7, 0.85)
    cycle = lambda: dig(rng, arm, 0.0) + empty_over(rng, arm, side_deg, reach_m, 1.4)  # noqa: E731
    return _cycles(rng, excavator, place, duration_s, cycle)[0]


def grading(rng: np.random.Generator, excavator: Model, place: Place, duration_s: float) -> Motion:
    """Level the ground: pull the bucket in along it, lift, reach out again a little to the side."""
    arm = ExcavatorArm(excavator)
    return _cycles(rng, excavator, place, duration_s, lambda: strip(rng, arm))[0]


def strip(rng: np.random.Generator, arm: ExcavatorArm) -> list[TimedStance]:
    """Pull the bucket in along the ground and reach out again."""
    swing = {"swing_deg": rng.uniform(-35.0, 35.0)}
    far_m, near_m = arm.ground_reach_m * rng.uniform(0.85, 0.95), arm.ground_reach_m * rng.uniform(0.45, 0.55)
    middle_m = 0.5 * (far_m + near_m)
    return [
        TimedStance({**arm.at(far_m, 0.5, 0.5), **swing, "load": 0.0}, 2.2),
        TimedStance(arm.at(far_m, 0.0, 0.5), 0.8),
        TimedStance({**arm.at(middle_m, 0.0, 0.5), "load": 0.25}, 1.6),
        TimedStance(arm.at(near_m, 0.0, 0.5), 1.6),
        TimedStance(arm.at(near_m, 0.8, 0.5), 0.8),
    ]


def near_zero(model: Model, swing_deg: float) -> float:
    """Return the swing to a bearing within the joint's range."""
    low, high = model.joints["swing_deg"]
    return float(np.clip(swing_deg, low, high))


def dig(rng: np.random.Generator, arm: ExcavatorArm, ahead_deg: float) -> list[TimedStance]:
    """Fill the bucket."""
    swing_deg = ahead_deg + rng.uniform(-25.0, 25.0)
    reach_m, depth_m = arm.ground_reach_m * rng.uniform(0.8, 0.95), rng.uniform(0.1, 0.5)
    return [
        TimedStance({**arm.at(reach_m, 0.9, 0.75), "swing_deg": swing_deg, "load": 0.0}, 4.0),
        TimedStance(arm.at(reach_m * 0.98, -0.1, 0.7), 1.0),
        TimedStance({**arm.at(reach_m * 0.72, -depth_m, 0.4), "load": 0.5}, 1.9),
        TimedStance({**arm.at(reach_m * 0.55, 0.2, 0.05), "swing_deg": swing_deg, "load": 1.0}, 2.0),
        TimedStance({"boom_deg": arm.at(reach_m * 0.55, 2.0, 0.0)["boom_deg"]}, 1.4),
    ]


def empty_over(
    rng: np.random.Generator, arm: ExcavatorArm, swing_deg: float, reach_m: float, height_m: float
) -> list[TimedStance]:
    """Swing to one side and empty the bucket there."""
    swing = {"swing_deg": swing_deg + rng.normal(0.0, 3.0)}
    opened: Joints = arm.at(reach_m + rng.uniform(-0.5, 0.5), height_m + rng.uniform(0.0, 0.4), 0.9)
    return [
        TimedStance({**opened, **swing, "bucket_deg": arm.bucket_deg(0.0), "load": 1.0}, 3.4),
        TimedStance({**opened, **swing, "load": 0.0}, 1.8),
        TimedStance({**opened, **swing}, 0.3),
    ]


def _cycles(
    rng: np.random.Generator, excavator: Model, place: Place, duration_s: float, cycle: Cycle
) -> tuple[Motion, list[float]]:
    """Repeat a cycle over the duration and more, begin in its midst; return also when the bucket was empty again."""
    stances = cycle()
    cycles = int(np.ceil(duration_s / _CYCLE_S[0])) + 2
    pace = float(np.mean(_CYCLE_S)) / sum(stance.after_s for stance in stances)
    pace = min(pace, 1.2)
    for _ in range(cycles):
        stretch = pace * rng.uniform(0.93, 1.12)
        stances += [replace(stance, after_s=stance.after_s * stretch) for stance in cycle()]
    start_s = -rng.uniform(0.0, _CYCLE_S[0])
    tracks, _ = stance_keys(stances, RATES_PS, start_s)
    motion = with_joints(held(place, duration_s + STEP_S), tracks)
    return fitted(motion, excavator), emptying_s(tracks)


def emptying_s(tracks: Mapping[str, list[Key]]) -> list[float]:
    """Return when a full bucket was empty again."""
    keys = tracks["load"]
    return [now[0] for before, now in pairwise(keys) if before[1] > 0.9 and now[1] < 0.1]


def _filling(rng: np.random.Generator, truck: Model, place: Place, duration_s: float, emptied_s: list[float]) -> Motion:
    buckets = int(rng.integers(*_BUCKETS_A_TRUCK))
    load = int(rng.integers(0, buckets - 1)) / buckets
    keys: list[Key] = [(min([0.0, *emptied_s]) - 2.0, load)]
    for at_s in emptied_s:
        keys += [(at_s - 1.0, load), (at_s, min(1.0, load + 1.0 / buckets))]
        load = keys[-1][1]
    return fitted(with_joints(held(place, duration_s + STEP_S), {"load": keys}), truck)
