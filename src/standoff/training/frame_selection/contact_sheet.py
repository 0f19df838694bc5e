"""All chosen frames on one sheet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import Detections, Frame, ImageArray, IntArray
from standoff.drawing.painter import Painter
from standoff.drawing.palette import bgr, class_tone
from standoff.drawing.text import TextSprites, write_light

_TILE_WIDTH_PX = 384
_FONT_PX = 13
_CAPTION_PX = 40
_GAP_PX = 8
_SHEET_ASPECT = 1.6


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """One frame of the sheet.

    Attributes:
        image: (H, W, 3) uint8 BGR, small.
        xyxy_px: (N, 4) boxes in it.
        class_id: (N,).
        title: First line of the caption.
        reason: Second line.
    """

    image: ImageArray
    xyxy_px: FloatArray
    class_id: IntArray
    title: str
    reason: str

    @classmethod
    def of(cls, frame: Frame, boxes: Detections, reason: str) -> Tile:
        """Make a frame small."""
        width_px, height_px = frame.size_px
        scale = _TILE_WIDTH_PX / width_px
        small = frame.picture.resized_bgr(_TILE_WIDTH_PX, max(1, round(height_px * scale)))
        title = f"frame {frame.index}   {frame.time_s:.2f} s   {len(boxes)} box{'es' * (len(boxes) != 1)}"
        return cls(small, (boxes.xyxy_px + 0.5) * scale - 0.5, boxes.class_id, title, reason)


def draw_sheet(tiles: Sequence[Tile]) -> ImageArray:
    """Return one picture of all tiles, in rows, (H, W, 3) uint8 BGR.

    Args:
        tiles: At least one, all of one size.
    """
    height_px = tiles[0].image.shape[0] + _CAPTION_PX
    columns = min(len(tiles), math.ceil(math.sqrt(len(tiles) * _SHEET_ASPECT * height_px / _TILE_WIDTH_PX)))
    rows = math.ceil(len(tiles) / columns)
    pitch_px = _TILE_WIDTH_PX + _GAP_PX, height_px + _GAP_PX
    sheet = np.full((rows * pitch_px[1] + _GAP_PX, columns * pitch_px[0] + _GAP_PX, 3), bgr("dark"), np.uint8)
    text = TextSprites()
    for number, tile in enumerate(tiles):
        row, column = divmod(number, columns)
        top, left = _GAP_PX + row * pitch_px[1], _GAP_PX + column * pitch_px[0]
        _draw_tile(sheet[top : top + height_px, left : left + _TILE_WIDTH_PX], tile, text)
    return sheet


def _draw_tile(canvas: ImageArray, tile: Tile, text: TextSprites) -> None:
    picture = canvas[: tile.image.shape[0]]
    picture[:] = tile.image
    painter = Painter(picture, text)
    for xyxy_px, class_id in zip(tile.xyxy_px, tile.class_id.tolist(), strict=True):
        painter.box(xyxy_px.tolist(), bgr(class_tone(class_id)))
    caption = canvas[tile.image.shape[0] :]
    write_light(caption, text.sprite(tile.title, _FONT_PX, bold=True), 2, 3)
    write_light(caption, text.sprite(tile.reason, _FONT_PX), 2, 3 + _CAPTION_PX // 2)
