"""How feet and arms move in a walk.

The foot is a convex sole that rolls over the ground from heel to toe, so a standing foot does not slide: its place
follows from the distance walked, never from a clock. Toe off at 62 % of the cycle is Perry's, "Gait Analysis" (1992);
the pitches of the foot in between are set by eye.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from standoff.core.homography import FloatArray

TOE_OFF = 0.62
_PITCH = PchipInterpolator(
    [0.0, 0.08, 0.40, 0.52, TOE_OFF, 0.70, 0.86, 0.94, 1.0], [20.0, 0.0, 0.0, -14.0, -42.0, -46.0, -2.0, 20.0, 20.0]
)
_CLEARANCE_M = 0.03
_FULL_STEP_MPS = 0.5
_WALK_RATIO_M_PER_HZ = 0.39
_WALK_RATIO_STATURE_M = 1.70


def step_length_m(speed_mps: float, stature_m: float) -> float:
    """Return how long a person's steps are at a speed.

    Step length over cadence is nearly constant, 0.0065 m per step a minute in adult men (Sekiya and Nagasaki, "Gait &
    Posture" 7, 1998), and grows with stature; so the length grows with the root of the speed.

    >>> round(step_length_m(1.4, 1.75), 2), round(step_length_m(0.7, 1.75), 2)
    (0.76, 0.54)
    """
    return float(np.sqrt(_WALK_RATIO_M_PER_HZ * speed_mps)) * stature_m / _WALK_RATIO_STATURE_M


def ease(share: float) -> float:
    """Return a smooth rise from 0 to 1, level at both ends and beyond them.

    >>> ease(-1.0), ease(0.5), ease(2.0)
    (0.0, 0.5, 1.0)
    """
    inside = min(max(share, 0.0), 1.0)
    return inside * inside * (3.0 - 2.0 * inside)


def amplitude(speed_mps: float) -> float:
    """Return how much of a full step is taken: 0 standing, 1 from 0.5 m/s on, feet gather below that."""
    return ease(speed_mps / _FULL_STEP_MPS)


class Footing(NamedTuple):
    """Where an ankle is: ahead of the hips, above the ground, how far the toes point up, how far the sole rolled."""

    x_m: float
    z_m: float
    pitch_deg: float
    rolled_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Sole:
    """A convex sole seen from the side.

    Attributes:
        points_m: (N, 2) x forward and z up from the ankle, from heel to toe, lower side of a convex shape.
    """

    points_m: FloatArray

    def resting(self, pitch_deg: float) -> tuple[float, float]:
        """Return how far the ankle has rolled ahead and how high it is when the pitched sole rests on the ground."""
        sine, cosine = np.sin(np.deg2rad(pitch_deg)), np.cos(np.deg2rad(pitch_deg))
        x, z = self.points_m.T
        lowest = int(np.argmin(x * sine + z * cosine))
        edges_m = np.hypot(np.diff(x), np.diff(z))
        along_m = np.concatenate([[0.0], np.cumsum(edges_m)])
        flat = int(np.argmin(z))
        unrolled_m = along_m[lowest] - along_m[flat] + x[flat]
        turned_m = x[lowest] * cosine - z[lowest] * sine
        return float(unrolled_m - turned_m), float(-(x[lowest] * sine + z[lowest] * cosine))


def footing(phase: float, step_m: float, share: float, sole: Sole) -> Footing:
    """Return where a foot is within its cycle.

    Args:
        phase: 0 at the touch of the heel, 1 at the next.
        step_m: Length of a full step; a cycle is two.
        share: How much of the full step is taken.
        sole: Of the boot.
    """
    phase = phase % 1.0
    stride_m = 2.0 * step_m * share
    touch_m, lift_m = sole.resting(float(_PITCH(0.0)) * share)[0], sole.resting(float(_PITCH(TOE_OFF)) * share)[0]
    planted_m = (stride_m * TOE_OFF - touch_m - lift_m) / 2
    pitch_deg = float(_PITCH(phase)) * share
    rolled_m, height_m = sole.resting(pitch_deg)
    if phase < TOE_OFF:
        return Footing(planted_m + rolled_m - stride_m * phase, height_m, pitch_deg, rolled_m)
    swing = (phase - TOE_OFF) / (1.0 - TOE_OFF)
    behind_m, ahead_m = planted_m + lift_m - stride_m * TOE_OFF, planted_m + touch_m
    retraction_m = stride_m * (1.0 - TOE_OFF)
    x_m = behind_m + (ahead_m - behind_m) * ease(swing) + retraction_m * swing * swing * (1.0 - swing)
    return Footing(x_m, height_m + _CLEARANCE_M * share * np.sin(np.pi * swing), pitch_deg, rolled_m)


def arm_swing_deg(phase: float, speed_mps: float) -> tuple[float, float]:
    """Return how far an upper arm is ahead and the bend of the elbow, from the phase of the leg on its side.

    The arm is furthest back when the leg on its side is furthest ahead; range of some 30 degrees at 1 m/s, growing
    with the speed.
    """
    half_range_deg = 15.0 * speed_mps**0.7 * amplitude(speed_mps)
    swing_deg = -half_range_deg * np.cos(2.0 * np.pi * phase)
    elbow_deg = 12.0 + 0.5 * half_range_deg + 0.6 * swing_deg
    return float(swing_deg - 0.2 * half_range_deg), float(elbow_deg)
