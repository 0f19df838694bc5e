"""Which box of a run shows which thing that is really there."""

from __future__ import annotations

import numpy as np

from standoff.core.assignment import assign
from standoff.core.boxes import overlaps
from standoff.core.homography import FloatArray
from standoff.core.roles import ROLE_OF_CLASS
from standoff.core.types import IntArray

MIN_OVERLAP = 0.3
"""Smallest IoU of a box with the truth's for the two to be the same thing."""

NOTHING = -1
"""In place of a row where there is none."""


def match_boxes(true_px: FloatArray, true_class: IntArray, seen_px: FloatArray, seen_class: IntArray) -> IntArray:
    """Match what is really in one picture with what was said to be there, one to one, by the overlap of boxes.

    A machine taken for another kind of machine is the same thing; one taken for a person is not.

    Args:
        true_px: (N, 4) left, top, right, bottom of the visible part; NaN where nothing can be seen.
        true_class: (N,) ids of `CLASSES`.
        seen_px: (M, 4).
        seen_class: (M,) ids of `CLASSES`.

    Returns:
        (N,) row of the box that shows each thing, or NOTHING.

    >>> match_boxes(np.array([[0.0, 0.0, 2.0, 2.0]]), np.array([1]), np.array([[0.0, 0.0, 2.0, 1.0]]), np.array([2]))
    array([0])
    """
    row_of = np.full(len(true_px), NOTHING)
    visible = np.flatnonzero(np.isfinite(true_px).all(axis=1))
    similarity = overlaps(true_px[visible], seen_px)
    similarity *= ROLE_OF_CLASS[true_class[visible]][:, None] == ROLE_OF_CLASS[seen_class]
    first, second = assign(similarity, MIN_OVERLAP)
    row_of[visible[first]] = second
    return row_of
