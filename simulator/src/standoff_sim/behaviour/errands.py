"""Workers who go somewhere, do something there, and go on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.behaviour.people import TURN_DPS, WALKING_MPS, standing_working
from standoff_sim.movement.driving import walk
from standoff_sim.movement.motion import STEP_S, Place, chained, eased, end_place, held, shifted, turned, with_joints
from standoff_sim.scene.scene import Model, Motion

_BENDS_S = 1.2


def errand(rng: np.random.Generator, worker: Model, here: Place, way_m: FloatArray, stays_s: float) -> Motion:
    """Turn, walk a way, and work at its end.

    Args:
        rng: Decides on pace and posture.
        worker: Who.
        here: Where the way begins.
        way_m: (K, 2) points of it, the first at `here`.
        stays_s: For how long the work lasts.

    Returns:
        The motion from time 0.
    """
    heading = way_m[1] - way_m[0]
    turn = turned(here, here.heading_rad + here.bearing_to(here.xy_m + heading), TURN_DPS)
    walks = with_joints(walk(way_m, float(rng.uniform(*WALKING_MPS))), {"arms": [(0.0, 0.0)], "bend_deg": [(0.0, 3.0)]})
    return chained([turn, walks, staying(rng, worker, end_place(walks), stays_s)])


def staying(rng: np.random.Generator, worker: Model, place: Place, stays_s: float) -> Motion:
    """Work in one place for a whole number of steps from time 0, upright at the beginning and at the end."""
    works = standing_working(rng, worker, place, max(STEP_S, round(stays_s / STEP_S) * STEP_S))
    end_s = float(works.time_s[-1])
    begun = eased(works.time_s, [(0.0, 0.0), (min(_BENDS_S, end_s), 1.0)])
    busy = begun * eased(works.time_s, [(max(end_s - _BENDS_S, 0.0), 1.0), (end_s, 0.0)])
    heading_rad = place.heading_rad + begun * (works.heading_rad - place.heading_rad)
    return replace(works, heading_rad=heading_rad, joints={name: busy * joint for name, joint in works.joints.items()})


def riding(machine: Motion, ahead_m: float, left_m: float) -> Motion:
    """Stay on a machine: where its driver is, and as long as the machine's own motion.

    Args:
        machine: Its motion.
        ahead_m: Of the seat, from the machine's middle.
        left_m: Likewise.
    """
    cosine, sine = np.cos(machine.heading_rad), np.sin(machine.heading_rad)
    seat_m = np.column_stack([ahead_m * cosine - left_m * sine, ahead_m * sine + left_m * cosine])
    still = np.zeros(len(machine.time_s))
    return replace(machine, xy_m=machine.xy_m + seat_m, joints={"speed_mps": still, "bend_deg": still + 5.0})


def driving_off(rng: np.random.Generator, drives: Motion, walks: Motion, ahead_m: float, left_m: float) -> Motion:
    """Get on a machine that stands, and go with it.

    Args:
        rng: Decides on pace.
        drives: The machine's motion, from when it moves off.
        walks: Of the driver, from time 0 to beside the seat.
        ahead_m: Of the seat, from the machine's middle.
        left_m: Likewise.

    Returns:
        The motion, which ends with the machine's; the driver is in the seat when it moves off.
    """
    rides = riding(drives, ahead_m, left_m)
    door = end_place(walks)
    gets_on = walk(np.array([door.xy_m, rides.xy_m[0]]), float(rng.uniform(0.6, 0.9)))
    waits_s = float(drives.time_s[0]) - float(walks.time_s[-1] + gets_on.time_s[-1])
    if waits_s < 0.0:
        raise ValueError(f"the driver is {-waits_s:.1f} s late")
    seat = replace(end_place(gets_on), heading_rad=float(rides.heading_rad[0]))
    sits = held(seat, round(waits_s / STEP_S) * STEP_S)
    return chained([walks, gets_on, sits, shifted(rides, -float(rides.time_s[0]))])
