"""Points without and with the lens distortion, quickly."""

from __future__ import annotations

import cv2
import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray

_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-9)
_BORDER = 9


class Lens:
    """A camera's distortion, by OpenCV where the lens is no fisheye and the whole picture can be undistorted.

    Args:
        camera: At the size of the frames; None: no distortion.
        size_px: (width, height) of the frames.
    """

    def __init__(self, camera: Camera | None, size_px: tuple[int, int]) -> None:
        self.camera = camera
        self._quick = False
        # OpenCV's quick functions know Brown and Conrady's lenses; a fisheye's own inverse is quick enough.
        if camera is None or camera.lens == "fisheye":
            return
        share = np.linspace(0.0, 1.0, _BORDER)
        zero, one = np.zeros(_BORDER), np.ones(_BORDER)
        x = np.concatenate([share, share, zero, one])
        y = np.concatenate([zero, one, share, share])
        border = camera.undistort(np.column_stack([x * size_px[0], y * size_px[1]]) - 0.5)
        self._quick = bool(np.isfinite(border).all())
        if self._quick:
            self._low, self._high = border.min(axis=0), border.max(axis=0)

    def undistorted(self, points_px: FloatArray) -> FloatArray:
        """Return (N, 2) points of the picture without distortion; NaN where the lens has no inverse."""
        if self.camera is None or not len(points_px):
            return points_px
        if not self._quick:
            return self.camera.undistort(points_px)
        matrix, distortion = self.camera.matrix, self.camera.distortion
        ideal = cv2.undistortPointsIter(points_px[:, None].copy(), matrix, distortion, np.eye(3), matrix, _CRITERIA)
        return np.asarray(ideal, dtype=np.float64)[:, 0]

    def distorted(self, ideal_px: FloatArray) -> FloatArray:
        """Return (N, 2) where points without distortion are seen; NaN well outside the picture."""
        if self.camera is None or not len(ideal_px):
            return ideal_px
        if not self._quick:
            return self.camera.distort(ideal_px)
        matrix, distortion = self.camera.matrix, self.camera.distortion
        with np.errstate(invalid="ignore"):
            near = ((ideal_px >= self._low) & (ideal_px <= self._high)).all(axis=1)
        rays = np.zeros((len(ideal_px), 3))
        rays[:, 2] = 1.0
        rays[near, :2] = (ideal_px[near] - matrix[:2, 2]) / (matrix[0, 0], matrix[1, 1])
        seen = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, distortion)[0][:, 0]
        seen_px: FloatArray = np.where(near[:, None], seen, np.nan)
        return seen_px
