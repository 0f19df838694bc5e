"""What a detector saw in a film so far, in parts: small tables of recorded detections beside each other.

A run keeps them while it goes on, and takes those that an earlier one of the same film, settings and files has left.
Other processes may have made some: the looks of a long film, part by part.
"""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np

from standoff.clips.detections import RecordedDetections, read_detections
from standoff.core.errors import DataError
from standoff.core.types import Detections, Frame

_OPEN_PARTS: Final = 4
"""Whoever looks ahead and whoever writes behind are in neighbouring parts."""


def part_path(folder: Path, first: int, last: int) -> Path:
    """Return where a part is kept, by the indices of its first and its last frame.

    >>> part_path(Path("looks"), 0, 249).name
    '000000000-000000249.parquet'
    """
    return folder / f"{first:09d}-{last:09d}.parquet"


class KeptLooks:
    """What was seen in the frames of a film, as far as it is kept.

    Several threads may ask.

    Args:
        folder: Of the parts; it need not be there. What comes into it later is not noticed.
    """

    def __init__(self, folder: Path) -> None:
        self._parts = sorted(folder.glob("[0-9]*-*[0-9].parquet"))
        ends = [[int(end) for end in path.stem.split("-")] for path in self._parts]
        self._first, self._last = np.array(ends, dtype=np.int64).reshape(-1, 2).T
        self._read = lru_cache(_OPEN_PARTS)(_read)

    def __len__(self) -> int:
        """Return how many parts there are."""
        return len(self._parts)

    def of(self, frame: Frame) -> Detections | None:
        """Return what was seen in a frame; None: that is not kept, or was seen at another time of the film."""
        for number in np.flatnonzero((self._first <= frame.index) & (self._last >= frame.index)).tolist():
            recorded = self._read(self._parts[number])
            row = None if recorded is None else recorded.row_of(frame.index)
            if recorded is None or row is None or not recorded.detected[row]:
                continue
            if recorded.size_px == frame.size_px and recorded.is_at(row, frame.time_s):
                return recorded.detections_at(row)
        return None


def _read(path: Path) -> RecordedDetections | None:
    """Return a part; None: it is broken, as a disk that fails may leave it."""
    with suppress(DataError):
        return read_detections(path)
    return None
