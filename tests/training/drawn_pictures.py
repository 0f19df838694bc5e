"""Labelled pictures whose things can be found again by their colour."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray
from standoff.labels import LabelledPicture

THING_BGR = (30, 30, 220)
GROUND_BGR = (60, 120, 60)
SIZE_PX = (640, 360)


def draw_ellipses(xyxy_px: FloatArray, size_px: tuple[int, int] = SIZE_PX) -> ImageArray:
    """Fill boxes with ellipses, half-way between the colours where an outline crosses the middle of a pixel."""
    inside = np.zeros((size_px[1], size_px[0]))
    for left, top, right, bottom in xyxy_px:
        half_px = (right - left) / 2.0, (bottom - top) / 2.0
        rows, columns = np.ogrid[: size_px[1], int(left) : int(right) + 2]
        radius = np.hypot((columns - (left + right) / 2.0) / half_px[0], (rows - (top + bottom) / 2.0) / half_px[1])
        part = inside[:, int(left) : int(right) + 2]
        np.maximum(part, np.clip((1.0 - radius) * min(half_px) + 0.5, 0.0, 1.0)[:, : part.shape[1]], out=part)
    ground, thing = np.array(GROUND_BGR, np.float64), np.array(THING_BGR, np.float64)
    table = np.round(ground + np.linspace(0.0, 1.0, 256)[:, None] * (thing - ground)).astype(np.uint8)
    return np.asarray(table[(inside * 255.0).astype(np.uint8)])


def thing_share(image: ImageArray) -> FloatArray:
    """Return (H, W): 1 on things, 0 on the ground."""
    share: FloatArray = (image[..., 2].astype(np.float64) - GROUND_BGR[2]) / (THING_BGR[2] - GROUND_BGR[2])
    return share


def label(
    xyxy_px: FloatArray, path: Path = Path("drawn.png"), size_px: tuple[int, int] = SIZE_PX, source: str = "drawn"
) -> LabelledPicture:
    count = len(xyxy_px)
    return LabelledPicture(
        path, size_px, np.asarray(xyxy_px), np.zeros(count, np.int64), np.zeros(count, np.bool_), path.stem, source
    )


def draw_boxes(rng: np.random.Generator, count: int = 4, size_px: tuple[int, int] = SIZE_PX) -> FloatArray:
    """Return boxes that do not touch: each in its own part of the picture."""
    width = size_px[0] / count
    left = np.arange(count) * width + rng.uniform(5.0, 25.0, count)
    top = rng.uniform(5.0, size_px[1] / 2.0, count)
    sides = rng.uniform((30.0, 30.0), (width - 35.0, size_px[1] / 2.0 - 15.0), (count, 2))
    return np.column_stack([left, top, left + sides[:, 0], top + sides[:, 1]])
