"""Workers: walk past, work standing, talk in pairs, carry things."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.movement.driving import walk
from standoff_sim.movement.motion import (
    STEP_S,
    Key,
    Place,
    chained,
    eased,
    end_place,
    fitted,
    held,
    shifted,
    turned,
    with_joints,
)
from standoff_sim.scene.scene import Model, Motion

WALKING_MPS = (0.8, 1.5)
"""Free walking is 1.2-1.5 m/s, slower over rough ground and with loads."""

TURN_DPS = 150.0
"""How fast people turn on the spot."""

_STOOPED_DEG = (45.0, 85.0)
_STROLL_MPS = 0.5
"""Whoever walks this fast looks where they go."""


def walking_past(
    rng: np.random.Generator, worker: Model, points_m: Sequence[tuple[float, float]] | FloatArray, duration_s: float
) -> Motion:
    """Walk along points, under way for as much of the duration as the way allows."""
    motion = walk(points_m, rng.uniform(*WALKING_MPS))
    slack_s = duration_s - float(motion.time_s[-1])
    motion = with_joints(motion, {"arms": [(0.0, float(rng.random() < 0.2))]})
    return fitted(shifted(motion, rng.uniform(min(slack_s, 0.0), max(slack_s, 0.0))), worker)


def standing_working(rng: np.random.Generator, worker: Model, place: Place, duration_s: float) -> Motion:
    """Work in one place: bend, crouch, use the hands, look up; turn a little between tasks."""
    tracks: dict[str, list[Key]] = {"arms": [], "bend_deg": [], "crouch": [], "turn_deg": []}
    heading: list[Key] = []
    now_s, heading_rad = -rng.uniform(1.0, 4.0), place.heading_rad
    while now_s < duration_s + 2.0:
        crouches = float(rng.random() < 0.25)
        works = crouches or float(rng.random() < 0.8)
        posture = {
            "arms": works * rng.uniform(0.5, 1.0),
            "bend_deg": works * rng.uniform(5.0, 35.0 if crouches else 75.0),
            "crouch": crouches * rng.uniform(0.6, 1.0),
            "turn_deg": rng.normal(0.0, 12.0),
        }
        stays_s = rng.uniform(1.5, 5.0)
        for name, value in posture.items():
            tracks[name] += [(now_s, value), (now_s + stays_s, value)]
        heading += [(now_s, heading_rad), (now_s + stays_s, heading_rad)]
        heading_rad += rng.normal(0.0, 0.35)
        now_s += stays_s + rng.uniform(0.9, 1.6)
    return fitted(_in_place(place, duration_s, tracks | _acting(rng, duration_s), heading), worker)


def _acting(rng: np.random.Generator, duration_s: float) -> dict[str, list[Key]]:
    """Move the hands to and fro, once in 1.2-2.4 s."""
    half_s = rng.uniform(1.2, 2.4, int(duration_s / 1.2) + 3)
    at_s = np.cumsum(half_s) - half_s[0] * rng.uniform(1.0, 2.0)
    return {"act": [(float(t), float(k % 2)) for k, t in enumerate(at_s)]}


def pair_talking(
    rng: np.random.Generator, workers: tuple[Model, Model], place: Place, duration_s: float
) -> tuple[Motion, Motion]:
    """Stand 0.8-1.4 m apart, face each other, gesture now and then.

    Args:
        rng: Decides.
        workers: Two of them.
        place: Half-way between; the heading is from the first to the second.
        duration_s: Of the motion.
    """
    half_m = rng.uniform(0.4, 0.7)
    first = place.moved(-half_m, 0.0, rng.normal(0.0, 0.25))
    second = place.moved(half_m, 0.0, np.pi + rng.normal(0.0, 0.25))
    return _talking(rng, workers[0], first, duration_s), _talking(rng, workers[1], second, duration_s)


def _talking(rng: np.random.Generator, worker: Model, place: Place, duration_s: float) -> Motion:
    tracks: dict[str, list[Key]] = {"arms": [(-1.0, 0.0)], "turn_deg": [(-1.0, 0.0)], "bend_deg": [(-1.0, 3.0)]}
    now_s = -rng.uniform(0.0, 3.0)
    while now_s < duration_s:
        now_s = max(now_s, tracks["arms"][-1][0]) + rng.uniform(1.0, 3.0)
        stays_s = rng.uniform(0.6, 2.0)
        for name, value in (("arms", rng.uniform(0.2, 0.7)), ("turn_deg", rng.normal(0.0, 15.0))):
            resting = tracks[name][-1][1]
            tracks[name] += [(now_s, resting), (now_s + 0.8, value), (now_s + 0.8 + stays_s, value)]
            tracks[name] += [(now_s + 1.7 + stays_s, 0.0)]
    return fitted(_in_place(place, duration_s, tracks, []), worker)


def carrying_between(
    rng: np.random.Generator, worker: Model, pick_up: Place, put_down: Place, duration_s: float
) -> Motion:
    """Carry things from one place to another and walk back for the next; bend at both ends."""
    speed_mps = rng.uniform(0.8, 1.2)
    start = pick_up.moved(0.0, 0.0, pick_up.bearing_to(put_down.xy_m))
    motion = _handling(rng, held(start), 1.0)
    begin_s = rng.uniform(0.0, 4.0)
    goals, carried = [put_down, pick_up], [1.0, 0.0]
    leg = 0
    while motion.time_s[-1] < begin_s + duration_s:
        motion = _next_leg(rng, motion, goals[leg % 2], carried[leg % 2], speed_mps)
        leg += 1
    return fitted(shifted(motion, -begin_s), worker)


def _next_leg(rng: np.random.Generator, motion: Motion, goal: Place, carried: float, speed_mps: float) -> Motion:
    """Turn to a goal, walk there, and pick up or put down."""
    here = end_place(motion)
    way_rad = here.heading_rad + here.bearing_to(goal.xy_m)
    turn = turned(here, way_rad, TURN_DPS)
    there = walk([tuple(here.xy_m), tuple(goal.xy_m)], speed_mps * (0.85 if carried else 1.1))
    there = with_joints(there, {"arms": [(0.0, carried)]})
    return chained([motion, turn, there, _handling(rng, held(end_place(there)), 1.0 - carried)])


def _handling(rng: np.random.Generator, standing: Motion, carried_after: float) -> Motion:
    """Bend down and come up again with full or empty hands."""
    stays_s, bend_deg = rng.uniform(0.5, 1.5), rng.uniform(50.0, 85.0)
    down_s, up_s = 1.3, 1.3 + stays_s
    whole_s = up_s + 1.4
    motion = held(end_place(standing), whole_s)
    keys = {
        "bend_deg": [(0.0, 0.0), (down_s, bend_deg), (up_s, bend_deg), (whole_s, 0.0)],
        "arms": [(0.0, 1.0 - carried_after), (down_s, 0.8), (up_s, 0.8), (whole_s, carried_after)],
        "speed_mps": [(0.0, 0.0)],
    }
    return with_joints(motion, keys)


def stooping(rng: np.random.Generator, motion: Motion) -> Motion:
    """Let a worker do what they do bent over for much of the time, as in laying bricks, tying steel or shovelling.

    They come up for a moment now and then, and lean forward less on the way to somewhere. Where they are and when
    stays as it is.

    Args:
        rng: Decides when and how low.
        motion: Of a worker who works upright.
    """
    bend: list[Key] = []
    now_s, end_s = -rng.uniform(0.0, 8.0), float(motion.time_s[-1])
    while now_s < end_s:
        low_deg, stays_s = float(rng.uniform(*_STOOPED_DEG)), float(rng.uniform(6.0, 20.0))
        bend += [(now_s, low_deg), (now_s + stays_s, low_deg)]
        upright_s = now_s + stays_s + 1.2
        now_s = upright_s + rng.uniform(0.5, 3.0)
        bend += [(upright_s, 5.0), (now_s, 5.0)]
        now_s += 1.2
    still = np.zeros(len(motion.time_s))
    speed_mps = motion.joints.get("speed_mps", still)
    bent_deg = eased(motion.time_s, bend) * (1.0 - 0.7 * np.clip(speed_mps / _STROLL_MPS, 0.0, 1.0))
    bent_deg = np.maximum(bent_deg, motion.joints.get("bend_deg", still))
    return replace(motion, joints={**motion.joints, "bend_deg": bent_deg})


def _in_place(place: Place, duration_s: float, tracks: dict[str, list[Key]], heading: list[Key]) -> Motion:
    motion = with_joints(held(place, duration_s + STEP_S), {**tracks, "speed_mps": [(0.0, 0.0)]})
    if not heading:
        return motion
    return replace(motion, heading_rad=eased(motion.time_s, heading))
