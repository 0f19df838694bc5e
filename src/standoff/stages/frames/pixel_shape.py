"""Pixels that are not square: how wide a stored picture is to be shown."""

from __future__ import annotations

from fractions import Fraction
from typing import Final

_WIDEST: Final = Fraction(4)
"""Of a pixel, in its heights; wider ones, or as narrow, are in no camera's or broadcaster's format."""


def square_size_px(stored_px: tuple[int, int], pixel_aspect: Fraction | None) -> tuple[int, int]:
    """Return the (width, height) that a stored picture has with square pixels: its height, and its width stretched.

    Args:
        stored_px: (width, height).
        pixel_aspect: Width of a pixel in its heights; None or 0: the file does not say, so that it is square.

    Raises:
        ValueError: No picture has such pixels; says what.

    >>> square_size_px((960, 720), Fraction(4, 3))
    (1280, 720)
    """
    if not pixel_aspect:
        return stored_px
    if not 1 / _WIDEST <= pixel_aspect <= _WIDEST:
        raise ValueError(f"pixels {pixel_aspect.numerator}:{pixel_aspect.denominator} wide")
    return round(stored_px[0] * pixel_aspect), stored_px[1]
