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
from standoff.drawing.ground_shapes import clip_in_front

_GRID = 24
_LENS_STEP_PX = 16
_COARSEST_RATIO = 4.0  # ground metres per pixel over the finest seen: beyond, the rectified picture is a smear
_RARE_PERCENT = 10.0  # of the picture on either side that the window may leave out
_OUTSIDE_PX = -1e4


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

    def coarser(self, times: int) -> GroundWindow:
        """Return a window on the same ground with so many times fewer pixels both ways; the last may stand out."""
        width, height = self.size_px
        fewer = np.diag([1.0 / times, 1.0 / times, 1.0])
        # Pixel centres are whole numbers in both.
        fewer[:2, 2] = 0.5 / times - 0.5
        size_px = -(-width // times), -(-height // times)
        return GroundWindow(fewer @ self.ground_to_window, size_px, times * self.m_per_px)

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
        picture: (H, W, 3) or (H, W) uint8, the frame at any size.
        ground: Its map.
        window: What to show.
        onto: (h, w, 3) or (h, w) uint8 of the window's size, written to where the camera sees the ground.

    Source:
        Paper, section 5.1, Eq. 5.
    """
    window_to_ground = homography.invert(window.ground_to_window)
    window_to_image = homography.invert(ground.image_to_ground) @ window_to_ground
    factor = np.array(picture.shape[1::-1]) / ground.image_size_px
    image_to_picture = np.diag([*factor, 1.0])
    image_to_picture[:2, 2] = (factor - 1.0) / 2.0
    behind = _behind_camera(window_to_image, window.size_px)
    backdrop = onto if behind is None else onto.copy()
    if ground.camera is None:
        cv2.warpPerspective(
            picture,
            image_to_picture @ window_to_image,
            window.size_px,
            dst=onto,
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_TRANSPARENT,
        )
    else:
        at_px = _picture_points(ground, window_to_ground, image_to_picture, onto.shape[:2])
        cv2.remap(picture, at_px, None, cv2.INTER_LINEAR, dst=onto, borderMode=cv2.BORDER_TRANSPARENT)
    if behind is not None:
        onto[behind] = backdrop[behind]


def _behind_camera(window_to_image: FloatArray, size_px: tuple[int, int]) -> BoolArray | None:
    """Return (h, w) what lies behind the camera's own plane, None when the whole window is in front of it."""
    width, height = size_px
    corners = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    depths = corners @ window_to_image[2, :2] + window_to_image[2, 2]
    if (depths > 0).all():
        return None
    front = clip_in_front(window_to_image, corners, 1e-6 * float(np.abs(depths).max()))
    mask = np.ones((height, width), dtype=np.uint8)
    if len(front):
        cv2.fillPoly(mask, [np.round(front).astype(np.int32)], 0)
    return mask.astype(bool)


def _picture_points(
    ground: GroundMap, window_to_ground: FloatArray, image_to_picture: FloatArray, shape: tuple[int, ...]
) -> npt.NDArray[np.float32]:
    """Return (h, w, 2) where every window pixel lies in the picture.

    Only a coarse grid goes through the lens; between its points the lens is as good as linear for the eye.
    """
    height, width = shape
    columns, rows = -(-width // _LENS_STEP_PX) + 1, -(-height // _LENS_STEP_PX) + 1
    x, y = np.meshgrid(np.arange(columns) * _LENS_STEP_PX, np.arange(rows) * _LENS_STEP_PX)
    at_image_px, seen = ground.to_image(homography.apply(window_to_ground, np.column_stack([x.ravel(), y.ravel()]))[0])
    at_image_px[~seen] = 0.0
    at_px, _ = homography.apply(image_to_picture, at_image_px)
    grid = at_px if seen.all() else np.column_stack([at_px, seen])
    # warpAffine with the step as scale keeps grid points on their pixels; cv2.resize would shift them by half a step.
    scale = np.array([[_LENS_STEP_PX, 0.0, 0.0], [0.0, _LENS_STEP_PX, 0.0]])
    dense: npt.NDArray[np.float32] = cv2.warpAffine(
        grid.reshape(rows, columns, -1).astype(np.float32),
        scale,
        (width, height),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    if dense.shape[2] == 2:
        return dense
    dense[dense[:, :, 2] < 1.0] = _OUTSIDE_PX
    return np.ascontiguousarray(dense[:, :, :2])
