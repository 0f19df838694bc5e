"""The rectified picture (Eq. 5): the piece of ground that is shown, and the frame warped onto it.

For people's eyes only: nothing is ever measured in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core import homography
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import GroundMap, ImageArray

_GRID = 24
_CELL_PX = (24, 8)  # the view is foreshortened along y, so the map bends most along it
_COARSEST_RATIO = 4.0  # ground metres per pixel over the finest seen: beyond, the rectified picture is a smear
_RARE_PERCENT = 10.0  # of the picture on either side that the window may leave out
_OUTSIDE_PX = -1e7  # so far that no pixel between it and a seen one is seen


@dataclass(frozen=True, slots=True)
class GroundWindow:
    """A piece of ground as a picture: a similarity, so that a metre is as long everywhere.

    Attributes:
        ground_to_window: (3, 3) from metres to window pixels, y down.
        size_px: (width, height).
        m_per_px: Metres in one pixel.
    """

    ground_to_window: FloatArray
    size_px: tuple[int, int]
    m_per_px: float

    def to_window(self, points_m: FloatArray) -> FloatArray:
        """Map (N, 2) metres to window pixels; NaN stays NaN."""
        points_px: FloatArray = points_m @ self.ground_to_window[:2, :2].T + self.ground_to_window[:2, 2]
        return points_px

    def covers(self, points_m: FloatArray) -> BoolArray:
        """Return (N,) whether each point lies in the window."""
        points_px = self.to_window(points_m)
        return np.asarray(((points_px >= 0) & (points_px <= self.size_px)).all(axis=1))


def window_around(
    points_m: FloatArray, size_px: tuple[int, int], up: FloatArray, *, margin_m: float = 2.0
) -> GroundWindow:
    """Fit a window of a given size around points; height to spare shows more ground at the top.

    Args:
        points_m: (N, 2) ground points to be seen, N > 0, finite.
        size_px: (width, height) of the window.
        up: (2,) ground direction that points up in it.
        margin_m: Ground shown beyond the outermost points.

    >>> window_around(np.array([[0.0, 0.0], [6.0, 6.0]]), (100, 100), np.array([0.0, 1.0])).m_per_px
    0.1
    """
    up = up / np.linalg.norm(up)
    turn = np.array([[up[1], -up[0]], [-up[0], -up[1]]])
    turned = points_m @ turn.T
    low, high = turned.min(axis=0) - margin_m, turned.max(axis=0) + margin_m
    m_per_px = float(((high - low) / size_px).max())
    ground_to_window = np.eye(3)
    ground_to_window[:2, :2] = turn / m_per_px
    centred_x = size_px[0] / 2.0 - (low[0] + high[0]) / 2.0 / m_per_px
    ground_to_window[:2, 2] = centred_x, size_px[1] - high[1] / m_per_px
    return GroundWindow(ground_to_window, size_px, m_per_px)


def seen_ground_m(ground: GroundMap) -> FloatArray:
    """Return (N, 2) ground points that spread over what the camera sees well enough to be worth showing."""
    width, height = ground.image_size_px
    x, y = np.meshgrid(np.linspace(0, width - 1, _GRID), np.linspace(0, height - 1, _GRID))
    pixels = ground.undistorted(np.column_stack([x.ravel(), y.ravel()]))
    if len(ground.valid_px):
        outline = ground.valid_px.astype(np.float32).reshape(-1, 1, 2)
        inside = [bool(np.isfinite(p).all()) and cv2.pointPolygonTest(outline, p.tolist(), False) >= 0 for p in pixels]
        pixels = pixels[inside]
    points_m, valid = homography.apply(ground.image_to_ground, pixels)
    coarseness = np.linalg.norm(homography.point_jacobian(ground.image_to_ground, pixels), axis=(1, 2))
    valid &= coarseness <= _COARSEST_RATIO * np.nanmin(np.where(valid, coarseness, np.nan), initial=np.inf)
    points_m = points_m[valid]
    if not len(points_m):
        return points_m
    low, high = np.percentile(points_m, [_RARE_PERCENT, 100 - _RARE_PERCENT], axis=0)
    common: FloatArray = points_m[((points_m >= low) & (points_m <= high)).all(axis=1)]
    return common


def camera_up(ground: GroundMap) -> FloatArray:
    """Return (2,) the ground direction that leads up in the middle of the lower half of the picture."""
    width, height = ground.image_size_px
    column = np.array([[width / 2.0, 0.75 * height], [width / 2.0, 0.75 * height - 1.0]])
    (start, end), valid = ground.to_ground(column)
    direction: FloatArray = end - start
    return direction if valid.all() and np.linalg.norm(direction) > 0 else np.array([0.0, 1.0])


def rectify(picture: ImageArray, ground: GroundMap, window: GroundWindow, onto: ImageArray) -> None:
    """Warp a frame onto the ground plane.

    Args:
        picture: (H, W, 3) uint8, the frame at any size.
        ground: Its map.
        window: What to show.
        onto: (h, w, 3) uint8 of the window's size, written to where the camera sees the ground.

    Source:
        Paper, section 5.1, Eq. 5.
    """
    x_px, y_px = _picture_points(ground, window, picture.shape[1::-1])
    cv2.remap(picture, x_px, y_px, cv2.INTER_LINEAR, dst=onto, borderMode=cv2.BORDER_TRANSPARENT)


def _picture_points(
    ground: GroundMap, window: GroundWindow, picture_size_px: tuple[int, ...]
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return x and y, (h, w) each, of where every window pixel lies in the picture; far outside where unseen.

    Only a coarse grid goes through map and lens; between its points both are as good as linear for the eye.
    """
    # cv2.resize has its samples in the middle of the cells, and repeats the outermost: one more all around.
    (wide, high), (width, height) = _CELL_PX, window.size_px
    columns, rows = -(-width // wide) + 2, -(-height // high) + 2
    x, y = np.meshgrid((np.arange(columns) - 0.5) * wide - 0.5, (np.arange(rows) - 0.5) * high - 0.5)
    window_to_ground = homography.invert(window.ground_to_window)
    at_image_px, seen = ground.to_image(homography.apply(window_to_ground, np.column_stack([x.ravel(), y.ravel()]))[0])
    at_px = (at_image_px + 0.5) * np.array(picture_size_px) / ground.image_size_px - 0.5
    at_px[~seen] = _OUTSIDE_PX
    grids = at_px.T.reshape(2, rows, columns).astype(np.float32)
    dense_x, dense_y = (cv2.resize(grid, (columns * wide, rows * high)) for grid in grids)
    inside = np.s_[high : high + height, wide : wide + width]
    return dense_x[inside], dense_y[inside]
