"""How fast each track moves on the ground."""

from __future__ import annotations

from collections import deque

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray

_MIN_POINTS = 3


def slope(times_s: FloatArray, xy_m: FloatArray) -> FloatArray:
    """Return the velocity of the straight motion that fits the points best.

    Args:
        times_s: (T,), not all equal.
        xy_m: (T, 2).

    Returns:
        (2,) metres per second.

    >>> slope(np.array([0.0, 0.5, 2.0]), np.array([[1.0, 0.0], [2.0, 0.0], [5.0, 0.0]]))
    array([2., 0.])
    """
    offsets_s = times_s - times_s.mean()
    velocity_mps: FloatArray = offsets_s @ xy_m / (offsets_s @ offsets_s)
    return velocity_mps


class VelocityEstimator:
    """Remember where each track was during the last seconds and fit a straight motion to it.

    Seconds count, not frames: leaving out frames of a straight motion changes nothing. Only where so few frames come
    that none of the window's would be enough, the window grows to the last three that saw something.

    Args:
        window_s: How far back to look.
        min_span_s: The points must span so much time; less tells noise from motion too badly.
    """

    def __init__(self, window_s: float, min_span_s: float) -> None:
        self._window_s = window_s
        self._min_span_s = min_span_s
        self._trails: dict[int, deque[tuple[float, float, float]]] = {}
        self._looks_s: deque[float] = deque(maxlen=_MIN_POINTS)

    def update(
        self, time_s: float, track_id: IntArray, xy_m: FloatArray, observed: BoolArray, trusted: BoolArray
    ) -> FloatArray:
        """Add this frame's positions and return all velocities.

        Args:
            time_s: Presentation timestamp.
            track_id: (M,) the live tracks; others are forgotten.
            xy_m: (M, 2) site frame.
            observed: (M,) which tracks are seen in this frame.
            trusted: (M,) which positions are evidence; the others add nothing.

        Returns:
            (M, 2) metres per second in the site frame; NaN where fewer than three positions are
            remembered or they span too little time.
        """
        self._trails = {track: self._trails.get(track, deque()) for track in track_id.tolist()}
        if observed.any():
            self._looks_s.append(time_s)
        since_s = min(time_s - self._window_s, *self._looks_s, time_s)
        velocity_mps = np.full((len(track_id), 2), np.nan)
        for row, trail in enumerate(self._trails.values()):
            if trusted[row]:
                trail.append((time_s, *xy_m[row].tolist()))
            while trail and trail[0][0] < since_s:
                trail.popleft()
            if len(trail) >= _MIN_POINTS and trail[-1][0] - trail[0][0] >= self._min_span_s:
                points = np.array(trail)
                velocity_mps[row] = slope(points[:, 0], points[:, 1:])
        return velocity_mps

    def reset(self) -> None:
        """Forget all tracks."""
        self._trails = {}
        self._looks_s.clear()
