"""From output pixels to the pinhole picture that is drawn: one map for pixels and ids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray

_STEP_PX = 24
_MARGIN_PX = 12


@dataclass(frozen=True, slots=True, eq=False)
class LensMap:
    """Where each pixel of a piece of the distorted picture lies in the undistorted one.

    Attributes:
        undistorted_px: (H, W, 2) columns and rows; NaN where the lens shows nothing.
        origin_px: Column and row of the smallest rectangle of whole pixels that holds them all, with a margin.
        size_px: Its width and height.
    """

    undistorted_px: FloatArray
    origin_px: tuple[int, int]
    size_px: tuple[int, int]

    @classmethod
    def of(cls, camera: Camera, left_px: int, top_px: int, width_px: int, height_px: int) -> LensMap:
        """Undistort the pixel centres of a rectangle of the picture, which may lie partly outside of it."""
        x, y = left_px + np.arange(width_px, dtype=np.float64), top_px + np.arange(height_px, dtype=np.float64)
        undistorted = _undistorted_grid(camera, x, y)
        border = (undistorted[0], undistorted[-1], undistorted[:, 0], undistorted[:, -1])
        shown = np.concatenate(border)
        if np.isnan(shown).any():
            # The lens shows less than the rectangle: its outermost points are somewhere inside.
            shown = undistorted.reshape(-1, 2)
            shown = shown[~np.isnan(shown[:, 0])]
        if not len(shown):
            shown = np.zeros((1, 2))
        low = np.floor(shown.min(axis=0)) - _MARGIN_PX
        high = np.ceil(shown.max(axis=0)) + _MARGIN_PX
        size = (high - low + 1).astype(int).tolist()
        return cls(undistorted, (int(low[0]), int(low[1])), (size[0], size[1]))


def _exact_grid(camera: Camera, x: FloatArray, y: FloatArray) -> FloatArray:
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    exact: FloatArray = camera.undistort(grid.reshape(-1, 2)).reshape(grid.shape)
    return exact


def _undistorted_grid(camera: Camera, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return (len(y), len(x), 2), from a cubic spline through a coarse grid where the lens is smooth."""
    if not camera.bends:
        return np.stack(np.meshgrid(x, y), axis=-1).astype(np.float64)
    knots = [np.linspace(axis[0], axis[-1], len(axis) // _STEP_PX + 5) for axis in (x, y)]
    coarse = _exact_grid(camera, *knots)
    if np.isnan(coarse).any():
        return _exact_grid(camera, x, y)
    across, down = (make_interp_spline(knot, np.eye(len(knot)))(axis) for knot, axis in zip(knots, (x, y), strict=True))
    fine = np.empty((len(y), len(x), 2))
    for i in range(2):
        np.matmul(down, coarse[..., i] @ across.T, out=fine[..., i])
    return fine
