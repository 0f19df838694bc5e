"""Which corner in the picture is which corner of the shape?

A homography fits any of the four cyclic orders exactly, so the four points alone cannot tell. What can: a
camera with square pixels must have taken the picture, and only for some orders could it have; the order may not
jump from frame to frame; and the operator may name corner 0 once.
"""

from __future__ import annotations

import numpy as np

from standoff.core.camera import Camera
from standoff.core.compiled import compiled
from standoff.core.homography import FloatArray
from standoff.stages.ground.quadrilateral import ORDERS
from standoff.stages.ground.shape import ReferenceShape

_FOCAL_STEPS = 48
_DIFFERENCE_PX = 1e-3


def camera_misfit_px(
    corners_px: FloatArray,
    shape: ReferenceShape,
    picture_size_px: tuple[int, int],
    focal_widths: tuple[float, float],
    camera: Camera | None = None,
) -> FloatArray:
    """Say for each cyclic order how far the corners would have to move for a camera to see them there.

    The columns of camera^-1 * ground_to_image that belong to the ground's two axes must be perpendicular and
    equally long. The distance to the nearest corners that satisfy this is first order (Sampson). Without a
    calibrated camera the pixels are square, the principal point is the picture's centre, and the focal length
    is the one in the given range that suits the order best.

    Args:
        corners_px: (4, 2) undistorted, counter-clockwise as seen.
        shape: The true shape.
        picture_size_px: (width, height).
        focal_widths: Shortest and longest focal length in picture widths (the longer side); unused with a camera.
        camera: Calibrated camera for pictures of this size.

    Returns:
        (4,) root of the summed squares of all eight coordinates' moves; entry k for corner 0 of the shape at
        corner k of the picture.

    Source:
        Hartley and Zisserman, Multiple View Geometry, 2nd edition, sections 4.2.6 and 8.5.
    """
    width, height = picture_size_px
    if camera is None:
        shortest, longest = focal_widths
        focal = shortest * (longest / shortest) ** np.linspace(0.0, 1.0, _FOCAL_STEPS) * max(width, height)
        centre, focal_xy = np.array([(width - 1) / 2.0, (height - 1) / 2.0]), np.column_stack([focal, focal])
    else:
        centre, focal_xy = camera.matrix[:2, 2], np.array([[camera.matrix[0, 0], camera.matrix[1, 1]]])
    orders = (corners_px - centre)[ORDERS]
    return np.array([_nearest_seen_px(order, shape.corners_m, focal_xy) for order in orders])


@compiled
def _nearest_seen_px(corners_px: FloatArray, corners_m: FloatArray, focal_xy: FloatArray) -> float:
    """Return the misfit of one order at the focal length, one of (F, 2), that suits it best; inf if none does."""
    axes = np.zeros((9, 3, 2))
    _add_ground_axes(corners_m, corners_px, axes[0])
    for k in range(8):
        moved = corners_px.copy()
        moved[k // 2, k % 2] += _DIFFERENCE_PX
        _add_ground_axes(corners_m, moved, axes[1 + k])
    smallest = np.inf
    for f in range(len(focal_xy)):
        skew, stretch = _metric_conditions(axes[0], focal_xy[f, 0], focal_xy[f, 1])
        xx, xy, yy = 0.0, 0.0, 0.0
        for k in range(1, 9):
            moved_skew, moved_stretch = _metric_conditions(axes[k], focal_xy[f, 0], focal_xy[f, 1])
            x, y = (moved_skew - skew) / _DIFFERENCE_PX, (moved_stretch - stretch) / _DIFFERENCE_PX
            xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
        squared = (yy * skew**2 - 2.0 * xy * skew * stretch + xx * stretch**2) / (xx * yy - xy**2)
        if squared < smallest:
            smallest = squared
    misfit: float = np.sqrt(max(smallest, 0.0))
    return misfit


@compiled
def _add_ground_axes(corners_m: FloatArray, corners_px: FloatArray, axes: FloatArray) -> None:
    """Add to (3, 2) the first two columns, at some scale, of the homography from (4, 2) metres to (4, 2) pixels.

    Three corners as columns, each weighted so that they add up to the fourth: the homography is this matrix of the
    pixels times the inverse of that of the metres.
    """
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        weight = _twice_area(corners_px, j, k) / _twice_area(corners_m, j, k)
        by_x, by_y = weight * (corners_m[j, 1] - corners_m[k, 1]), weight * (corners_m[k, 0] - corners_m[j, 0])
        for row, pixel in enumerate((corners_px[i, 0], corners_px[i, 1], 1.0)):
            axes[row, 0] += pixel * by_x
            axes[row, 1] += pixel * by_y


@compiled
def _twice_area(corners: FloatArray, j: int, k: int) -> float:
    """Return that of the triangle of corners 3, j and k, with its sign."""
    jx, jy = corners[j, 0] - corners[3, 0], corners[j, 1] - corners[3, 1]
    kx, ky = corners[k, 0] - corners[3, 0], corners[k, 1] - corners[3, 1]
    area: float = jx * ky - kx * jy
    return area


@compiled
def _metric_conditions(axes: FloatArray, focal_x: float, focal_y: float) -> tuple[float, float]:
    """Return two numbers, both 0 where the camera sees the columns of (3, 2) perpendicular and equally long."""
    one_x, one_y, one_z = axes[0, 0] / focal_x, axes[1, 0] / focal_y, axes[2, 0]
    two_x, two_y, two_z = axes[0, 1] / focal_x, axes[1, 1] / focal_y, axes[2, 1]
    one, two = one_x**2 + one_y**2 + one_z**2, two_x**2 + two_y**2 + two_z**2
    return 2.0 * (one_x * two_x + one_y * two_y + one_z * two_z) / (one + two), (one - two) / (one + two)


def turn_from_before(corners_px: FloatArray, before_px: FloatArray) -> int:
    """Return the cyclic shift that brings corners nearest to an earlier outline, whatever both's place and size.

    Args:
        corners_px: (4, 2) in any cyclic order.
        before_px: (4, 2) in the shape's order.

    >>> square = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]])
    >>> turn_from_before(np.roll(square, 1, axis=0) + 7.0, square)
    1
    """
    now, then = (points - points.mean(axis=0) for points in (corners_px, before_px))
    return int((now[ORDERS] * then).sum(axis=(1, 2)).argmax())
