"""The black of a marker as one closed shape: cells drawn one by one show hairlines of white between them."""

from __future__ import annotations

import numpy as np
from matplotlib.path import Path

from standoff.core.homography import BoolArray

Corner = tuple[int, int]


def black_outline(pattern: BoolArray) -> Path:
    """Return the edges of a marker's black modules, in modules from its lower left corner, y up.

    Args:
        pattern: (n, n), True where white; row 0 is the upper one.
    """
    black = np.pad(~pattern[::-1], 1)
    following: dict[Corner, list[Corner]] = {}
    for row, column in np.argwhere(black).tolist():
        x, y = column - 1, row - 1
        # Counter-clockwise around each module; an edge between two black ones belongs to neither.
        for start, stop, beside in (
            ((x, y), (x + 1, y), black[row - 1, column]),
            ((x + 1, y), (x + 1, y + 1), black[row, column + 1]),
            ((x + 1, y + 1), (x, y + 1), black[row + 1, column]),
            ((x, y + 1), (x, y), black[row, column - 1]),
        ):
            if not beside:
                following.setdefault(start, []).append(stop)
    loops = []
    while following:
        loop = [next(iter(following))]
        while loop[-1] in following:
            stops = following[loop[-1]]
            loop.append(stops.pop())
            if not stops:
                del following[loop[-2]]
        loops.append(Path(np.array(loop, dtype=np.float64), closed=True))
    return Path.make_compound_path(*loops)
