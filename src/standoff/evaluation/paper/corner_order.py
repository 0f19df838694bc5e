"""Which corner of the reference is which: a square looks the same four ways, and nothing in a picture tells them apart.

Distances do not depend on it; positions in the site frame and errors of corners do. For them, the way that fits the
truth best is taken, among those that the shape cannot tell apart.
"""

from __future__ import annotations

import numpy as np

from standoff.core.homography import FloatArray
from standoff.stages.ground import ReferenceShape


class CornerOrder:
    """Compares found corners with true ones and turns positions accordingly.

    Args:
        shape: As the ground stage knows it.
        corners_m: (4, 2) true corners in the order of the truth, site frame.
    """

    def __init__(self, shape: ReferenceShape, corners_m: FloatArray) -> None:
        self._shape_m = shape.corners_m
        self._turns = shape.turns_onto_itself()
        apart_m = np.linalg.norm(corners_m[None] - self._shape_m[:, None], axis=2)
        self._order = apart_m.argmin(axis=1)

    def compare(self, found_px: FloatArray, true_px: FloatArray) -> tuple[FloatArray, int]:
        """Return the distance of each corner from its true place, and the turn that makes them smallest.

        Args:
            found_px: (4, 2) in the shape's order.
            true_px: (4, 2) in the order of the truth.

        Returns:
            (4,) px, and the turn for `to_site`.
        """
        true_px = true_px[self._order]
        errors = {turn: np.linalg.norm(found_px - np.roll(true_px, -turn, axis=0), axis=1) for turn in self._turns}
        best = min(errors, key=lambda turn: float(errors[turn].max()))
        return errors[best], best

    def nearest(self, points_m: FloatArray, true_m: FloatArray) -> int:
        """Return the turn for `to_site` that brings (N, 2) positions nearest to their true places, N > 0."""
        return min(
            self._turns,
            key=lambda turn: float(np.median(np.linalg.norm(self.to_site(points_m, turn) - true_m, axis=1))),
        )

    def to_site(self, points_m: FloatArray, turn: int) -> FloatArray:
        """Turn (..., 2) positions about the reference's middle so that its corners lie where the truth has them."""
        middle = self._shape_m.mean(axis=0)
        turned: FloatArray = (points_m - middle) @ self._rotation(turn).T + middle
        return turned

    def covariance_to_site(self, covariance_m2: FloatArray, turn: int) -> FloatArray:
        """Turn (..., 2, 2) covariances of such positions."""
        rotation = self._rotation(turn)
        turned: FloatArray = rotation @ covariance_m2 @ rotation.T
        return turned

    def _rotation(self, turn: int) -> FloatArray:
        middle = self._shape_m.mean(axis=0)
        before = (self._shape_m - middle) @ np.array([1.0, 1.0j])
        # vdot conjugates its first argument: the angle of the sum is that of the best rotation.
        angle = np.angle(np.vdot(before, np.roll(before, -turn)))
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
