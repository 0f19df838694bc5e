"""How things of each class move on the ground when nothing more is known.

Each coordinate's velocity wanders about zero: it has a usual size and is forgotten after some time (an
Ornstein-Uhlenbeck process), so that a walker may stop within a step, a loader reverses, and an excavator stands and
swings. The place is its integral. Unlike a velocity that wanders for ever, this one never predicts a worker at 10 m/s.

Source:
    Uhlenbeck and Ornstein, On the Theory of the Brownian Motion, 1930; the same for velocities of ships: Millefiori et
    al., Modeling Vessel Kinematics Using a Stochastic Mean-Reverting Process for Long-Term Prediction, 2016, eq. 4-9.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff.core.types import IntArray


class _Motion(NamedTuple):
    speed_mps: float
    memory_s: float


_MOTION_OF: Final = {
    "worker": _Motion(0.9, 4.0),
    "excavator": _Motion(0.3, 1.0),
    "wheel_loader": _Motion(1.5, 3.0),
    "dump_truck": _Motion(2.0, 4.0),
    "roller_or_dozer": _Motion(0.8, 3.0),
    "vehicle": _Motion(3.0, 4.0),
    "reference": _Motion(0.01, 1.0),
}
SPEED_MPS: Final = np.array([_MOTION_OF[site_class.name].speed_mps for site_class in CLASSES])
"""(C,) standard deviation of each coordinate's velocity, by class."""
MEMORY_S: Final = np.array([_MOTION_OF[site_class.name].memory_s for site_class in CLASSES])
"""(C,) after so many seconds a third of a velocity is left, by class."""
_STANDING_S, _STARTING_SHARE = 2.0, 0.4
"""Who stood for so long, a machine or somebody at work, gets no further in three seconds than some metre, other than
one that is on its way."""

_PLACES, _PLACE_BY_SPEED, _SPEED_BY_PLACE, _SPEEDS = (slice(start, start + 6, 5) for start in (0, 2, 8, 10))
"""Entries of a (4, 4) matrix, row by row: x of x and y of y, x of vx and y of vy, and so on."""

_PLACES, _PLACE_BY_SPEED, _SPEED_BY_PLACE, _SPEEDS = (slice(start, start + 6, 5) for start in (0, 2, 8, 10))
"""Entries of a (4, 4) matrix, row by row: x of x and y of y, x of vx and y of vy, and so on."""


def transition(class_id: IntArray, step_s: float) -> FloatArray:
    """Return (N, 4, 4) what x, y, vx and vy become on average.

    Args:
        class_id: (N,) ids of `CLASSES`.
        step_s: Not negative.
    """
    memory_s = MEMORY_S[class_id]
    left = np.exp(-step_s / memory_s)
    matrix = np.zeros((len(class_id), 16))
    matrix[:, _PLACES] = 1.0
    matrix[:, _PLACE_BY_SPEED] = (memory_s * (1.0 - left))[:, None]
    matrix[:, _SPEEDS] = left[:, None]
    return matrix.reshape(-1, 4, 4)


def wandering(class_id: IntArray, step_s: float, standing_s: FloatArray | None = None) -> FloatArray:
    """Return (N, 4, 4) covariance that x, y, vx and vy gain.

    Args:
        class_id: (N,) ids of `CLASSES`.
        step_s: Not negative.
        standing_s: (N,) for how long each has not moved: who stands starts slowly. Left out: all move.
    """
    memory_s, variance = MEMORY_S[class_id], SPEED_MPS[class_id] ** 2
    if standing_s is not None:
        variance = np.where(standing_s >= _STANDING_S, _STARTING_SHARE**2, 1.0) * variance
    steps = step_s / memory_s
    left = np.exp(-steps)
    matrix = np.zeros((len(class_id), 16))
    place = variance * memory_s**2 * np.maximum(2.0 * steps - 3.0 + 4.0 * left - left**2, 0.0)
    both = variance * memory_s * (1.0 - left) ** 2
    matrix[:, _PLACES] = place[:, None]
    matrix[:, _PLACE_BY_SPEED] = matrix[:, _SPEED_BY_PLACE] = both[:, None]
    matrix[:, _SPEEDS] = (variance * (1.0 - left**2))[:, None]
    return matrix.reshape(-1, 4, 4)
