"""How large a target is, and how it is cut into sheets of paper. Millimetres, x to the right, y up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil
from types import MappingProxyType
from typing import Literal, get_args

from standoff.core.errors import ConfigError
from standoff.core.homography import BoolArray
from standoff.stages.ground import MarkerFamily, marker_pattern

Paper = Literal["A4", "A3", "A2", "A1", "A0", "letter", "tabloid", "single"]
PAPERS: tuple[Paper, ...] = get_args(Paper)

SIZE_LIMITS_M = (0.1, 3.5)
"""Below it the notes beside the marker would not fit; above it a single page is larger than PDF can say."""

OVERLAP_MM = 10.0
MARGIN_MM = 12.0
"""Around what is printed to size; office printers leave 4 to 6 mm white, the notes stand on the rest."""

_STRIP_LEAST_MM = 12.0
_STRIP_MODULES = 0.25
_PAPER_MM: Mapping[str, tuple[float, float]] = MappingProxyType({
    "A4": (210.0, 297.0), "A3": (297.0, 420.0), "A2": (420.0, 594.0), "A1": (594.0, 841.0), "A0": (841.0, 1189.0),
    "letter": (215.9, 279.4), "tabloid": (279.4, 431.8),
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Target:
    """One marker on white ground.

    From the inside out: the black square of `size_m`, one module of plain white that detection needs, a strip of
    white with arrows, corner numbers and what the target is.

    Attributes:
        size_m: Side of the black square, outer edge to outer edge.
        marker_id: Within its family.
        family: Of the marker.
    """

    size_m: float
    marker_id: int = 0
    family: MarkerFamily = "apriltag36h11"

    def __post_init__(self) -> None:
        low_m, high_m = SIZE_LIMITS_M
        if not low_m <= self.size_m <= high_m:
            raise ConfigError(
                expected=f"a black square of {low_m:g} to {high_m:g} m",
                found=f"{self.size_m:g} m",
                fix="choose a size in between",
            )
        marker_pattern(self.family, self.marker_id)

    @property
    def pattern(self) -> BoolArray:
        """(n, n) modules, True where white; row 0 is the upper one."""
        return marker_pattern(self.family, self.marker_id)

    @property
    def size_mm(self) -> float:
        """Side of the black square."""
        return self.size_m * 1000.0

    @property
    def module_mm(self) -> float:
        """Side of one module."""
        return self.size_mm / len(self.pattern)

    @property
    def strip_mm(self) -> float:
        """Width of the outermost strip, the one with the notes."""
        return max(_STRIP_LEAST_MM, _STRIP_MODULES * self.module_mm)

    @property
    def edge_mm(self) -> float:
        """How far the white goes beyond the black square."""
        return self.module_mm + self.strip_mm

    @property
    def whole_mm(self) -> float:
        """Side of the whole target, white included."""
        return self.size_mm + 2.0 * self.edge_mm


@dataclass(frozen=True, slots=True)
class Tile:
    """What one sheet of paper shows of a target.

    Attributes:
        row: From 0, the uppermost.
        column: From 0, the leftmost.
        paper_mm: Width and height of the paper.
        left_mm: Where on the target the printed part begins, from its lower left corner.
        bottom_mm: As `left_mm`.
        shown_mm: Width and height of the printed part.
        has_right: Whether another sheet goes on the right, over the overlap.
        has_below: Whether another sheet goes below.
    """

    row: int
    column: int
    paper_mm: tuple[float, float]
    left_mm: float
    bottom_mm: float
    shown_mm: tuple[float, float]
    has_right: bool
    has_below: bool


def paper_mm(paper: Paper, target: Target) -> tuple[float, float]:
    """Return width and height of the paper; of a `single` page, those of the target."""
    return (target.whole_mm, target.whole_mm) if paper == "single" else _PAPER_MM[paper]


def tiles(target: Target, paper: Paper) -> tuple[Tile, ...]:
    """Cut a target into sheets, row by row from the upper left, upright or turned, whichever needs fewer.

    >>> len(tiles(Target(1.2), "A4"))
    54
    """
    if paper not in PAPERS:
        raise ConfigError(expected=f"a paper, one of {', '.join(PAPERS)}", found=repr(paper), fix="choose one of them")
    width, height = paper_mm(paper, target)
    if paper == "single":
        whole = (target.whole_mm, target.whole_mm)
        return (Tile(0, 0, whole, 0.0, 0.0, whole, has_right=False, has_below=False),)
    return min((_cut(target, (width, height)), _cut(target, (height, width))), key=len)


def _cut(target: Target, paper: tuple[float, float]) -> tuple[Tile, ...]:
    room = tuple(side - 2.0 * MARGIN_MM for side in paper)
    whole = target.whole_mm
    columns, rows = (max(1, ceil((whole - OVERLAP_MM) / (side - OVERLAP_MM) - 1e-9)) for side in room)
    # Sheets share the target evenly, so that no strip of a few millimetres is left for the last one.
    width, height = ((whole + (count - 1) * OVERLAP_MM) / count for count in (columns, rows))
    return tuple(
        Tile(
            row,
            column,
            paper,
            column * (width - OVERLAP_MM),
            whole - height - row * (height - OVERLAP_MM),
            (width, height),
            has_right=column < columns - 1,
            has_below=row < rows - 1,
        )
        for row in range(rows)
        for column in range(columns)
    )
