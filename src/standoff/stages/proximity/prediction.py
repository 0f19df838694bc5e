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

from standoff.core.compiled import compiled
from standoff.core.ground_motion import transition, wandering
from standoff.core.homography import FloatArray
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
    movers = _Movers.of(positions)
    likeliest = np.concatenate([movers.place[None], movers.mean_places(steps)])
    apart_m = np.abs(likeliest[:, b] - likeliest[:, a])
    measured = np.isfinite(apart_m[0])
    nearest = apart_m.argmin(axis=0)
    closest_m = np.take_along_axis(apart_m, nearest[None], axis=0)[0]
    closest_in_s = np.where(measured, nearest * STEP_S, np.nan)
    now, soon = np.where(measured, 0.0, np.nan), np.where(measured, 0.0, np.nan)
    shared_m = positions.map_factor_m[b] - positions.map_factor_m[a]
    spread_m2 = movers.spread_m2(steps)
    spread_m = np.sqrt(spread_m2[a] + spread_m2[b] + (shared_m**2).sum(axis=(1, 2)))
    possible = np.flatnonzero(measured & (closest_m - _IMPOSSIBLE * spread_m < reach_m))
    if len(possible):
        shared = shared_m[possible] @ _MAPS
        # Whoever is in several pairs goes the same paths in all of them.
        (rows_a, of_a), (rows_b, of_b) = (np.unique(one[possible], return_inverse=True) for one in (a, b))
        now[possible], soon[possible] = _touching(
            movers.paths(rows_a, _STATES[0], _STEPS[0][:steps]),
            movers.paths(rows_b, _STATES[1], _STEPS[1][:steps]),
            of_a,
            of_b,
            shared[:, 0] + 1j * shared[:, 1],
            reach_m[possible],
        )
    return Prediction(closest_m, closest_in_s, now, soon)


@compiled
def _touching(
    paths_a: _ComplexArray,
    paths_b: _ComplexArray,
    of_a: IntArray,
    of_b: IntArray,
    shift: _ComplexArray,
    reach_m: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return (K,) which share of paths touches at its beginning, and which anywhere.

    Args:
        paths_a: (A, times, paths) places of the one side.
        paths_b: (B, times, paths) of the other.
        of_a: (K,) which of the first each pair goes.
        of_b: (K,) and of the second.
        shift: (K, paths) by what the map moves them apart.
        reach_m: (K,) at which distance they touch.
    """
    pairs, (times, paths) = len(of_a), paths_a.shape[1:]
    now, soon = np.zeros(pairs), np.zeros(pairs)
    for pair in range(pairs):
        one, other, reach2 = paths_a[of_a[pair]], paths_b[of_b[pair]], reach_m[pair] ** 2
        touched = np.zeros(paths, dtype=np.bool_)
        for time in range(times):
            for path in range(paths):
                off = other[time, path] - one[time, path] + shift[pair, path]
                touched[path] |= off.real * off.real + off.imag * off.imag < reach2
            if time == 0:
                now[pair] = touched.sum() / paths
        soon[pair] = touched.sum() / paths
    return now, soon


@compiled
def _gone_on(
    place: _ComplexArray,
    velocity: _ComplexArray,
    travelled: FloatArray,
    left: FloatArray,
    noise: FloatArray,
    drawn: _ComplexArray,
) -> _ComplexArray:
    """Return (N, 1 + steps, paths) places from (N, paths) places and velocities on; the rest as in `_Movers`."""
    count, paths = place.shape
    steps = len(drawn)
    gone = np.empty((count, 1 + steps, paths), dtype=np.complex128)
    for row in range(count):
        by_first, both, rest = noise[row]
        for path in range(paths):
            at, speed = place[row, path], velocity[row, path]
            gone[row, 0, path] = at
            for step in range(steps):
                at = at + travelled[row] * speed + by_first * drawn[step, 0, path]
                speed = left[row] * speed + both * drawn[step, 0, path] + rest * drawn[step, 1, path]
                gone[row, 1 + step, path] = at
    return gone


class _Movers(NamedTuple):
    """All tracks, (M,); places and velocities are complex numbers, x + iy.

    Attributes:
        place: In metres.
        velocity: In metres per second; 0 where it is unknown.
        covariance: (M, 4, 4) of both.
        class_id: For its motion.
        standing_s: For how long it has not moved.
        left: Of a velocity after a step.
        travelled: Seconds for which a velocity carries in a step.
        noise: (M, 3) what a step adds: place from the first number that is drawn, velocity from the first and second.
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
    def of(cls, positions: GroundPositions) -> _Movers:
        class_id, standing_s = positions.class_id, positions.standing_s
        forth, gained = transition(class_id, STEP_S), wandering(class_id, STEP_S, standing_s)
        by_first = np.sqrt(gained[:, 0, 0])
        both = gained[:, 0, 2] / by_first
        rest = np.sqrt(np.maximum(gained[:, 2, 2] - both**2, 0.0))
        place, velocity = positions.xy_m, np.nan_to_num(positions.velocity_mps)
        return cls(
            place[:, 0] + 1j * place[:, 1],
            velocity[:, 0] + 1j * velocity[:, 1],
            positions.state_covariance,
            class_id,
            standing_s,
            forth[:, 2, 2],
            forth[:, 0, 2],
            np.column_stack([by_first, both, rest]),
        )

    def mean_places(self, steps: int) -> _ComplexArray:
        """Return (steps, M) where the likeliest path is after each step."""
        left = self.left ** np.arange(steps)[:, None]
        places: _ComplexArray = self.place + np.cumsum(left * self.travelled, axis=0) * self.velocity
        return places

    def spread_m2(self, steps: int) -> FloatArray:
        """Return (M,) variance of the place after all steps, summed over both coordinates."""
        forth = transition(self.class_id, steps * STEP_S)
        gained = wandering(self.class_id, steps * STEP_S, self.standing_s)
        covariance = forth @ self.covariance @ forth.transpose(0, 2, 1) + gained
        spread: FloatArray = covariance[:, 0, 0] + covariance[:, 1, 1]
        return spread

    def paths(self, rows: IntArray, states: FloatArray, drawn: _ComplexArray) -> _ComplexArray:
        """Return (N, 1 + steps, paths) where some of the tracks (N,) may be now and after each step.

        Args:
            rows: Which; their places are known.
            states: (4, paths) numbers drawn for where each is and how fast.
            drawn: (steps, 2, paths) for what happens on the way.
        """
        variances, axes = np.linalg.eigh(self.covariance[rows])
        off = axes * np.sqrt(np.maximum(variances, 0.0))[:, None, :] @ states
        place = self.place[rows, None] + off[:, 0] + 1j * off[:, 1]
        velocity = self.velocity[rows, None] + off[:, 2] + 1j * off[:, 3]
        return _gone_on(place, velocity, self.travelled[rows], self.left[rows], self.noise[rows], drawn)
