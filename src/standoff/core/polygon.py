"""Which points lie inside a polygon, and how far from its outline."""

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
    return within(sides(polygon), points)


def sides(polygon: FloatArray) -> FloatArray:
    """Return (V, 2, 2) the begin and end of each side of a polygon (V, 2) that does not repeat its first corner."""
    return np.stack([polygon, np.roll(polygon, -1, axis=0)], axis=1)


def within(outline: FloatArray, points: FloatArray) -> BoolArray:
    """Tell which points lie inside an outline of one or more rings, by the even-odd rule: a ring in a ring is a hole.

    Args:
        outline: (E, 2, 2) begin and end of every side, in any order.
        points: (N, 2) in the same units.

    Returns:
        (N,) as `inside`.
    """
    finite = np.isfinite(points).all(axis=1, keepdims=True)
    x, y = np.where(finite, points, np.nan).T[:, :, None]
    (start_x, start_y), (end_x, end_y) = outline.transpose(1, 2, 0)
    straddles = (start_y > y) != (end_y > y)
    rise = np.where(start_y == end_y, np.nan, end_y - start_y)
    crossing_x = start_x + (y - start_y) * (end_x - start_x) / rise
    to_the_right: BoolArray = np.count_nonzero(straddles & (x < crossing_x), axis=1) % 2 == 1
    return to_the_right


def nearest_on(outline: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find the nearest place on an outline.

    Args:
        outline: (E, 2, 2) begin and end of every side, in any order; E >= 1.
        points: (N, 2) in the same units.

    Returns:
        (N,) distances, and (N, 2) unit vectors from the outline to the points; square to the side for a point on it.
        Rows of NaN for points that are not finite.

    >>> nearest_on(sides(np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])), np.array([[6.0, 1.0]]))
    (array([2.]), array([[1., 0.]]))
    """
    start, along = outline[:, 0], outline[:, 1] - outline[:, 0]
    squared = (along**2).sum(axis=1)
    from_start = points[:, None] - start
    share = np.clip((from_start * along).sum(axis=2) / np.where(squared > 0, squared, 1.0), 0.0, 1.0)
    away = from_start - share[:, :, None] * along
    apart = np.linalg.norm(away, axis=2)
    rows = np.arange(len(points))
    best = np.where(np.isnan(apart), np.inf, apart).argmin(axis=1)
    distance, direction = apart[rows, best], away[rows, best]
    square = along[best][:, ::-1] * (1.0, -1.0)
    direction = np.where(distance[:, None] > 0, direction, square)
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    unit: FloatArray = direction / np.where(length > 0, length, 1.0)
    return distance, np.where(np.isnan(distance)[:, None], np.nan, unit)
