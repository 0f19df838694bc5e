"""What a network of ground points sees of a box: a square about it, with some of what is around."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from standoff.core.classes import CLASSES, Role
from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray, IntArray

POINT_CROP_PX: Final = 96
"""The network sees a square with sides of so many pixels."""
POINT_CROP_AROUND: Final = 1.4
"""Side of the square in the picture, in longer sides of the box."""
POINT_CLASSES: Final = tuple(one.name for one in CLASSES if one.role is not Role.REFERENCE)
"""Whose ground points the network tells, in the order of its `class_index`."""

_LEAST_SIDE_PX: Final = 4


def point_squares_px(xyxy_px: FloatArray, around: float = POINT_CROP_AROUND) -> IntArray:
    """Return the square about each box.

    Args:
        xyxy_px: (N, 4) boxes; 0 is the centre of the first pixel.
        around: Side of the square in longer sides of the box.

    Returns:
        (N, 3) left and top pixel, perhaps outside the picture, and how many pixels the side has.
    """
    sides_px = xyxy_px[:, 2:] - xyxy_px[:, :2]
    side_px = np.maximum(np.rint(around * sides_px.max(axis=1)), _LEAST_SIDE_PX)
    corner_px = np.rint((xyxy_px[:, :2] + xyxy_px[:, 2:] + 1.0 - side_px[:, None]) / 2.0)
    return np.column_stack([corner_px, side_px]).astype(np.int64)


def point_crop(image: ImageArray, square_px: IntArray, size_px: int = POINT_CROP_PX) -> ImageArray:
    """Cut one square out of a picture and scale it; what lies outside repeats the picture's edge.

    Args:
        image: (H, W, 3).
        square_px: (3,) of `point_squares_px`.
        size_px: Side of the result.

    Returns:
        (size_px, size_px, 3).
    """
    left, top, side = square_px.tolist()
    height, width = image.shape[:2]
    # A square may lie wholly outside of a picture that is smaller than it.
    rows, columns = (
        (min(max(start, 0), length - 1), min(max(start + side, 1), length))
        for start, length in ((top, height), (left, width))
    )
    part = image[rows[0] : rows[1], columns[0] : columns[1]]
    above, below, before, after = rows[0] - top, top + side - rows[1], columns[0] - left, left + side - columns[1]
    if above or below or before or after:
        edges = max(above, 0), max(below, 0), max(before, 0), max(after, 0)
        part = np.asarray(cv2.copyMakeBorder(part, *edges, borderType=cv2.BORDER_REPLICATE), dtype=np.uint8)
    shrinks = part.shape[0] > size_px
    scaled = cv2.resize(part, (size_px, size_px), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    return np.asarray(scaled, dtype=np.uint8)
