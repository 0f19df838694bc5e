"""Which points lie inside a polygon."""

from __future__ import annotations

import numpy as np

from standoff.core.homography import BoolArray, FloatArray


def inside(polygon: FloatArray, points: FloatArray) -> BoolArray:
    """Tell which points lie inside a polygon by the even-odd rule.

    Args:
        polygon: (V, 2) corners in order, either way round; it may be concave.
        points: (N, 2) in the same units.

    Returns:
        (N,); False for points that are not finite. A point exactly on the outline may be either.

    >>> inside(np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]), np.array([[1.0, 1.0], [3.0, 3.0]]))
    array([ True, False])
    """
    finite = np.isfinite(points).all(axis=1, keepdims=True)
    x, y = np.where(finite, points, np.nan).T[:, :, None]
    start_x, start_y = polygon.T
    end_x, end_y = np.roll(polygon, -1, axis=0).T
    straddles = (start_y > y) != (end_y > y)
    rise = np.where(start_y == end_y, np.nan, end_y - start_y)
    crossing_x = start_x + (y - start_y) * (end_x - start_x) / rise
    to_the_right: BoolArray = np.count_nonzero(straddles & (x < crossing_x), axis=1) % 2 == 1
    return to_the_right
