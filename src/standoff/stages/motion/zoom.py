"""Tells a zooming lens from a flying camera."""

from __future__ import annotations

import numpy as np

from standoff.core.homography import FloatArray

_LEAST_GROWTH = 0.05
"""Logarithm of scale that must come together: one step may be a jolt."""

_LEAST_UNEVEN = 0.25
"""Difference of growth within the picture, as a share of it, that only a camera that moves can cause."""

_SAMPLES = np.array([[0.5, 0.5], [0.15, 0.15], [0.85, 0.15], [0.85, 0.85], [0.15, 0.85]])


class ZoomWatch:
    """Watches how the picture's scale changes from frame to frame.

    A zoom makes everything grow alike, and quicker than a descent can: 5 m/s at 10 m above ground is 0.5 a second. A
    slower zoom cannot be told from a descent over flat ground seen from above.

    Args:
        rate: Logarithm of scale a second from which it is a zoom.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._growth = 0.0

    def reset(self) -> None:
        """Forget what was seen."""
        self._growth = 0.0

    def zooms(self, step: FloatArray, elapsed_s: float, size_px: tuple[int, int]) -> bool:
        """Say whether the lens zooms.

        Args:
            step: (3, 3) homography from the frame before to this one, frame pixels.
            elapsed_s: Seconds between the two.
            size_px: (width, height) of the frames.
        """
        w = _SAMPLES @ (step[2, :2] * size_px) + step[2, 2]
        whole = float(np.linalg.det(step))
        if elapsed_s <= 0.0 or whole <= 0.0 or not (w > 0.0).all():
            self.reset()
            return False
        # The determinant of a homography's derivative is its own, over the cube of its denominator.
        growth = np.log(whole / w**3) / 2.0
        mean = float(growth.mean())
        quick = abs(mean) > self._rate * elapsed_s
        even = float(np.ptp(growth)) < _LEAST_UNEVEN * abs(mean)
        self._growth = self._growth + mean if quick and even else 0.0
        return abs(self._growth) > _LEAST_GROWTH
