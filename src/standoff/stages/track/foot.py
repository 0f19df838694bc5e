"""Where in its box an entity's ground point lies, smoothed over time.

The point is kept relative to the box: in its width and height from its centre. So it goes along when the box moves,
when the camera moves, and while the detector rests. It is a mean over the last moments, surer ones weighing more. What
a network errs in one frame it errs in the next: the mean is no surer than the points that it is made of, and the stated
error is theirs, averaged alike.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import IntArray
from standoff.stages.track.motion import MotionArray

FOOT_FIELDS: list[Any] = [
    ("foot", np.float64, (2,)),
    ("foot_variance", np.float64, (2,)),
    ("foot_weight", np.float64, (2,)),
]
"""Fields of a structured row: the point and its variance in sides of the box, and the weight of what was seen so far;
NaN and 0 while none was seen."""

_SMALLEST_PX = 1.0
_LEAST_VARIANCE = 1e-8
"""Least variance of a point, in sides of its box: a thousandth of a worker's pixel would be surer than anything is."""


def start(rows: MotionArray) -> None:
    """Fill rows in place: no point was seen."""
    rows["foot"], rows["foot_variance"], rows["foot_weight"] = np.nan, np.nan, 0.0


def forget(rows: MotionArray, step_s: float, memory_s: float) -> None:
    """Let what was seen weigh less, in place: after `memory_s` a third of it."""
    rows["foot_weight"] *= np.exp(-step_s / memory_s)


def correct(rows: MotionArray, which: IntArray, foot_px: FloatArray, covariance_px2: FloatArray) -> None:
    """Take measured points into some of the rows, in place, after their boxes.

    Args:
        rows: (N,) structured, with `MOTION_FIELDS` and `FOOT_FIELDS`.
        which: (K,) indices of the rows that were seen, each at most once.
        foot_px: (K, 2); NaN where no point was seen.
        covariance_px2: (K, 2, 2); only its variances count.
    """
    known = np.isfinite(foot_px).all(axis=1)
    which, foot_px, covariance_px2 = which[known], foot_px[known], covariance_px2[known]
    seen = rows[which]
    centre, size = _centre_and_size(seen)
    measured = (foot_px - centre) / size
    variance = np.maximum(np.diagonal(covariance_px2, axis1=1, axis2=2) / size**2, _LEAST_VARIANCE)
    weight = 1.0 / variance
    seen["foot_weight"] += weight
    gain = weight / seen["foot_weight"]
    first = np.isnan(seen["foot"])
    seen["foot"] = np.where(first, measured, seen["foot"] + gain * (measured - seen["foot"]))
    seen["foot_variance"] = np.where(first, variance, seen["foot_variance"] + gain * (variance - seen["foot_variance"]))
    rows[which] = seen


def in_picture(rows: MotionArray) -> tuple[FloatArray, FloatArray]:
    """Return (N, 2) points in pixels and (N, 2, 2) their covariances; NaN where none was seen."""
    centre, size = _centre_and_size(rows)
    variance_px2 = rows["foot_variance"] * size**2
    return centre + rows["foot"] * size, variance_px2[:, :, None] * np.eye(2)


def _centre_and_size(rows: MotionArray) -> tuple[FloatArray, FloatArray]:
    return rows["box"][:, :2], np.maximum(rows["box"][:, 2:], _SMALLEST_PX)
