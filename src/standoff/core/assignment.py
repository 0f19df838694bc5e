"""Which of these belongs to which of those: optimal assignment."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from standoff.core.homography import FloatArray
from standoff.core.types import IntArray


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
