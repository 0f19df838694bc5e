"""Where an entity is at a time, how it stands on the ground, and how pieces of motion are put together.

Motions are sampled every `STEP_S`; headings are radians counter-clockwise from east.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.scene.scene import GroundSurface, Model, Motion
from standoff_sim.solids.mesh import crossed, rotated_xy, rotation

STEP_S = 0.02
"""Between samples: what is linear in between is off by 0.1 mm at 2 m/s2."""

_UPRIGHT_BELOW_M = 1.2  # longest side of a footprint: people stand upright, machines lie on the slope
_COUNTERS = ("travel_m", "track_m", "stride_m")  # joints that go on from where they are when motions are joined

Key = tuple[float, float]
"""A time in seconds and a joint's value."""


@dataclass(frozen=True, slots=True)
class Place:
    """A position and a heading on the site."""

    x_m: float
    y_m: float
    heading_rad: float = 0.0

    @property
    def xy_m(self) -> FloatArray:
        """(2,) site frame."""
        return np.array([self.x_m, self.y_m])

    def moved(self, forward_m: float, left_m: float = 0.0, turn_rad: float = 0.0) -> Place:
        """Return the place at an offset in this place's own directions, turned by an angle.

        >>> Place(1.0, 2.0, np.pi / 2).moved(3.0).y_m
        5.0
        """
        cosine, sine = np.cos(self.heading_rad), np.sin(self.heading_rad)
        return Place(
            float(self.x_m + forward_m * cosine - left_m * sine),
            float(self.y_m + forward_m * sine + left_m * cosine),
            float(self.heading_rad + turn_rad),
        )

    def bearing_to(self, xy_m: FloatArray) -> float:
        """Return the direction to a point, relative to the heading, -pi .. pi."""
        return wrapped(float(np.arctan2(xy_m[1] - self.y_m, xy_m[0] - self.x_m)) - self.heading_rad)


@dataclass(frozen=True, slots=True, eq=False)
class MotionState:
    """One moment of a motion.

    Attributes:
        xy_m: (2,) site frame.
        heading_rad: Of local x, counter-clockwise from east.
        velocity_mps: (2,) site frame.
        joints: Values by name.
    """

    xy_m: FloatArray
    heading_rad: float
    velocity_mps: FloatArray
    joints: Mapping[str, float]

    def to_site(self, points_m: FloatArray) -> FloatArray:
        """Return (..., 2) points of the local frame in the site frame."""
        return rotated_xy(points_m, self.heading_rad) + self.xy_m


def wrapped(angle_rad: float) -> float:
    """Return the same direction within -pi .. pi.

    >>> round(wrapped(3 * np.pi / 2), 6) == round(-np.pi / 2, 6)
    True
    """
    return float((angle_rad + np.pi) % (2 * np.pi) - np.pi)


def sample(motion: Motion, time_s: float) -> MotionState:
    """Read a motion at a moment; the velocity is the mean over one step before and one after."""
    xy_m, share, index = _at(motion, time_s)
    after = min(index + 1, len(motion.time_s) - 1)
    ahead_m, behind_m = _at(motion, time_s + STEP_S)[0], _at(motion, time_s - STEP_S)[0]
    return MotionState(
        xy_m,
        float((1.0 - share) * motion.heading_rad[index] + share * motion.heading_rad[after]),
        (ahead_m - behind_m) / (2 * STEP_S),
        {
            name: float((1.0 - share) * values[index] + share * values[after])
            for name, values in motion.joints.items()
        },
    )  # fmt: skip


def _at(motion: Motion, time_s: float) -> tuple[FloatArray, float, int]:
    """Return the position, and between which samples and how far along it is."""
    last = len(motion.time_s) - 1
    index = int(np.clip(np.searchsorted(motion.time_s, time_s, side="right") - 1, 0, max(last - 1, 0)))
    after = min(index + 1, last)
    span_s = motion.time_s[after] - motion.time_s[index]
    share = float(np.clip((time_s - motion.time_s[index]) / span_s, 0.0, 1.0)) if span_s > 0 else 0.0
    xy_m: FloatArray = motion.xy_m[index] + share * (motion.xy_m[after] - motion.xy_m[index])
    return xy_m, share, index


def place_on_ground(placement: MotionState, footprint_m: FloatArray, ground: GroundSurface) -> FloatArray:
    """Stand an entity on the ground.

    A machine lies on the plane fitted to the heights under its footprint's corners; people stand upright.

    Args:
        placement: Where it is.
        footprint_m: (K, 2) outline, local frame.
        ground: The relief.

    Returns:
        (4, 4) local to site; its origin is exactly at the placement's x and y.
    """
    yaw = rotation("z", float(np.rad2deg(placement.heading_rad)))[:3, :3]
    pose = np.eye(4)
    pose[:2, 3] = placement.xy_m
    if np.ptp(footprint_m, axis=0).max() < _UPRIGHT_BELOW_M:
        pose[:3, :3] = yaw
        pose[2, 3] = ground.height_at(placement.xy_m[None])[0]
        return pose
    heights_m = ground.height_at(placement.to_site(footprint_m))
    plane = np.column_stack([np.ones(len(footprint_m)), footprint_m])
    pose[2, 3], ahead, left = np.linalg.lstsq(plane, heights_m, rcond=None)[0]
    forward = np.array([1.0, 0.0, ahead]) / np.hypot(1.0, ahead)
    normal = np.array([-ahead, -left, 1.0])
    normal /= np.linalg.norm(normal)
    pose[:3, :3] = yaw @ np.column_stack([forward, crossed(normal, forward), normal])
    return pose


