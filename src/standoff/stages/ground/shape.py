"""The reference object's true shape: the corners of a convex polygon in metres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray

_FEWEST, _MOST = 3, 12
"""Corners. With more of them the sides of a footing get too short to be told from a curve."""

_MIN_SINE = 1e-3
"""Three corners whose angle has a smaller sine count as collinear: 0.06 degrees."""

_POLYGON = f"{_FEWEST} to {_MOST} corners of a convex polygon in metres"

_SAME_LENGTH = 0.01
"""Lengths that differ by less than one per cent count as the same when the shape is turned onto itself."""


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceShape:
    """A convex polygon lying on the ground.

    Attributes:
        corners_m: (N, 2) in the site frame, N from 3 to 12, counter-clockwise seen from above; side k runs from
            corner k to corner k + 1. The constructors from lengths put corner 0 at the origin and x along side 0.
    """

    corners_m: FloatArray

    def __post_init__(self) -> None:
        corners = np.array(self.corners_m, dtype=np.float64)
        _check_corners(corners)
        if _turns(corners)[0] < 0:
            corners = np.roll(corners[::-1], 1, axis=0)
        corners.setflags(write=False)
        object.__setattr__(self, "corners_m", corners)

    @classmethod
    def from_corners(cls, xy_m: Sequence[Sequence[float]] | FloatArray) -> Self:
        """Take known corner coordinates; they define the site frame.

        Args:
            xy_m: (N, 2), one after another around the shape, x east and y north or any other right-handed
                pair. A clockwise list is turned around; the first corner stays the first.

        Raises:
            GroundError: Not three to twelve finite corners of a convex polygon.
        """
        try:
            corners = np.array(xy_m, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise _corners_error("pairs of numbers", f"{xy_m!r}") from error
        return cls(corners)

    @classmethod
    def from_sides(cls, sides_m: Sequence[float], diagonal_m: float) -> Self:
        """Build a convex quadrilateral from a tape measure's five lengths.

        Args:
            sides_m: Four side lengths, counter-clockwise seen from above, starting at corner 0.
            diagonal_m: Length from corner 0 (where side 0 starts) to corner 2 (where side 1 ends).

        Raises:
            GroundError: The lengths do not make a convex quadrilateral.

        >>> ReferenceShape.from_sides((3.0, 4.0, 3.0, 4.0), diagonal_m=5.0).corners_m.round(6).tolist()
        [[0.0, 0.0], [3.0, 0.0], [3.0, 4.0], [0.0, 4.0]]
        """
        lengths = np.array([*sides_m, diagonal_m], dtype=np.float64)
        if lengths.shape != (5,) or not np.isfinite(lengths).all() or (lengths <= 0).any():
            raise _shape_error("four side lengths and one diagonal, all above 0 m", f"{lengths.tolist()}")
        a, b, c, d, e = lengths.tolist()
        for first, second in ((a, b), (d, c)):
            if first + second <= e or abs(first - second) >= e:
                raise _shape_error(
                    "sides that close a triangle with the diagonal from corner 0 to corner 2",
                    f"sides {first:g} m and {second:g} m with a diagonal of {e:g} m",
                )
        towards_2 = np.arccos((a * a + e * e - b * b) / (2.0 * a * e))
        towards_3 = towards_2 + np.arccos((d * d + e * e - c * c) / (2.0 * d * e))
        angles, radii = np.array([0.0, towards_2, towards_3]), np.array([a, e, d])
        corners = np.zeros((4, 2))
        corners[1:] = radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        return cls(corners)

    @classmethod
    def square(cls, side_m: float) -> Self:
        """Build a square, the paper's footing (2.89 m).

        Raises:
            GroundError: The side is not a length.
        """
        return cls.rectangle(side_m, side_m)

    @classmethod
    def rectangle(cls, width_m: float, length_m: float) -> Self:
        """Build a rectangle whose first side, along x, is `width_m` long.

        Raises:
            GroundError: A side is not a length.
        """
        if not (np.isfinite([width_m, length_m]).all() and width_m > 0 and length_m > 0):
            raise _shape_error("side lengths above 0 m", f"{width_m:g} m and {length_m:g} m")
        return cls(np.array([[0.0, 0.0], [width_m, 0.0], [width_m, length_m], [0.0, length_m]]))

    @classmethod
    def regular(cls, count: int, side_m: float) -> Self:
        """Build a regular polygon, such as an octagonal footing.

        Args:
            count: Number of its sides.
            side_m: Length of each.

        Raises:
            GroundError: The side is not a length, or there are too few or too many.

        >>> (ReferenceShape.regular(4, 2.0).corners_m.round(6) + 0.0).tolist()
        [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
        """
        if not (np.isfinite(side_m) and side_m > 0):
            raise _shape_error("a side length above 0 m", f"{side_m:g} m")
        if not _FEWEST <= count <= _MOST:
            raise _corners_error(_POLYGON, f"{count} of them")
        angles = 2.0 * np.pi * np.arange(count) / count
        ends = np.cumsum(side_m * np.column_stack([np.cos(angles), np.sin(angles)]), axis=0)
        return cls(np.roll(ends - ends[-1], 1, axis=0))

    @property
    def sides_m(self) -> FloatArray:
        """(N,) lengths; side k runs from corner k to corner k + 1."""
        lengths: FloatArray = np.linalg.norm(np.roll(self.corners_m, -1, axis=0) - self.corners_m, axis=1)
        return lengths

    def at_height(self, height_m: float) -> FloatArray:
        """Return (N, 3) the corners on a level plane."""
        places = np.empty((len(self.corners_m), 3))
        places[:, :2], places[:, 2] = self.corners_m, height_m
        return places

    def turns_onto_itself(self) -> tuple[int, ...]:
        """Return the cyclic shifts of the corners that change no distance: (0, 1, 2, 3) for a square.

        >>> ReferenceShape.rectangle(2.0, 3.0).turns_onto_itself()
        (0, 2)
        """
        distances = np.linalg.norm(self.corners_m[:, None] - self.corners_m[None], axis=2)
        shifted = [np.roll(distances, (-turn, -turn), axis=(0, 1)) for turn in range(len(distances))]
        same = [np.allclose(one, distances, rtol=_SAME_LENGTH, atol=0.0) for one in shifted]
        return tuple(np.flatnonzero(same).tolist())


def _turns(corners: FloatArray) -> FloatArray:
    """Return the sine of the turn at each corner, positive to the left."""
    sides = np.roll(corners, -1, axis=0) - corners
    sides = sides / np.linalg.norm(sides, axis=1)[:, None]
    before = np.roll(sides, 1, axis=0)
    sines: FloatArray = before[:, 0] * sides[:, 1] - before[:, 1] * sides[:, 0]
    return sines


def _check_corners(corners: FloatArray) -> None:
    if corners.ndim != 2 or corners.shape[1] != 2 or not _FEWEST <= len(corners) <= _MOST:
        raise _corners_error(_POLYGON, f"an array of shape {corners.shape}")
    if not np.isfinite(corners).all():
        raise _corners_error(_POLYGON, "a coordinate that is not a finite number")
    sides = np.roll(corners, -1, axis=0) - corners
    if (np.linalg.norm(sides, axis=1) == 0).any():
        raise _corners_error(_POLYGON, "two corners at the same place")
    turns = _turns(corners)
    if (np.abs(turns) < _MIN_SINE).any():
        raise _corners_error(_POLYGON, "three corners on one line")
    heading = np.arctan2(sides[:, 1], sides[:, 0])
    turned = np.mod(heading - np.roll(heading, 1) + np.pi, 2.0 * np.pi) - np.pi
    if not np.isclose(abs(turned.sum()), 2.0 * np.pi):
        raise _corners_error(_POLYGON, "sides that cross each other")
    if 0 < (turns > 0).sum() < len(turns):
        raise _corners_error(_POLYGON, "a corner that points inwards")


def _corners_error(expected: str, found: str) -> GroundError:
    return GroundError(
        expected=f"a reference shape of {expected}",
        found=found,
        fix="go around the reference from corner to corner, always the same way round",
    )


def _shape_error(expected: str, found: str) -> GroundError:
    return GroundError(
        expected=f"a reference shape of {expected}",
        found=found,
        fix="measure the sides in order around the reference and the diagonal from corner 0 to corner 2",
    )
