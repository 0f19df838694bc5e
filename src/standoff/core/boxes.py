"""Areas of axis-parallel boxes, what pairs of them share, wider ones, and points that belong to them."""

from __future__ import annotations

import numpy as np

from standoff.core.homography import FloatArray


def unknown_points(count: int) -> FloatArray:
    """Return (count, 2) points of which nothing is known: NaN.

    >>> unknown_points(1)
    array([[nan, nan]])
    """
    return np.full((count, 2), np.nan)


def areas_px2(xyxy_px: FloatArray) -> FloatArray:
    """Return (N,) the area of each of (N, 4) left, top, right, bottom; negative where a box is inside out.

    >>> areas_px2(np.array([[0.0, 0.0, 2.0, 3.0]]))
    array([6.])
    """
    areas: FloatArray = (xyxy_px[:, 2] - xyxy_px[:, 0]) * (xyxy_px[:, 3] - xyxy_px[:, 1])
    return areas


def shared_px2(first_px: FloatArray, second_px: FloatArray) -> FloatArray:
    """Return (N, M) the area that each of (N, 4) shares with each of (M, 4); 0 where they only touch.

    >>> shared_px2(np.array([[0.0, 0.0, 2.0, 3.0]]), np.array([[1.0, 1.0, 9.0, 9.0], [2.0, 0.0, 3.0, 3.0]]))
    array([[2., 0.]])
    """
    left, top, right, bottom = first_px.T[:, :, None]
    other_left, other_top, other_right, other_bottom = second_px.T[:, None, :]
    width = np.minimum(right, other_right) - np.maximum(left, other_left)
    height = np.minimum(bottom, other_bottom) - np.maximum(top, other_top)
    shared: FloatArray = np.maximum(width, 0.0) * np.maximum(height, 0.0)
    return shared


def overlaps(first_px: FloatArray, second_px: FloatArray) -> FloatArray:
    """Return intersection over union of every pair of boxes.

    Args:
        first_px: (N, 4) left, top, right, bottom.
        second_px: (M, 4).

    Returns:
        (N, M), 0 to 1; 0 where both boxes are empty.

    >>> overlaps(np.array([[0.0, 0.0, 2.0, 1.0]]), np.array([[1.0, 0.0, 3.0, 1.0]])).round(3)
    array([[0.333]])
    """
    shared = shared_px2(first_px, second_px)
    union = areas_px2(first_px)[:, None] + areas_px2(second_px) - shared
    ratio: FloatArray = shared / np.where(union > 0.0, union, 1.0)
    return ratio


def widen(xyxy_px: FloatArray, margin: float) -> FloatArray:
    """Grow boxes on every side by a share of their width and height.

    Two people a step apart between two looks share no pixel; their widened boxes do.

    Args:
        xyxy_px: (N, 4) left, top, right, bottom.
        margin: Share of the width (left, right) and of the height (top, bottom); 0 changes nothing.

    Source:
        Yang et al., Hard to Track Objects with Irregular Motions and Similar Appearances? Make It Easier
        by Buffering the Matching Space (2023), section 3.2.

    >>> widen(np.array([[0.0, 0.0, 10.0, 20.0]]), 0.1)
    array([[-1., -2., 11., 22.]])
    """
    grow = margin * (xyxy_px[:, 2:] - xyxy_px[:, :2])
    return np.concatenate([xyxy_px[:, :2] - grow, xyxy_px[:, 2:] + grow], axis=1)
