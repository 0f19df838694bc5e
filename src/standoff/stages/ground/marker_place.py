"""Where a printed marker lies on the site."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray

_SQUARE_SHARE = 0.02
"""Sides and diagonals may differ by so much from a square's: a tape measure's error on site, not a mix-up."""


@dataclass(frozen=True, slots=True, eq=False)
class MarkerPlace:
    """One marker whose place is known.

    Attributes:
        marker_id: Within its family.
        corners_m: (4, 3) site frame, outer corners of the black square: lower left, lower right, upper right, upper
            left of the upright marker, counter-clockwise seen from above. The printed sheet has them numbered 0 to 3.
    """

    marker_id: int
    corners_m: FloatArray

    def __post_init__(self) -> None:
        corners = np.array(self.corners_m, dtype=np.float64)
        if corners.shape != (4, 3) or not np.isfinite(corners).all():
            raise _place_error("four corners of three finite numbers", f"an array of shape {corners.shape}")
        sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        diagonals = np.linalg.norm(corners[2:] - corners[:2], axis=1) / np.sqrt(2.0)
        lengths = np.concatenate([sides, diagonals])
        if not lengths.min() > (1.0 - _SQUARE_SHARE) * lengths.max():
            raise _place_error("the corners of a square", f"sides of {', '.join(f'{side:.3f}' for side in sides)} m")
        across = np.cross(corners[2] - corners[0], corners[3] - corners[1])
        if across[2] <= 0:
            raise _place_error("corners counter-clockwise seen from above", "clockwise ones")
        corners.setflags(write=False)
        object.__setattr__(self, "corners_m", corners)

    @classmethod
    def lying(
        cls,
        marker_id: int,
        size_m: float,
        *,
        xy_m: tuple[float, float] = (0.0, 0.0),
        heading_deg: float = 0.0,
        height_m: float = 0.0,
    ) -> Self:
        """Lay a marker level. Without more it defines the site frame: corner 0 at the origin, x towards corner 1.

        Args:
            marker_id: Within its family.
            size_m: Side of the black square.
            xy_m: Of corner 0, site frame.
            heading_deg: Direction from corner 0 to corner 1, counter-clockwise from the site's x axis.
            height_m: Of its plane above the ground.

        Raises:
            GroundError: The size is not a length.

        >>> MarkerPlace.lying(0, 1.2, height_m=0.3).corners_m[2].tolist()
        [1.2, 1.2, 0.3]
        """
        if not (np.isfinite(size_m) and size_m > 0):
            raise _place_error("a size above 0 m", f"{size_m:g} m")
        turn = np.deg2rad(heading_deg)
        along, up = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        flat = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) * size_m
        corners = np.asarray(xy_m) + flat[:, :1] * along + flat[:, 1:] * up
        return cls(marker_id, np.column_stack([corners, np.full(4, height_m)]))

    @property
    def size_m(self) -> float:
        """Mean side of the black square."""
        return float(np.linalg.norm(np.roll(self.corners_m, -1, axis=0) - self.corners_m, axis=1).mean())


def _place_error(expected: str, found: str) -> GroundError:
    return GroundError(
        expected=f"a marker's place: {expected}",
        found=found,
        fix="measure the outer corners of the black square, in the order 0 to 3 that is printed beside them",
    )
