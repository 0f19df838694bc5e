"""Which detection belongs to which track: widened boxes and optimal assignment."""

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
