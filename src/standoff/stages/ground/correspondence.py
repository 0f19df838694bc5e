"""Which corner in the picture is which corner of the shape?

A homography fits any of the four cyclic orders exactly, so the four points alone cannot tell. What can: a
camera with square pixels must have taken the picture, and only for some orders could it have; the order may not
jump from frame to frame; and the operator may name corner 0 once.
"""

from __future__ import annotations

import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
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
        focal = np.geomspace(*focal_widths, _FOCAL_STEPS) * max(width, height)
        centre, focal_xy = np.array([(width - 1) / 2.0, (height - 1) / 2.0]), np.column_stack([focal, focal])
    else:
        centre, focal_xy = camera.matrix[:2, 2], np.array([[camera.matrix[0, 0], camera.matrix[1, 1]]])
    moved = np.tile(corners_px - centre, (9, 1, 1))
    moved[1:] += _DIFFERENCE_PX * np.eye(8).reshape(8, 4, 2)
    orders = np.stack([np.roll(moved, -turn, axis=1) for turn in range(4)])
    axes = _ground_axes(shape.corners_m, orders)
    conditions = _metric_conditions(
        axes[:, :, None] / np.append(focal_xy, np.ones((len(focal_xy), 1)), axis=1)[..., None]
    )
    here = conditions[:, 0]
    slopes = np.moveaxis((conditions[:, 1:] - here[:, None]) / _DIFFERENCE_PX, 1, -1)
    normal = slopes @ np.swapaxes(slopes, -1, -2)
    squared = np.einsum("ofi,ofi->of", here, np.linalg.solve(normal, here[..., None])[..., 0])
    misfit: FloatArray = np.sqrt(np.maximum(squared, 0.0)).min(axis=1)
    return misfit


def _ground_axes(corners_m: FloatArray, corners_px: FloatArray) -> FloatArray:
    """Return (..., 3, 2): the first two columns of the homographies from metres to (..., 4, 2) pixels."""
    scale = float(np.ptp(corners_m))
    x, y = (corners_m - corners_m.mean(axis=0)).T / scale
    rows = np.zeros((*corners_px.shape[:-2], 8, 8))
    rows[..., :4, 0], rows[..., :4, 1], rows[..., :4, 2] = x, y, 1.0
    rows[..., 4:, 3], rows[..., 4:, 4], rows[..., 4:, 5] = x, y, 1.0
    for half, axis in ((slice(0, 4), 0), (slice(4, 8), 1)):
        rows[..., half, 6], rows[..., half, 7] = -corners_px[..., axis] * x, -corners_px[..., axis] * y
    target = np.concatenate([corners_px[..., 0], corners_px[..., 1]], axis=-1)
    solution = np.linalg.solve(rows, target[..., None])[..., 0]
    axes: FloatArray = np.stack([solution[..., [0, 3, 6]], solution[..., [1, 4, 7]]], axis=-1)
    return axes


def _metric_conditions(axes: FloatArray) -> FloatArray:
    """Return (..., 2), both 0 where the two columns of (..., 3, 2) are perpendicular and equally long."""
    first, second = axes[..., 0], axes[..., 1]
    one, two = (first**2).sum(axis=-1), (second**2).sum(axis=-1)
    conditions: FloatArray = (
        np.stack([2.0 * (first * second).sum(axis=-1), one - two], axis=-1) / (one + two)[..., None]
    )
    return conditions


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
    agreement = [float((np.roll(now, -turn, axis=0) * then).sum()) for turn in range(4)]
    return int(np.argmax(agreement))
