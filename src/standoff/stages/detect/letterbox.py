"""Fit a picture into a network's input and carry boxes back.

Two coordinates meet here. A network counts from the left edge of its first pixel: a box over the whole input
is 0 to `width`. A picture's coordinates are 0 at the *centre* of its first pixel (`standoff.core.camera`), so
a box over the whole picture is -0.5 to `width - 0.5`. Resizing keeps edges on edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray

Placement = Literal["centre", "top-left", "stretch"]
Colour = Literal["rgb", "bgr"]


@dataclass(frozen=True, slots=True)
class Preprocessing:
    """What a network wants of a picture; as it stands: what Darknet and `standoff export` want.

    Attributes:
        colour: Order of the channels.
        white: Value of the brightest level: 1 or 255.
        mean: Of each channel in that order, on that scale; subtracted.
        std: Of each channel; divided by afterwards.
        placement: Scaled to fit without changing its aspect ratio, in the middle or at the top left; or stretched.
        pad: Level around the picture, 0 to 255.
    """

    colour: Colour = "rgb"
    white: float = 1.0
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[float, float, float] = (1.0, 1.0, 1.0)
    placement: Placement = "centre"
    pad: float = 127.5

    @property
    def normalises(self) -> bool:
        """Whether there is a mean or a standard deviation to apply."""
        return any(self.mean) or self.std != (1.0, 1.0, 1.0)


DARKNET = Preprocessing()


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
    def fit(
        cls, source_size_px: tuple[int, int], input_size_px: tuple[int, int], placement: Placement = "centre"
    ) -> Letterbox:
        """Lay a picture into an input.

        >>> Letterbox.fit((1920, 1080), (416, 416))
        Letterbox(source_size_px=(1920, 1080), input_size_px=(416, 416), inner_size_px=(416, 234), offset_px=(0, 91))
        """
        if placement == "stretch":
            return cls(source_size_px, input_size_px, input_size_px, (0, 0))
        scale = min(input_size_px[0] / source_size_px[0], input_size_px[1] / source_size_px[1])
        width_px, height_px = (max(1, round(side * scale)) for side in source_size_px)
        rest_px = input_size_px[0] - width_px, input_size_px[1] - height_px
        offset_px = (0, 0) if placement == "top-left" else (rest_px[0] // 2, rest_px[1] // 2)
        return cls(source_size_px, input_size_px, (width_px, height_px), offset_px)

    def network_input(self, resized: ImageArray, wanted: Preprocessing = DARKNET) -> npt.NDArray[np.float32]:
        """Lay a picture, resized to `inner_size_px`, blue first, into an input.

        Args:
            resized: (height, width, 3).
            wanted: Colours, scale and surroundings.

        Returns:
            (1, 3, height, width).
        """
        (width, height), (left, top) = self.inner_size_px, self.offset_px
        shape = (1, 3, self.input_size_px[1], self.input_size_px[0])
        filled = np.full(shape, wanted.pad / 255.0 * wanted.white, np.float32)
        channels = cv2.split(resized) if wanted.colour == "bgr" else cv2.split(resized)[::-1]
        for plane, channel in zip(filled[0], channels, strict=True):
            inside = plane[top : top + height, left : left + width]
            np.multiply(channel, np.float32(wanted.white / 255.0), out=inside, dtype=np.float32)
        if wanted.normalises:
            mean, std = (np.array(values, np.float32).reshape(3, 1, 1) for values in (wanted.mean, wanted.std))
            filled = (filled - mean) / std
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

    def points_to_source(self, points_input_px: FloatArray) -> FloatArray:
        """Carry (N, 2) points of the input, counted as its boxes are, to the picture; they may lie outside of it."""
        points_px: FloatArray = (points_input_px - self.offset_px) * self.source_px_per_input_px - 0.5
        return points_px

    @property
    def source_px_per_input_px(self) -> FloatArray:
        """(2,) how much larger the picture is, across and down."""
        return np.array(self.source_size_px, dtype=np.float64) / self.inner_size_px


def resize(image: ImageArray, size_px: tuple[int, int]) -> ImageArray:
    """Scale a picture to (width, height): by areas when it shrinks, so that nothing small is lost between samples."""
    shrinks = size_px[0] < image.shape[1]
    resized = cv2.resize(image, size_px, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    return np.asarray(resized, dtype=np.uint8)