def held(place: Place, duration_s: float = 0.0) -> Motion:
    """Stay in a place."""
    count = max(1, round(duration_s / STEP_S) + 1)
    time_s = STEP_S * np.arange(count, dtype=np.float64)
    return Motion(time_s, np.tile(place.xy_m, (count, 1)), np.full(count, place.heading_rad))


def turned(place: Place, heading_rad: float, rate_dps: float) -> Motion:
    """Turn on the spot to a heading, the shorter way, no faster than a rate."""
    turn_rad = wrapped(heading_rad - place.heading_rad)
    duration_s = max(STEP_S, shortest_s(float(np.rad2deg(abs(turn_rad))), rate_dps))
    motion = held(place, np.ceil(duration_s / STEP_S) * STEP_S)
    keys = [(0.0, place.heading_rad), (float(motion.time_s[-1]), place.heading_rad + turn_rad)]
    return replace(motion, heading_rad=eased(motion.time_s, keys))


def end_place(motion: Motion) -> Place:
    """Return where a motion ends."""
    return Place(float(motion.xy_m[-1, 0]), float(motion.xy_m[-1, 1]), float(motion.heading_rad[-1]))


def shifted(motion: Motion, delay_s: float) -> Motion:
    """Return the motion begun later, or earlier if negative."""
    return replace(motion, time_s=motion.time_s + delay_s)


def chained(pieces: Sequence[Motion]) -> Motion:
    """Join motions that end where the next begins.

    Travelled distances add up; joints that a piece does not name stay as they are.

    Raises:
        ValueError: A piece begins elsewhere than the one before it ends.
    """
    whole = pieces[0]
    for piece in pieces[1:]:
        if np.abs(piece.xy_m[0] - whole.xy_m[-1]).max() > 1e-6:
            raise ValueError(f"a motion begins at {piece.xy_m[0]} but the one before ends at {whole.xy_m[-1]}")
        whole = _joined(whole, piece)
    return whole


def _joined(first: Motion, second: Motion) -> Motion:
    delay_s = first.time_s[-1] - second.time_s[0]
    jump_rad = first.heading_rad[-1] - second.heading_rad[0]
    turns_rad = 2 * np.pi * np.round(jump_rad / (2 * np.pi))
    joints = {}
    for name in {**first.joints, **second.joints}:
        before = first.joints.get(name)
        after = second.joints.get(name)
        if before is None:
            before = np.full(len(first.time_s), 0.0 if name in _COUNTERS or after is None else after[0])
        after = np.full(len(second.time_s), 0.0 if name in _COUNTERS else before[-1]) if after is None else after
        start = before[-1] - after[0] if name in _COUNTERS else 0.0
        joints[name] = np.concatenate([before, after[1:] + start])
    return Motion(
        np.concatenate([first.time_s, second.time_s[1:] + delay_s]),
        np.concatenate([first.xy_m, second.xy_m[1:]]),
        np.concatenate([first.heading_rad, second.heading_rad[1:] + turns_rad]),
        joints,
    )


def shortest_s(change: float, rate_ps: float) -> float:
    """Return how long `eased` must take for a change so that its fastest moment is at a rate.

    The peak of a minimum-jerk movement is 15/8 of its mean (Flash and Hogan, 1985, Eq. 3).

    >>> shortest_s(8.0, 15.0)
    1.0
    """
    return 1.875 * abs(change) / rate_ps


def eased(time_s: FloatArray, keys: Sequence[Key]) -> FloatArray:
    """Move from key to key with minimum jerk, at rest at each; held before the first and after the last.

    >>> eased(np.array([-1.0, 0.5, 9.0]), [(0.0, 2.0), (1.0, 4.0)]).tolist()
    [2.0, 3.0, 4.0]
    """
    at_s, value = np.array(keys, dtype=np.float64).T
    index = np.clip(np.searchsorted(at_s, time_s, side="right") - 1, 0, len(at_s) - 1)
    after = np.minimum(index + 1, len(at_s) - 1)
    span_s = at_s[after] - at_s[index]
    share = np.clip((time_s - at_s[index]) / np.where(span_s > 0, span_s, 1.0), 0.0, 1.0)
    smooth = share**3 * (10.0 - share * (15.0 - 6.0 * share))
    values: FloatArray = value[index] + (value[after] - value[index]) * smooth
    return values


def with_joints(motion: Motion, tracks: Mapping[str, Sequence[Key]]) -> Motion:
    """Return the motion with joints moved from key to key; times are the motion's own."""
    return replace(motion, joints={**motion.joints, **{name: eased(motion.time_s, k) for name, k in tracks.items()}})


def fitted(motion: Motion, model: Model) -> Motion:
    """Keep to a model's joints and their ranges; a joint that is not named stays at the model's own rest."""
    joints = {
        name: np.clip(values, *model.joints[name]) for name, values in motion.joints.items() if name in model.joints
    }
    return replace(motion, joints=joints)
