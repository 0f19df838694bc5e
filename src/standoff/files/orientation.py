"""How a stored picture must be turned and mirrored to be upright: the eight ways that EXIF data and films have."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any, Final, Self

import cv2
import numpy as np

from standoff.core.types import ImageArray

_CROOKED: Final = 0.01
"""Of a side of the picture; a display matrix that is further from the eight ways is none of them."""


@dataclass(frozen=True, slots=True)
class Orientation:
    """One of the eight ways to lay a rectangle onto itself or its like; upright by default.

    Attributes:
        transposed: Rows become columns, before anything else.
        flips_x: Then left and right change places.
        flips_y: And above and below.
    """

    transposed: bool = False
    flips_x: bool = False
    flips_y: bool = False

    @classmethod
    def of_exif(cls, number: object) -> Self:
        """Return what EXIF's Orientation means; upright for what is none, as every viewer takes it.

        EXIF 2.32, table 6: 6 is "the 0th row is the right-hand side, the 0th column the top".

        >>> Orientation.of_exif(6)
        Orientation(transposed=True, flips_x=True, flips_y=False)
        """
        ways = {
            2: (False, True, False),
            3: (False, True, True),
            4: (False, False, True),
            5: (True, False, False),
            6: (True, True, False),
            7: (True, True, True),
            8: (True, False, True),
        }
        return cls(*ways.get(number, ())) if isinstance(number, int) else cls()

    @classmethod
    def of_display_matrix(cls, content: bytes) -> Self:
        """Return what a film's display matrix means, apart from its scale and shift.

        Args:
            content: Nine 32-bit numbers of fixed point, row by row, as libavutil's display.h has them: a stored
                (p, q) is shown at (a p + c q, b p + d q), both with y downwards, for rows (a, b, .) and (c, d, .).

        Raises:
            ValueError: It turns by something else than a quarter, or shears; says what.
        """
        rows = np.array(struct.unpack("=9i", content), np.float64).reshape(3, 3)[:2, :2]
        lengths = np.linalg.norm(rows, axis=1, keepdims=True)
        if not lengths.all():
            raise ValueError(f"a display matrix without extent, {(rows / 65536).tolist()}")
        rows = rows / lengths
        straight = np.rint(rows)
        if np.abs(rows - straight).max() > _CROOKED or abs(round(float(np.linalg.det(straight)))) != 1:
            raise ValueError(f"turned by {np.degrees(np.arctan2(-rows[0, 1], rows[0, 0])):.0f} degrees")
        transposed = not straight[0, 0]
        x_of, y_of = (straight[1, 0], straight[0, 1]) if transposed else (straight[0, 0], straight[1, 1])
        return cls(bool(transposed), bool(x_of < 0), bool(y_of < 0))

    @property
    def is_upright(self) -> bool:
        """Whether there is nothing to do."""
        return not (self.transposed or self.flips_x or self.flips_y)

    @property
    def is_mirrored(self) -> bool:
        """Whether writing could not be read, however the stored picture is turned."""
        return self.transposed ^ self.flips_x ^ self.flips_y

    @property
    def rotation_deg(self) -> int:
        """Counter-clockwise turn, 0, 90, -90 or 180, after which a mirrored picture still has its sides swapped."""
        flips_x = self.flips_x ^ self.is_mirrored
        if self.transposed:
            return -90 if flips_x else 90
        return 180 if flips_x else 0

    def describe(self) -> dict[str, Any]:
        """Return what is done to the stored picture, for the record."""
        return {"rotation_deg": self.rotation_deg, "mirrored": self.is_mirrored}

    def size_px(self, stored_px: tuple[int, int]) -> tuple[int, int]:
        """Return the upright (width, height) of a stored one; or the stored one of an upright."""
        return stored_px[::-1] if self.transposed else stored_px

    def upright(self, image: ImageArray) -> ImageArray:
        """Return a stored picture (H, W) or (H, W, 3) upright; itself where nothing is to be done."""
        if self.transposed:
            image = cv2.transpose(image)
        if self.flips_x or self.flips_y:
            image = cv2.flip(image, -1 if self.flips_x and self.flips_y else int(self.flips_x))
        return image


UPRIGHT: Final = Orientation()
