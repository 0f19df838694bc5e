"""Which of the ground in a picture is watched, so that a worker who stands there would be found, and why not."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from standoff.core.homography import BoolArray, FloatArray

CellArray = npt.NDArray[np.int8]

ROWS: Final = 18
COLUMNS: Final = 32
"""Cells of a picture, one above another and side by side, whatever its size."""

NO_GROUND: Final = -1
WATCHED: Final = 0
NO_MAP, OUTSIDE_MAP, UNSURE_MAP, TOO_DARK, NO_CONTRAST, BLURRED, TOO_SMALL, BEHIND_MACHINE = range(1, 9)
MAYBE_SOMEBODY: Final = 9
REASONS: Final = (
    "",
    "no ground map",
    "outside the ground map",
    "the map is not sure there",
    "too dark or too noisy",
    "no contrast: fog, or something on the lens",
    "blurred",
    "workers would be too small",
    "behind a machine",
    "somebody may stand there",
)
"""Why ground is not watched, by its number in `WatchedGround.cells`; the first is of ground that is."""


@dataclass(frozen=True, slots=True, eq=False)
class WatchedGround:
    """One picture's cells, each with what is true of the ground in its middle.

    Attributes:
        cells: (ROWS, COLUMNS) `NO_GROUND` where the picture shows none, `WATCHED`, or the number of the first of
            `REASONS` for which it is not; (0, 0) where nobody judged.
        found_share: (ROWS, COLUMNS) of the workers who stand there, how many are noticed; NaN where the ground is not
            watched.
        around: (M,) of the ground about each track within the radii in which a worker counts as in danger, what share
            is watched; NaN of what is no machine, and where it has no place.
        suspects: (M,) whether somebody whom no track shows may stand within those radii of it, on no machine.
    """

    cells: CellArray = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int8))
    found_share: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    around: FloatArray = field(default_factory=lambda: np.zeros(0))
    suspects: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))

    def __post_init__(self) -> None:
        kinds = {"cells": np.int8, "found_share": np.float64, "around": np.float64, "suspects": np.bool_}
        for name, kind in kinds.items():
            array: npt.NDArray[np.generic] = np.array(getattr(self, name), dtype=kind)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.cells.shape not in ((0, 0), (ROWS, COLUMNS)) or self.found_share.shape != self.cells.shape:
            raise ValueError(f"WatchedGround has cells {self.cells.shape}, shares {self.found_share.shape}")

    @property
    def judged(self) -> bool:
        """Whether anybody looked."""
        return self.cells.size > 0

    @property
    def watched(self) -> BoolArray:
        """(ROWS, COLUMNS) where a worker would be found."""
        return np.asarray(self.cells == WATCHED)

    @property
    def share(self) -> float:
        """Part of the picture's ground that is watched; 0 where it shows none, NaN where nobody judged."""
        if not self.judged:
            return float("nan")
        ground = np.count_nonzero(self.cells != NO_GROUND)
        return float(np.count_nonzero(self.watched) / ground) if ground else 0.0

    @property
    def unwatched(self) -> dict[str, float]:
        """Part of the picture's ground by the reason why it is not watched, largest first."""
        counts = np.bincount(self.cells.ravel() - NO_GROUND)
        ground = max(counts[WATCHED - NO_GROUND :].sum(), 1)
        unwatched = counts[WATCHED + 1 - NO_GROUND :]
        order = np.argsort(-unwatched, kind="stable")
        return {REASONS[WATCHED + 1 + k]: float(unwatched[k] / ground) for k in order.tolist() if unwatched[k]}

    @property
    def missed_share(self) -> float:
        """Of the workers who stand on watched ground, how many are missed in one picture; NaN where none is watched."""
        return float(1.0 - self.found_share[self.watched].mean()) if self.watched.any() else float("nan")


def cells_at(watched: WatchedGround, points_px: FloatArray, size_px: tuple[int, int]) -> CellArray:
    """Return (N,) what is true of the ground under points: `WATCHED`, `NO_GROUND`, or the number of a reason.

    Args:
        watched: That somebody judged.
        points_px: (N, 2) in the picture; outside of it, and where they are not finite, is no ground.
        size_px: (width, height) of the picture.
    """
    cells, inside = cell_of(points_px, size_px)
    if not watched.judged:
        return np.full(len(points_px), NO_GROUND, dtype=np.int8)
    return np.where(inside, watched.cells[cells[:, 0], cells[:, 1]], NO_GROUND).astype(np.int8)


def cell_of(points_px: FloatArray, size_px: tuple[int, int]) -> tuple[npt.NDArray[np.int64], BoolArray]:
    """Return in which cell each point lies.

    Args:
        points_px: (N, 2) in the picture; those that are not finite are outside.
        size_px: (width, height) of the picture.

    Returns:
        (N, 2) row and column, and (N,) whether the point is in the picture; row and column are 0 where it is not.

    >>> cell_of(np.array([[0.0, 0.0], [639.0, 359.0], [640.0, 10.0]]), (640, 360))
    (array([[ 0,  0],
           [17, 31],
           [ 0,  0]]), array([ True,  True, False]))
    """
    parts = (points_px + 0.5) / np.array(size_px)
    inside: BoolArray = ((parts >= 0.0) & (parts < 1.0)).all(axis=1)
    places = np.where(inside[:, None], parts, 0.0)[:, ::-1] * np.array([ROWS, COLUMNS])
    return places.astype(np.int64), inside


@lru_cache(maxsize=16)
def cell_middles_px(size_px: tuple[int, int]) -> FloatArray:
    """Return (ROWS * COLUMNS, 2) the middles of the cells of a picture, row by row; read-only."""
    width_px, height_px = size_px
    y, x = np.mgrid[:ROWS, :COLUMNS] + 0.5
    middles_px = np.column_stack([x.ravel() * width_px / COLUMNS, y.ravel() * height_px / ROWS]) - 0.5
    middles_px.setflags(write=False)
    return middles_px
