"""How likely two entities' circles touch, now and soon.

Paths are drawn: from the places and velocities that are known, with their errors, on with the motion of each class. All
pairs of all frames use the same drawn numbers, so that a probability changes only where what is known does. A mean path
would not do: two that stand still close together have no closing speed and may touch all the same.

Source:
    The motion of each class: `standoff.core.ground_motion`. Counting drawn paths that come too near: Broadhurst, Baker
    and Kanade, Monte Carlo Road Safety Reasoning, 2005, section III.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from standoff.core.ground_motion import transition, wandering
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import GroundPositions, IntArray

_ComplexArray = npt.NDArray[np.complex128]
STEP_S: Final = 0.25
_PATHS: Final = 256
_MOST_STEPS: Final = 20
_IMPOSSIBLE: Final = 5.0
"""Standard errors that nobody is off by."""


class Prediction(NamedTuple):
    """What is to be expected of each pair, (K,); NaN where it is not measured.

    Attributes:
        closest_m: Least distance, centre to centre, of the likeliest paths within the horizon.
        closest_in_s: When that is.
        breach_now: Probability that the gap is negative.
        breach_ahead: Probability that it is, or will be within the horizon.
    """

    closest_m: FloatArray
    closest_in_s: FloatArray
    breach_now: FloatArray
    breach_ahead: FloatArray


def _drawn(seed: int, *shape: int) -> FloatArray:
    """Return standard normal numbers whose second half along the last axis is the negative of the first."""
    half = np.random.default_rng(seed).normal(size=(*shape[:-1], shape[-1] // 2))
    return np.concatenate([half, -half], axis=-1)


def _drawn_steps(seed: int) -> _ComplexArray:
    parts = _drawn(seed, 2, _MOST_STEPS, 2, _PATHS)
    steps: _ComplexArray = parts[0] + 1j * parts[1]
    return steps


_STATES: Final = (_drawn(1, 4, _PATHS), _drawn(2, 4, _PATHS))
_STEPS: Final = (_drawn_steps(3), _drawn_steps(4))
_MAPS: Final = _drawn(5, 10, _PATHS)


def predict(positions: GroundPositions, a: IntArray, b: IntArray, reach_m: FloatArray, horizon_s: float) -> Prediction:
    """Draw the paths of pairs.

    Args:
        positions: Of all tracks.
        a: (K,) rows of the one side.
        b: (K,) rows of the other.
        reach_m: (K,) at which distance they touch.
        horizon_s: How far ahead, in steps of `STEP_S`; `_MOST_STEPS` of them at most.
    """
    steps = min(round(horizon_s / STEP_S), _MOST_STEPS)
    sides = [_Side.of(positions, rows) for rows in (a, b)]
    offset_m = sides[1].place - sides[0].place
    measured = np.isfinite(offset_m)
    closest_m, closest_in_s = np.abs(offset_m), np.where(measured, 0.0, np.nan)
    ahead = [side.mean_places(steps) for side in sides]
    for k, distance_m in enumerate(np.abs(ahead[1] - ahead[0])):
        nearer = distance_m < closest_m
        closest_m, closest_in_s = (
            np.where(nearer, distance_m, closest_m),
            np.where(nearer, (k + 1) * STEP_S, closest_in_s),
        )
    now, soon = np.where(measured, 0.0, np.nan), np.where(measured, 0.0, np.nan)
    shared_m = positions.map_factor_m[b] - positions.map_factor_m[a]
    spread_m = np.sqrt(sides[0].spread_m2(steps) + sides[1].spread_m2(steps) + (shared_m**2).sum(axis=(1, 2)))
    possible = np.flatnonzero(measured & (closest_m - _IMPOSSIBLE * spread_m < reach_m))
    if len(possible):
        shared = shared_m[possible] @ _MAPS
        shift = shared[:, 0] + 1j * shared[:, 1]
        touched = _touched([side.some(possible) for side in sides], shift, reach_m[possible, None], steps)
        now[possible], soon[possible] = (part.mean(axis=1) for part in touched)
    return Prediction(closest_m, closest_in_s, now, soon)


def _touched(sides: list[_Side], shift: _ComplexArray, reach_m: FloatArray, steps: int) -> tuple[BoolArray, BoolArray]:
    """Return (K, paths) which paths touch at their beginning, and which anywhere."""
    paths = [side.begin(drawn) for side, drawn in zip(sides, _STATES, strict=True)]
    offset = paths[1][0] - paths[0][0] + shift
    now: BoolArray = np.abs(offset) < reach_m
    soon = now.copy()
    for k in range(steps):
        paths = [side.go_on(*path, drawn[k]) for side, path, drawn in zip(sides, paths, _STEPS, strict=True)]
        soon |= np.abs(paths[1][0] - paths[0][0] + shift) < reach_m
    return now, soon


class _Side(NamedTuple):
    """One entity of each pair, (K,); places and velocities are complex numbers, x + iy.

    Attributes:
        place: In metres.
        velocity: In metres per second; 0 where it is unknown.
        covariance: (K, 4, 4) of both.
        class_id: For its motion.
        standing_s: For how long it has not moved.
        left: Of a velocity after a step.
        travelled: Seconds for which a velocity carries in a step.
        noise: (K, 3) what a step adds: place from the first number that is drawn, velocity from the first and second.
    """

    place: _ComplexArray
    velocity: _ComplexArray
    covariance: FloatArray
    class_id: IntArray
    standing_s: FloatArray
    left: FloatArray
    travelled: FloatArray
    noise: FloatArray

    @classmethod
    def of(cls, positions: GroundPositions, rows: IntArray) -> _Side:
        class_id = positions.class_id[rows]
        standing_s = positions.standing_s[rows]
        forth, gained = transition(class_id, STEP_S), wandering(class_id, STEP_S, standing_s)
        by_first = np.sqrt(gained[:, 0, 0])
        both = gained[:, 0, 2] / by_first
        rest = np.sqrt(np.maximum(gained[:, 2, 2] - both**2, 0.0))
        place, velocity = positions.xy_m[rows], np.nan_to_num(positions.velocity_mps[rows])
        return cls(
            place[:, 0] + 1j * place[:, 1],
            velocity[:, 0] + 1j * velocity[:, 1],
            positions.state_covariance[rows],
            class_id,
            standing_s,
            forth[:, 2, 2],
            forth[:, 0, 2],
            np.column_stack([by_first, both, rest]),
        )

    def some(self, which: IntArray) -> _Side:
        """Return some of the pairs."""
        return _Side(
            self.place[which], self.velocity[which], self.covariance[which], self.class_id[which],
            self.standing_s[which], self.left[which],
            self.travelled[which], self.noise[which],
        )  # fmt: skip

    def mean_places(self, steps: int) -> _ComplexArray:
        """Return (steps, K) where the likeliest path is after each step."""
        left = self.left ** np.arange(steps)[:, None]
        places: _ComplexArray = self.place + np.cumsum(left * self.travelled, axis=0) * self.velocity
        return places

    def spread_m2(self, steps: int) -> FloatArray:
        """Return (K,) variance of the place after all steps, summed over both coordinates."""
        forth = transition(self.class_id, steps * STEP_S)
        gained = wandering(self.class_id, steps * STEP_S, self.standing_s)
        covariance = forth @ self.covariance @ forth.transpose(0, 2, 1) + gained
        spread: FloatArray = covariance[:, 0, 0] + covariance[:, 1, 1]
        return spread

    def begin(self, drawn: FloatArray) -> tuple[_ComplexArray, _ComplexArray]:
        """Return (K, paths) places and velocities as they may be now."""
        variances, axes = np.linalg.eigh(self.covariance)
        off = axes * np.sqrt(np.maximum(variances, 0.0))[:, None, :] @ drawn
        return self.place[:, None] + off[:, 0] + 1j * off[:, 1], self.velocity[:, None] + off[:, 2] + 1j * off[:, 3]

    def go_on(
        self, places: _ComplexArray, velocities: _ComplexArray, drawn: _ComplexArray
    ) -> tuple[_ComplexArray, _ComplexArray]:
        """Return (K, paths) both after a step."""
        by_first, both, rest = self.noise.T[:, :, None]
        places = places + self.travelled[:, None] * velocities + by_first * drawn[0]
        return places, self.left[:, None] * velocities + both * drawn[0] + rest * drawn[1]
