"""Crisp text for pictures: DejaVu Sans, rendered once for each text and kept."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from standoff.core.types import ImageArray
from standoff.drawing.palette import bgr

_KEPT = 1024


class TextSprites:
    """Render light text on black; the last thousand or so pictures of text are kept."""

    def __init__(self) -> None:
        self._fonts: dict[tuple[int, bool], ImageFont.FreeTypeFont] = {}
        self._sprites: dict[tuple[str, int, bool], ImageArray] = {}

    def sprite(self, text: str, size_px: int, *, bold: bool = False) -> ImageArray:
        """Return (H, W, 3) uint8 BGR; H depends on the size only."""
        key = (text, size_px, bold)
        if key not in self._sprites:
            if len(self._sprites) >= _KEPT:
                self._sprites.pop(next(iter(self._sprites)))
            self._sprites[key] = self._rendered(text, size_px, bold)
        return self._sprites[key]

    def _rendered(self, text: str, size_px: int, bold: bool) -> ImageArray:
        if len(text) > 1:  # texts are often new, their letters never
            return np.hstack([self.sprite(letter, size_px, bold=bold) for letter in text])
        font = self._font(size_px, bold)
        ascent, descent = font.getmetrics()
        picture = Image.new("RGB", (max(1, round(font.getlength(text))), ascent + descent))
        ImageDraw.Draw(picture).text((0, 0), text, fill=bgr("light"), font=font)
        return np.asarray(picture)

    def _font(self, size_px: int, bold: bool) -> ImageFont.FreeTypeFont:
        if (size_px, bold) not in self._fonts:
            import matplotlib as mpl  # its fonts are all that is needed of it, and it takes long to load

            name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
            path = Path(mpl.get_data_path()) / "fonts" / "ttf" / name
            self._fonts[size_px, bold] = ImageFont.truetype(str(path), size_px)
        return self._fonts[size_px, bold]


def write_light(canvas: ImageArray, sprite: ImageArray, left_px: int, top_px: int) -> None:
    """Write light text over a dark ground; what lies outside the canvas is cut off."""
    height, width = canvas.shape[:2]
    x0, y0 = max(left_px, 0), max(top_px, 0)
    x1, y1 = min(left_px + sprite.shape[1], width), min(top_px + sprite.shape[0], height)
    if x0 < x1 and y0 < y1:
        area = canvas[y0:y1, x0:x1]
        cv2.max(area, sprite[y0 - top_px : y1 - top_px, x0 - left_px : x1 - left_px], dst=area)
