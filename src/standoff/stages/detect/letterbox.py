"""Fit a picture into a network's input and carry boxes back.

Two coordinates meet here. A network counts from the left edge of its first pixel: a box over the whole input
is 0 to `width`. A picture's coordinates are 0 at the *centre* of its first pixel (`standoff.core.camera`), so
a box over the whole picture is -0.5 to `width - 0.5`. Resizing keeps edges on edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray

_GREY = 0.5


@dataclass(frozen=True, slots=True)
class Letterbox:
    """Where a picture lies in a network's input.

    Attributes:
        source_size_px: (width, height) of the picture.
        input_size_px: (width, height) of the input.
        inner_size_px: (width, height) of the picture inside the input.
        offset_px: (left, top) of it.
    """

    source_size_px: tuple[int, int]
    input_size_px: tuple[int, int]
    inner_size_px: tuple[int, int]
    offset_px: tuple[int, int]

    @classmethod
    def fit(cls, source_size_px: tuple[int, int], input_size_px: tuple[int, int]) -> Letterbox:
        """Scale a picture to fit without changing its aspect ratio, in the middle.

        >>> Letterbox.fit((1920, 1080), (416, 416))
        Letterbox(source_size_px=(1920, 1080), input_size_px=(416, 416), inner_size_px=(416, 234), offset_px=(0, 91))
        """
        scale = min(input_size_px[0] / source_size_px[0], input_size_px[1] / source_size_px[1])
        width_px, height_px = (max(1, round(side * scale)) for side in source_size_px)
        offset_px = (input_size_px[0] - width_px) // 2, (input_size_px[1] - height_px) // 2
        return cls(source_size_px, input_size_px, (width_px, height_px), offset_px)

    def network_input(self, resized: ImageArray) -> npt.NDArray[np.float32]:
        """Lay a picture, resized to `inner_size_px`, blue first, into an input.

        Returns:
            (1, 3, height, width), red first, 0 to 1, grey where there is no picture.
        """
        colours_first = cv2.dnn.blobFromImage(resized, 1.0 / 255.0, swapRB=True)
        if self.inner_size_px == self.input_size_px:
            return np.asarray(colours_first)
        (width, height), (left, top) = self.inner_size_px, self.offset_px
        filled = np.full((1, 3, self.input_size_px[1], self.input_size_px[0]), _GREY, np.float32)
        filled[:, :, top : top + height, left : left + width] = colours_first
        return filled

    def to_source(self, xyxy_input_px: FloatArray) -> FloatArray:
        """Carry boxes of the input to the picture, and cut them at its edges.

        Args:
            xyxy_input_px: (N, 4) left, top, right, bottom; 0 is the edge of the input's first pixel.

        Returns:
            (N, 4) in picture pixels; 0 is the centre of the picture's first pixel.
        """
        offset = np.array([*self.offset_px, *self.offset_px], dtype=np.float64)
        source = np.array([*self.source_size_px, *self.source_size_px], dtype=np.float64)
        inner = np.array([*self.inner_size_px, *self.inner_size_px], dtype=np.float64)
        edges_px = (xyxy_input_px.reshape(-1, 4) - offset) * (source / inner)
        boxes_px: FloatArray = np.clip(edges_px, 0.0, source) - 0.5
        return boxes_px
