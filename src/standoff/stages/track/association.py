"""Which detection belongs to which track: overlap and optimal assignment."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from standoff.core.homography import FloatArray
from standoff.core.types import IntArray


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
    left, top, right, bottom = first_px.T[:, :, None]
    other_left, other_top, other_right, other_bottom = second_px.T[:, None, :]
    width = np.minimum(right, other_right) - np.maximum(left, other_left)
    height = np.minimum(bottom, other_bottom) - np.maximum(top, other_top)
    shared = np.maximum(width, 0.0) * np.maximum(height, 0.0)
    union = (right - left) * (bottom - top) + (other_right - other_left) * (other_bottom - other_top) - shared
    ratio: FloatArray = shared / np.where(union > 0.0, union, 1.0)
    return ratio


def assign(similarity: FloatArray, at_least: float) -> tuple[IntArray, IntArray]:
    """Pair rows with columns so that the sum of similarities is largest.

    Pairs below the limit do not take part at all, so a hopeless pair never displaces a good one.

    Args:
        similarity: (N, M), not negative.
        at_least: Smallest similarity of a pair, above 0.

    Returns:
        Row and column indices (K,) of the pairs.

    >>> assign(np.array([[0.9, 0.8], [0.8, 0.0]]), 0.3)
    (array([0, 1]), array([1, 0]))
    """
    possible = np.where(similarity >= at_least, similarity, 0.0)
    rows, columns = linear_sum_assignment(possible, maximize=True)
    paired = possible[rows, columns] > 0.0
    return rows[paired], columns[paired]
