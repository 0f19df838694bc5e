"""Workers and machines that come close to each other, by a stated distance."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from standoff_sim.behaviour.digging import digging
from standoff_sim.behaviour.earthmoving import driving_through, idle
from standoff_sim.behaviour.people import standing_working
from standoff_sim.movement.driving import walk
from standoff_sim.movement.motion import Place, fitted, shifted
from standoff_sim.scene.scene import Model, Motion

_SEARCH_STEP_S = 0.1
_LONGEST_LEAD_S = 40.0


def crossing_behind(
    rng: np.random.Generator, machine: Model, worker: Model, place: Place, duration_s: float, *, closest_m: float = 4.0,
    to_left: bool | None = None,
) -> tuple[Motion, Motion]:  # fmt: skip
    """Let a worker cross behind a reversing machine, just before it gets there.

    Args:
        rng: Decides on speeds, side and where.
        machine: It backs 16-22 m, its own length and more.
        worker: Walks square to the machine's way.
        place: Where the machine starts; it backs away from its heading.
        duration_s: Of the motion; the crossing is near its middle.
        closest_m: Least distance of their centres.
        to_left: Whether the worker walks to the left, as the machine looks; None draws it.

    Returns:
        Motions of machine and worker.
    """
    return _crossing(rng, machine, worker, place, duration_s, closest_m, reverse=True, to_left=to_left)


def near_miss(
    rng: np.random.Generator, machine: Model, worker: Model, place: Place, duration_s: float, *, closest_m: float = 3.0
) -> tuple[Motion, Motion]:
    """Let a worker cross in front of a machine that drives ahead; otherwise as `crossing_behind`."""
    return _crossing(rng, machine, worker, place, duration_s, closest_m, reverse=False)


def _crossing(
    rng: np.random.Generator, machine: Model, worker: Model, place: Place, duration_s: float, closest_m: float, *,
    reverse: bool, to_left: bool | None = None,
) -> tuple[Motion, Motion]:  # fmt: skip
    sign = -1.0 if reverse else 1.0
    length_m = rng.uniform(16.0, 22.0)
    driven = driving_through(rng, machine, place, place.moved(sign * length_m), duration_s, reverse=reverse)
    meeting = place.moved(sign * length_m * rng.uniform(0.45, 0.6))
    side, away_m = float(rng.choice([-1.0, 1.0])), closest_m + rng.uniform(6.0, 9.0)
    if to_left is not None:
        side = 1.0 if to_left else -1.0
    ends = [meeting.moved(rng.normal(0.0, 0.8), side * s * away_m) for s in (-1.0, 1.0)]
    walked = walk([(end.x_m, end.y_m) for end in ends], rng.uniform(1.0, 1.6))
    return driven, fitted(_delayed_to_miss(driven, walked, closest_m), worker)


def _delayed_to_miss(driven: Motion, walked: Motion, closest_m: float) -> Motion:
    """Start the walk as late as possible without coming closer than a distance; it crosses before the machine."""
    middle_m = walked.xy_m[len(walked.xy_m) // 2]
    walker_s = walked.time_s[np.argmin(np.linalg.norm(walked.xy_m - middle_m, axis=1))]
    meets_s = driven.time_s[np.argmin(np.linalg.norm(driven.xy_m - middle_m, axis=1))] - walker_s
    delay_s = brentq(
        lambda delay_s: least_distance_m(driven, shifted(walked, delay_s)) - closest_m,
        meets_s - _LONGEST_LEAD_S, meets_s, xtol=1e-4,
    )  # fmt: skip
    return shifted(walked, float(delay_s))


def least_distance_m(first: Motion, second: Motion) -> float:
    """Return how close two motions' centres ever come."""
    start_s = min(first.time_s[0], second.time_s[0])
    time_s = np.arange(start_s, max(first.time_s[-1], second.time_s[-1]) + _SEARCH_STEP_S, _SEARCH_STEP_S)
    apart = [np.interp(time_s, first.time_s, first.xy_m[:, k]) - np.interp(time_s, second.time_s, second.xy_m[:, k])
             for k in (0, 1)]  # fmt: skip
    return float(np.hypot(*apart).min())


def keep_distance(
    rng: np.random.Generator, machine: Model, worker: Model, place: Place, duration_s: float, *, distance_m: float,
    bearing_rad: float,
) -> tuple[Motion, Motion]:  # fmt: skip
    """Let both work with their centres exactly a distance apart, horizontally, at every moment.

    Args:
        rng: Decides on their work.
        machine: An excavator digs; another machine waits.
        worker: Works standing.
        place: Of the machine.
        duration_s: Of the motion.
        distance_m: Of the centres.
        bearing_rad: Direction from machine to worker, counter-clockwise from east.

    Returns:
        Motions of machine and worker.
    """
    work = digging if "boom_deg" in machine.joints else idle
    offset_m = distance_m * np.array([np.cos(bearing_rad), np.sin(bearing_rad)])
    spot_m = place.xy_m + offset_m
    worker_place = Place(float(spot_m[0]), float(spot_m[1]), rng.uniform(-np.pi, np.pi))
    return work(rng, machine, place, duration_s), standing_working(rng, worker, worker_place, duration_s)
