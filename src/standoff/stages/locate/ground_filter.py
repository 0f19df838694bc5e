"""Places and velocities on the ground, from the places seen so far: a Kalman filter for each track.

Only the part of an error that is another in every frame averages out; what a network errs in one frame it errs in the
next, and all entities share the error of the map. So the filter takes in the first part alone, and whoever states an
error adds the others to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from standoff.core.durations import have_lasted
from standoff.core.ground_motion import SPEED_MPS, transition, wandering
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.roles import IS_EQUIPMENT
from standoff.core.types import IntArray

_GATE: Final = 18.4
"""Squared distance, in standard errors, that one in 10,000 right places exceeds: chi-square, two degrees of freedom."""
_DOUBT_S: Final = 0.3
"""A place that goes on to be so far off is a new one, not an error."""
_KNOWN_SHARE: Final = 0.7
"""A velocity is told once its standard error is less than so much of what its class would have anyway."""
_STEP_M, _WOBBLE_SIGMAS, _MOST_M = 0.5, 3.0, 1.5
"""Whoever is nearer to where it was stands: so far, or as far as its place wobbles by its stated error, but no further.
Of whom less is known nobody can say that it stands, and it has moved once it seems to."""
_STOOD_OVER_S: Final = 20.0
"""Where something stands is the mean of so long at most: one that creeps has moved at last."""
_LEAST_NOISE_M2: Final = 1e-6
"""No place is seen to better than a millimetre."""
_ROW = np.dtype(
    [
        ("track_id", np.int64),
        ("class_id", np.int64),
        ("mean", np.float64, (4,)),
        ("covariance", np.float64, (4, 4)),
        ("lasting_m2", np.float64, (2, 2)),
        ("stood_m", np.float64, (2,)),
        ("stood_s", np.float64),
        ("seen_s", np.float64),
        ("doubted_s", np.float64),
    ]
)


@dataclass(frozen=True, slots=True, eq=False)
class Filtered:
    """Where tracks are, (M,) rows each.

    Attributes:
        mean: (M, 4) x, y in metres, vx, vy in metres per second; NaN before anything was seen.
        covariance: (M, 4, 4) of the whole of their errors but what all tracks share; NaN likewise.
        seen_s: (M,) when the place was last taken in; minus infinity before.
        standing_s: (M,) for how long it has not moved; NaN before anything was seen.
        velocity_known: (M,) whether the velocity is more than its class's usual one.
    """

    mean: FloatArray
    covariance: FloatArray
    seen_s: FloatArray
    standing_s: FloatArray
    velocity_known: BoolArray


class GroundFilter:
    """The tracks of one stream in one site frame.

    A place that is too far off for its error is left out, and is where the track goes on if it stays there for
    a third of a second: nothing stale is held for longer.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all tracks."""
        self._rows = np.zeros(0, _ROW)
        self._time_s = -math.inf

    def update(
        self, time_s: float, track_id: IntArray, class_id: IntArray, xy_m: FloatArray,
        noise_m2: FloatArray, lasting_m2: FloatArray, shared_m2: FloatArray,
    ) -> Filtered:  # fmt: skip
        """Predict all tracks to a frame and take in what was seen.

        Args:
            time_s: Presentation timestamp, not before the last one.
            track_id: (M,) the live tracks; others are forgotten.
            class_id: (M,) ids of `CLASSES`.
            xy_m: (M, 2) places; NaN where none was seen.
            noise_m2: (M, 2, 2) covariance of the part of their errors that is another in every frame.
            lasting_m2: (M, 2, 2) of the part that a track keeps.
            shared_m2: (M, 2, 2) of the part that all tracks share, to tell what is no error any more.
        """
        self._follow(track_id, class_id)
        step_s = time_s - self._time_s if math.isfinite(self._time_s) else 0.0
        if step_s > 0.0:
            self._predict(step_s)
        self._time_s = time_s
        seen: BoolArray = np.asarray(np.isfinite(xy_m).all(axis=1))
        fresh = seen & ~np.isfinite(self._rows["seen_s"])
        self._start(fresh, xy_m, noise_m2)
        known = np.flatnonzero(seen & ~fresh)
        fits = self._fits(known, xy_m, noise_m2 + lasting_m2 + shared_m2)
        self._correct(known[fits], xy_m, noise_m2)
        doubted = known[~fits]
        since_s = self._rows["doubted_s"][doubted]
        self._rows["doubted_s"][doubted] = np.where(np.isnan(since_s), time_s, since_s)
        again = np.zeros(len(seen), dtype=np.bool_)
        again[doubted] = have_lasted(time_s - self._rows["doubted_s"][doubted], _DOUBT_S)
        self._start(again, xy_m, noise_m2)
        taken = self._rows["seen_s"] == time_s
        self._rows["lasting_m2"][taken] = lasting_m2[taken]
        self._stand(step_s)
        return self._filtered()

    def _follow(self, track_id: IntArray, class_id: IntArray) -> None:
        """Bring the rows into the order of the tracks; new ones know nothing."""
        rows = np.zeros(len(track_id), _ROW)
        for name in ("mean", "covariance", "stood_m", "stood_s", "doubted_s"):
            rows[name] = np.nan
        rows["seen_s"] = -np.inf
        _, ours, theirs = np.intersect1d(track_id, self._rows["track_id"], return_indices=True)
        rows[ours] = self._rows[theirs]
        rows["track_id"], rows["class_id"] = track_id, class_id
        self._rows = rows

    def _predict(self, step_s: float) -> None:
        rows = self._rows
        forth = transition(rows["class_id"], step_s)
        rows["mean"] = (forth @ rows["mean"][:, :, None])[:, :, 0]
        # Somebody who works on the spot goes a step at any time: for a filter only a machine starts slowly.
        standing_s = np.where(IS_EQUIPMENT[rows["class_id"]], self._time_s - rows["stood_s"], 0.0)
        gained = wandering(rows["class_id"], step_s, standing_s)
        rows["covariance"] = forth @ rows["covariance"] @ forth.transpose(0, 2, 1) + gained

    def _start(self, which: BoolArray, xy_m: FloatArray, noise_m2: FloatArray) -> None:
        rows = self._rows[which]
        rows["mean"] = np.column_stack([xy_m[which], np.zeros((len(rows), 2))])
        rows["covariance"] = 0.0
        rows["covariance"][:, :2, :2] = noise_m2[which]
        rows["covariance"][:, [2, 3], [2, 3]] = SPEED_MPS[rows["class_id"], None] ** 2
        rows["seen_s"], rows["doubted_s"] = self._time_s, np.nan
        self._rows[which] = rows

    def _fits(self, which: IntArray, xy_m: FloatArray, doubt_m2: FloatArray) -> BoolArray:
        rows = self._rows[which]
        off_m = xy_m[which] - rows["mean"][:, :2]
        spread_m2 = rows["covariance"][:, :2, :2] + doubt_m2[which] + _LEAST_NOISE_M2 * np.eye(2)
        distance2 = (off_m * np.linalg.solve(spread_m2, off_m[:, :, None])[:, :, 0]).sum(axis=1)
        fits: BoolArray = distance2 <= _GATE
        return fits

    def _correct(self, which: IntArray, xy_m: FloatArray, noise_m2: FloatArray) -> None:
        rows = self._rows[which]
        off_m = xy_m[which] - rows["mean"][:, :2]
        covariance = rows["covariance"]
        total = covariance[:, :2, :2] + noise_m2[which] + _LEAST_NOISE_M2 * np.eye(2)
        gain = np.linalg.solve(total, covariance[:, :2, :]).transpose(0, 2, 1)
        rows["mean"] += (gain @ off_m[:, :, None])[:, :, 0]
        rows["covariance"] = covariance - gain @ total @ gain.transpose(0, 2, 1)
        rows["seen_s"], rows["doubted_s"] = self._time_s, np.nan
        self._rows[which] = rows

    def _stand(self, step_s: float) -> None:
        """Remember since when each track is where it is; one that went further than its error allows has moved."""
        rows = self._rows
        spread_m2 = np.trace(rows["covariance"][:, :2, :2] + rows["lasting_m2"], axis1=1, axis2=2)
        off_m = rows["mean"][:, :2] - rows["stood_m"]
        within_m = np.clip(_WOBBLE_SIGMAS * np.sqrt(spread_m2), _STEP_M, _MOST_M)
        stands = np.linalg.norm(off_m, axis=1) <= within_m
        # The first look is as far off as any other: the place of one that stands is the mean of all.
        stood_s = np.minimum(self._time_s - rows["stood_s"], _STOOD_OVER_S)
        share = np.divide(step_s, stood_s, out=np.ones(len(rows)), where=stood_s > step_s)
        rows["stood_m"] = np.where(stands[:, None], rows["stood_m"] + share[:, None] * off_m, rows["mean"][:, :2])
        rows["stood_s"][~stands] = self._time_s

    def _filtered(self) -> Filtered:
        rows = self._rows
        largest = np.sqrt(np.maximum(rows["covariance"][:, 2, 2], rows["covariance"][:, 3, 3]))
        known = largest < _KNOWN_SHARE * SPEED_MPS[rows["class_id"]]
        covariance = rows["covariance"].copy()
        covariance[:, :2, :2] += rows["lasting_m2"]
        return Filtered(rows["mean"].copy(), covariance, rows["seen_s"].copy(), self._time_s - rows["stood_s"], known)
