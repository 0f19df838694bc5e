"""Crisp text for pictures: DejaVu Sans, rendered once for each text and kept."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from standoff.core.types import ImageArray
from standoff.stages.sinks.palette import Bgr

_KEPT = 1024


class TextSprites:
    """Render text to masks; the last thousand or so are kept."""

    def __init__(self) -> None:
        self._fonts: dict[tuple[int, bool], ImageFont.FreeTypeFont] = {}
        self._masks: dict[tuple[str, int, bool], ImageArray] = {}

    def mask(self, text: str, size_px: int, *, bold: bool = False) -> ImageArray:
        """Return (H, W) coverage, 0 to 255; H depends on the size only."""
        key = (text, size_px, bold)
        if key not in self._masks:
            if len(self._masks) >= _KEPT:
                self._masks.pop(next(iter(self._masks)))
            self._masks[key] = self._rendered(text, size_px, bold)
        return self._masks[key]

    def _rendered(self, text: str, size_px: int, bold: bool) -> ImageArray:
        font = self._font(size_px, bold)
        ascent, descent = font.getmetrics()
        picture = Image.new("L", (max(1, int(np.ceil(font.getlength(text)))), ascent + descent))
        ImageDraw.Draw(picture).text((0, 0), text, fill=255, font=font)
        return np.asarray(picture)

    def _font(self, size_px: int, bold: bool) -> ImageFont.FreeTypeFont:
        if (size_px, bold) not in self._fonts:
            name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
            path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name
            self._fonts[size_px, bold] = ImageFont.truetype(str(path), size_px)
        return self._fonts[size_px, bold]


def blend(canvas: ImageArray, mask: ImageArray, left_px: int, top_px: int, colour: Bgr) -> None:
    """Paint a colour through a mask; what lies outside the canvas is cut off."""
    height, width = canvas.shape[:2]
    x0, y0 = max(left_px, 0), max(top_px, 0)
    x1, y1 = min(left_px + mask.shape[1], width), min(top_px + mask.shape[0], height)
    if x0 >= x1 or y0 >= y1:
        return
    cover = mask[y0 - top_px : y1 - top_px, x0 - left_px : x1 - left_px, None].astype(np.uint16)
    area = canvas[y0:y1, x0:x1]
    area[:] = (area * (255 - cover) + np.array(colour, dtype=np.uint16) * cover) // 255
