"""How boxes move between frames: a Kalman filter over many boxes at once, in seconds.

A box is centre x, centre y, width, height in pixels. The centre moves at a constant velocity that
white acceleration disturbs; width and height drift as a random walk, so that a predicted box can
neither turn inside out nor swell. The four numbers are independent of each other, so each needs three
variances only and one step is a dozen element-wise operations, however many boxes there are.

Both models are of continuous time: one step of 0.2 s is the same as two of 0.1 s, which is what makes
dropped frames and variable frame rates harmless.

Source:
    Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation (2001),
    section 6.2.1 (continuous white noise acceleration) and 5.2 (the filter).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff.core.types import IntArray
from standoff.stages.track.params import TrackParams

MotionArray = npt.NDArray[np.void]

MOTION_FIELDS: list[Any] = [
    ("box", np.float64, (4,)),
    ("rate", np.float64, (4,)),
    ("box_variance", np.float64, (4,)),
    ("box_rate_covariance", np.float64, (4,)),
    ("rate_variance", np.float64, (4,)),
]
"""Fields of a structured row: box (centre x, centre y, width, height), its rate per second, and their covariance."""

_MOVES = np.array([1.0, 1.0, 0.0, 0.0])
_DRIFTS = 1.0 - _MOVES
_SMALLEST_PX = 1.0


def to_centre(xyxy_px: FloatArray) -> FloatArray:
    """Turn (N, 4) left, top, right, bottom into centre x, centre y, width, height.

    >>> to_centre(np.array([[0.0, 0.0, 4.0, 2.0]]))
    array([[2., 1., 4., 2.]])
    """
    first, last = xyxy_px[:, :2], xyxy_px[:, 2:]
    return np.concatenate([(first + last) / 2.0, last - first], axis=1)


def to_edges(boxes: FloatArray) -> FloatArray:
    """Turn (N, 4) centre x, centre y, width, height into left, top, right, bottom.

    >>> to_edges(np.array([[2.0, 1.0, 4.0, 2.0]]))
    array([[0., 0., 4., 2.]])
    """
    centre, half = boxes[:, :2], boxes[:, 2:] / 2.0
    return np.concatenate([centre - half, centre + half], axis=1)


def _sizes_px(boxes: FloatArray) -> FloatArray:
    """Return (N, 1) geometric mean of width and height: the unit in which noise is given."""
    sizes: FloatArray = np.maximum(np.sqrt(boxes[:, 2:3] * boxes[:, 3:4]), _SMALLEST_PX)
    return sizes


def start(rows: MotionArray, boxes: FloatArray, params: TrackParams) -> None:
    """Fill rows in place for boxes seen once: known place, unknown velocity.

    Args:
        rows: (N,) structured, fields `MOTION_FIELDS`.
        boxes: (N, 4) centre x, centre y, width, height.
        params: Noise, in box sizes.
    """
    sizes = _sizes_px(boxes)
    rows["box"] = boxes
    rows["rate"] = 0.0
    rows["box_variance"] = (params.box_noise * sizes) ** 2
    rows["box_rate_covariance"] = 0.0
    rows["rate_variance"] = (params.start_speed * sizes) ** 2 * _MOVES


def predict(rows: MotionArray, step_s: float, params: TrackParams) -> None:
    """Move rows in place by a time step, which may be zero.

    Args:
        rows: (N,) structured, fields `MOTION_FIELDS`.
        step_s: Seconds, not negative.
        params: Noise, in box sizes.
    """
    variance = _sizes_px(rows["box"]) ** 2
    acceleration = params.acceleration_noise**2 * variance * _MOVES
    drift = params.size_drift**2 * variance * _DRIFTS
    rows["box"] += step_s * rows["rate"]
    rows["box_variance"] += (
        step_s * (2.0 * rows["box_rate_covariance"] + step_s * rows["rate_variance"])
        + acceleration * (step_s**3 / 3.0)
        + drift * step_s
    )
    rows["box_rate_covariance"] += step_s * rows["rate_variance"] + acceleration * (step_s**2 / 2.0)
    rows["rate_variance"] += acceleration * step_s


def correct(rows: MotionArray, which: IntArray, boxes: FloatArray, params: TrackParams) -> None:
    """Take measured boxes into some of the rows, in place.

    Args:
        rows: (N,) structured, fields `MOTION_FIELDS`.
        which: (K,) indices of the rows that were seen, each at most once.
        boxes: (K, 4) what was seen: centre x, centre y, width, height.
        params: Noise, in box sizes.
    """
    seen = rows[which]
    noise = (params.box_noise * _sizes_px(boxes)) ** 2
    box: FloatArray = seen["box"]
    variance: FloatArray = seen["box_variance"]
    covariance: FloatArray = seen["box_rate_covariance"]
    total = variance + noise
    innovation = boxes - box
    gain, rate_gain = variance / total, covariance / total
    seen["box"] += gain * innovation
    seen["rate"] += rate_gain * innovation
    seen["rate_variance"] -= rate_gain * covariance
    seen["box_rate_covariance"] *= 1.0 - gain
    seen["box_variance"] *= 1.0 - gain
    rows[which] = seen
