"""A clock that a camera can read: the milliseconds of this machine as a QR code."""

from __future__ import annotations

import re
from typing import Final

import cv2
import numpy as np

from standoff.core.types import ImageArray

_TOLD: Final = re.compile(r"STANDOFF (\d{10,15})")
_QUIET_MODULES: Final = 4
_WIDEST_PX: Final = 1280


def clock_picture(unix_s: float, module_px: int = 16) -> ImageArray:
    """Return (H, W) uint8, black on white: the moment, with the white border that readers need.

    Args:
        unix_s: Since 1970.
        module_px: Side of a module.
    """
    code = cv2.QRCodeEncoder.create().encode(f"STANDOFF {unix_s * 1e3:.0f}")
    # OpenCV draws one pixel a module, with a border of its own that is not wide enough for all readers.
    bordered = np.pad(code, _QUIET_MODULES, constant_values=255)
    picture: ImageArray = np.kron(bordered, np.ones((module_px, module_px), np.uint8))
    return picture


def read_clock(gray: ImageArray) -> float | None:
    """Return the moment that a picture (H, W) shows, seconds since 1970; None where it shows none that can be read."""
    if gray.shape[1] > _WIDEST_PX:
        height_px = round(gray.shape[0] * _WIDEST_PX / gray.shape[1])
        gray = cv2.resize(gray, (_WIDEST_PX, height_px), interpolation=cv2.INTER_AREA)
    text, _, _ = cv2.QRCodeDetector().detectAndDecode(gray)
    found = _TOLD.fullmatch(text)
    return None if found is None else int(found[1]) / 1e3
