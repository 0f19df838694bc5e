"""Parts of the site with a rule of their own: who may be in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.polygon import nearest_on, sides, within

ZoneKind = Literal["no_go", "machine_only", "crossing"]
ZONE_KINDS: tuple[ZoneKind, ...] = get_args(ZoneKind)

ZONE_WORDS: dict[ZoneKind, str] = {
    "no_go": "no go",
    "machine_only": "machines only",
    "crossing": "workers or machines",
}
"""What a kind is called in pictures."""

NOT_PLACED = "nobody stated where the site frame lies"
"""Why zones cannot be found in a ground map."""

Ring = FloatArray
"""(V, 2) corners in order, the first one not repeated; m, site frame."""


@dataclass(frozen=True, slots=True, eq=False)
class Zone:
    """Polygons on the ground, with or without holes.

    Attributes:
        name: Unique on its site.
        kind: `no_go`: nobody and no machine; `machine_only`: no worker; `crossing`: workers and machines, but never
            both at the same time.
        polygons_m: Rings of each polygon, its outer one first, then its holes. Rings do not cross, holes lie in their
            polygon, and no polygon in another; the caller has made sure of that. Here outer rings are turned
            counter-clockwise seen from above and holes clockwise.
        outline_m: (E, 2, 2) begin and end of every side of every ring.
    """

    name: str
    kind: ZoneKind
    polygons_m: Sequence[Sequence[Ring]]
    outline_m: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        turned = tuple(
            tuple(_turned(ring, counter_clockwise=k == 0) for k, ring in enumerate(polygon))
            for polygon in self.polygons_m
        )
        outline = np.concatenate([sides(ring) for polygon in turned for ring in polygon])
        outline.setflags(write=False)
        object.__setattr__(self, "polygons_m", turned)
        object.__setattr__(self, "outline_m", outline)

    @property
    def rings_m(self) -> list[Ring]:
        """All rings, holes too."""
        return [ring for polygon in self.polygons_m for ring in polygon]

    @property
    def title(self) -> str:
        """What it is called in pictures: its name and who may be in it."""
        return f"{self.name}: {ZONE_WORDS[self.kind]}"

    def contains(self, points_m: FloatArray) -> BoolArray:
        """Tell (N,) which points (N, 2) lie in it; False for points that are not finite.

        >>> square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
        >>> zone = Zone("yard", "no_go", [[square, square / 4.0 + 1.0]])
        >>> zone.contains(np.array([[3.0, 3.0], [1.5, 1.5], [5.0, 1.0]]))
        array([ True, False, False])
        """
        return within(self.outline_m, points_m)

    def gap_m(self, points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far points lie from it.

        Args:
            points_m: (N, 2) site frame.

        Returns:
            (N,) metres to its outline, negative inside, and (N, 2) the horizontal direction, a unit vector, along which
            that changes; rows of NaN for points that are not finite.
        """
        distance_m, direction = nearest_on(self.outline_m, points_m)
        return np.where(self.contains(points_m), -distance_m, distance_m), direction


def ring_area(ring_m: Ring) -> float:
    """Return the area of a ring in its own unit, positive where it goes counter-clockwise seen from above.

    >>> ring_area(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 3.0], [0.0, 3.0]]))
    6.0
    """
    # From its first corner: far from the origin the products would lose the area in their rounding.
    x, y = (ring_m - ring_m[0]).T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2.0)


def ring_middle(ring: Ring) -> FloatArray:
    """Return (2,) the centre of gravity of a ring's area, in its own unit; of one without an area the mean corner.

    >>> ring_middle(np.array([[0.0, 0.0], [6.0, 0.0], [0.0, 3.0]]))
    array([2., 1.])
    """
    from_first = ring - ring[0]
    x, y = from_first.T
    next_x, next_y = np.roll(x, -1), np.roll(y, -1)
    twice = x * next_y - next_x * y
    if not abs(twice.sum()) > 0:
        return np.asarray(ring.mean(axis=0))
    weighted = np.array([((x + next_x) * twice).sum(), ((y + next_y) * twice).sum()])
    return np.asarray(ring[0] + weighted / (3.0 * twice.sum()))


def _turned(ring_m: Ring, *, counter_clockwise: bool) -> Ring:
    ring = np.array(ring_m, dtype=np.float64).reshape(-1, 2)
    if (ring_area(ring) > 0) != counter_clockwise:
        ring = ring[::-1].copy()
    ring.setflags(write=False)
    return ring
