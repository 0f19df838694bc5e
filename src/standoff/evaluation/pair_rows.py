"""Find pairs in tables that have one row for each pair in each frame."""

from __future__ import annotations

import numpy as np

from standoff.clips import Columns
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.evaluation.matching import NOTHING

PAIR_COLUMNS = ("frame", "track_a", "track_b", "distance_m", "sigma_m", "measured")
"""Of a run's proximity table, what `distances_of` needs."""


class PairRows:
    """The rows of a table by frame and by both ends of a pair, whichever end is named first.

    Args:
        frame: (N,) of each row.
        first: (N,) id of one end.
        second: (N,) id of the other.

    >>> rows = PairRows(np.array([0, 1]), np.array([7, 7]), np.array([9, 9]))
    >>> rows.find(np.array([1, 1]), np.array([9, 9]), np.array([7, 8])).tolist()
    [1, -1]
    """

    def __init__(self, frame: IntArray, first: IntArray, second: IntArray) -> None:
        self._frames, self._ids = np.unique(frame), np.unique(np.concatenate([first, second]))
        keys, _ = self._keys(frame, first, second)
        self._order = np.argsort(keys, kind="stable")
        self._keys_in_order = keys[self._order]

    def find(self, frame: IntArray, first: IntArray, second: IntArray) -> IntArray:
        """Return (M,) the row of each pair in its frame, NOTHING where the table has none."""
        keys, known = self._keys(frame, first, second)
        place = _places(self._keys_in_order, keys)
        known &= place != NOTHING
        rows = np.full(len(keys), NOTHING)
        rows[known] = self._order[place[known]]
        return rows

    def _keys(self, frame: IntArray, first: IntArray, second: IntArray) -> tuple[IntArray, BoolArray]:
        """Return one number for each pair in its frame, and whether frame and ends are known at all."""
        places = np.array([_places(self._frames, frame), _places(self._ids, first), _places(self._ids, second)])
        low, high = np.sort(places[1:], axis=0)
        count = len(self._ids)
        return (places[0] * count + low) * count + high, (places != NOTHING).all(axis=0)


def distances_of(
    pairs: Columns, frame: IntArray, first: IntArray, second: IntArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Look up what a run measured between pairs of tracks.

    Args:
        pairs: The `PAIR_COLUMNS` of the run's proximity table.
        frame: (M,) index of the run's frame.
        first: (M,) id of one track; NOTHING where there is none.
        second: (M,) id of the other.

    Returns:
        (M,) distances and their standard errors, NaN where not measured, and whether the table has the pair at all.
    """
    row = PairRows(pairs["frame"], pairs["track_a"], pairs["track_b"]).find(frame, first, second)
    listed = row != NOTHING
    found = np.full((2, len(row)), np.nan)
    known = pairs["measured"].astype(np.bool_)
    found[:, listed] = [np.where(known, pairs[name], np.nan)[row[listed]] for name in ("distance_m", "sigma_m")]
    return found[0], found[1], listed


def _places(rising: IntArray, values: IntArray) -> IntArray:
    """Return where each value stands in a rising series, NOTHING where it does not."""
    if not len(rising):
        return np.full(len(values), NOTHING)
    place = np.minimum(np.searchsorted(rising, values), len(rising) - 1)
    return np.where(rising[place] == values, place, NOTHING)
