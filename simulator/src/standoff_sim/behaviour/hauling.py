"""An excavator and the truck that comes for its loads and takes them away."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.behaviour.digging import (
    BED_M,
    OVER_BED_M,
    RATES_PS,
    dig,
    empty_over,
    emptying_s,
    near_zero,
    strip,
)
from standoff_sim.behaviour.stances import ExcavatorArm, TimedStance, stance_keys
from standoff_sim.movement.driving import drive
from standoff_sim.movement.motion import STEP_S, Key, Place, chained, end_place, fitted, held, shifted, with_joints
from standoff_sim.scene.scene import Model, Motion

_LOADS_A_TRUCK = (4, 8)
_UNLOADS_S = (20.0, 100.0)
"""Out of sight; with the way there and back a truck is away for one or two minutes."""

_STRIP_S = 6.5
"""No strip of ground is levelled faster."""

_ROAD_M = 42.0
_TURN_M = 11.0
"""Ahead and aside, of a truck that turns by a right angle."""

_BEGUN_S = 30.0
"""The work goes on for so long already, at most."""

_SETTLES_S = 4.0
"""Between a truck's halt and the first bucket."""


def hauling(
    rng: np.random.Generator, excavator: Model, truck: Model, place: Place, spot: Place, duration_s: float
) -> tuple[Motion, Motion]:
    """Load a truck that comes and goes; level the ground while it is away.

    The truck comes along a road towards the excavator, turns, backs to its spot, and drives ahead to leave. At the
    road's end, 60 m away, it turns in the same manner.

    Args:
        rng: Decides on rhythm, loads and how long the truck is away.
        excavator: With a bucket.
        truck: With joint `load` or without.
        place: Of the excavator.
        spot: Where the truck is loaded, 7-9 m from the excavator, heading down the road on which it leaves.
        duration_s: Of the motion; it begins in the midst of the first load.

    Returns:
        Motions of excavator and truck.
    """
    arm = ExcavatorArm(excavator)
    bed_m = spot.moved(BED_M).xy_m
    reach_m = float(np.hypot(*(bed_m - place.xy_m)))
    swing_deg = near_zero(excavator, float(np.rad2deg(place.bearing_to(bed_m))))
    leaves, returns = _ways(rng, truck, spot)
    road_s = float(leaves.time_s[-1] + returns.time_s[-1])
    # The bucket has just been emptied.
    stances = empty_over(rng, arm, swing_deg, reach_m, truck.height_m + OVER_BED_M)[-1:]
    counts, planned_s = [], 0.0
    while planned_s < duration_s + _BEGUN_S:
        counts.append(int(rng.integers(*_LOADS_A_TRUCK)))
        away_s = road_s + 2.0 * _SETTLES_S + float(rng.uniform(*_UNLOADS_S))
        for _ in range(counts[-1]):
            cycle = dig(rng, arm, 0.0) + empty_over(rng, arm, swing_deg, reach_m, truck.height_m + OVER_BED_M)
            stances += _paced(rng, cycle)
        for _ in range(int(np.ceil(away_s / _STRIP_S))):
            stances += _paced(rng, strip(rng, arm))
        planned_s = sum(stance.after_s for stance in stances)
    tracks, _ = stance_keys(stances, RATES_PS, -float(rng.uniform(0.0, _BEGUN_S)))
    works = fitted(with_joints(held(place, duration_s + STEP_S), tracks), excavator)
    ends = np.cumsum(counts)
    visits = np.split(np.array(emptying_s(tracks)), ends[:-1])
    return works, fitted(_coming(spot, leaves, returns, visits, duration_s), truck)


def _paced(rng: np.random.Generator, cycle: list[TimedStance]) -> list[TimedStance]:
    stretch = float(rng.uniform(1.0, 1.2))
    return [replace(stance, after_s=stance.after_s * stretch) for stance in cycle]


def _ways(rng: np.random.Generator, truck: Model, spot: Place) -> tuple[Motion, Motion]:
    """Return the way from the spot to the road's end, turned round there, and the way back."""
    end = spot.moved(_ROAD_M)
    left = 1.0 if rng.random() < 0.5 else -1.0
    # A right angle ahead and another one backwards turn a truck round.
    aside = end.moved(_TURN_M, left * _TURN_M, left * np.pi / 2)
    turned = end.moved(2.0 * _TURN_M, 0.0, np.pi)
    leaves = chained([drive(truck, spot, end), drive(truck, end, aside), drive(truck, aside, turned, reverse=True)])
    beside = spot.moved(_TURN_M, left * _TURN_M, left * np.pi / 2)
    before = spot.moved(2.0 * _TURN_M, 0.0, np.pi)
    returns = chained([
        drive(truck, end_place(leaves), before), drive(truck, before, beside), drive(truck, beside, spot, reverse=True)
    ])  # fmt: skip
    return leaves, returns


def _coming(spot: Place, leaves: Motion, returns: Motion, visits: list[FloatArray], duration_s: float) -> Motion:
    """Be at the spot while buckets are emptied there, and on the road or unloading in between."""
    begin_s = min(float(visits[0][0]) - 2.0 * _SETTLES_S, 0.0)
    motion = held(spot, _whole(float(visits[0][-1]) + _SETTLES_S - begin_s))
    for before, after in pairwise(visits):
        away_s = float(after[0] - before[-1]) - 2.0 * _SETTLES_S
        unloads_s = away_s - float(leaves.time_s[-1] + returns.time_s[-1])
        stays_s = float(after[-1]) + _SETTLES_S - begin_s
        motion = chained([motion, leaves, held(end_place(leaves), _whole(unloads_s)), returns])
        motion = chained([motion, held(spot, _whole(stays_s - float(motion.time_s[-1])))])
    motion = shifted(motion, begin_s)
    keys: list[Key] = []
    for emptied in visits:
        levels = np.linspace(0.0, 1.0, len(emptied) + 1)
        keys += [(float(emptied[0]) - 3.0 * _SETTLES_S, 0.0)]
        for k, at_s in enumerate(emptied.tolist()):
            keys += [(at_s - 1.0, float(levels[k])), (at_s, float(levels[k + 1]))]
    return with_joints(motion, {"load": keys})


def _whole(duration_s: float) -> float:
    """Return a duration in whole steps, not negative."""
    return max(0.0, round(duration_s / STEP_S) * STEP_S)
