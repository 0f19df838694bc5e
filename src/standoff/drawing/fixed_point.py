"""Parts of a pixel for OpenCV, which draws in whole numbers."""

from typing import Final

SHIFT: Final = 4
"""Bits behind the point: sixteenths of a pixel."""

FAR_PX: Final = 1e6
"""Further out nothing is drawn, and whole numbers would run over."""
