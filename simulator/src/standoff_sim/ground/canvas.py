"""Where the site lies in its own picture from above, and random fields to paint with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff_sim.ground.terrain_plan import Path
from standoff_sim.solids.mesh import Float32Array

Picture = npt.NDArray[np.uint8]
_FRACTION_BITS = 4


@dataclass(frozen=True, slots=True)
class Canvas:
    """A picture of the ground: row 0 in the south, column 0 in the west, the site's origin in the middle.

    Attributes:
        width_px: East-west.
        height_px: North-south.
        px_per_m: Of both directions.
    """

    width_px: int
    height_px: int
    px_per_m: float

    @classmethod
    def of(cls, extent_m: tuple[float, float], longest_px: int) -> Canvas:
        """Cover an extent.

        >>> Canvas.of((120.0, 60.0), 2048).height_px
        1024
        """
        px_per_m = longest_px / max(extent_m)
        return cls(round(extent_m[0] * px_per_m), round(extent_m[1] * px_per_m), px_per_m)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.height_px, self.width_px

    def pixels(self, points_m: Path | FloatArray) -> npt.NDArray[np.int32]:
        """Return (..., 2) fixed-point pixels of points (..., 2) for OpenCV's drawing with `shift=4`."""
        middle = np.array([self.width_px, self.height_px]) / 2 - 0.5
        placed = (np.asarray(points_m) * self.px_per_m + middle) * 2**_FRACTION_BITS
        return np.asarray(np.round(placed), np.int32)

    def draw(
        self, layer: npt.NDArray[np.uint8], lines_m: Sequence[FloatArray] | FloatArray, value: int, width_m: float
    ) -> None:
        """Draw polylines (each (N, 2), metres, or (L, N, 2) all at once) with soft edges."""
        thickness_px = max(1, round(width_m * self.px_per_m))
        if isinstance(lines_m, np.ndarray):
            lines = list(self.pixels(lines_m))
        else:
            lines = [self.pixels(line) for line in lines_m]
        cv2.polylines(layer, lines, False, value, thickness_px, cv2.LINE_AA, _FRACTION_BITS)

    def fill(self, layer: npt.NDArray[np.uint8], outlines_m: Sequence[Path | FloatArray], value: int) -> None:
        """Fill polygons (each (N, 2), metres) with soft edges."""
        for outline in outlines_m:
            cv2.fillPoly(layer, [self.pixels(outline)], value, cv2.LINE_AA, _FRACTION_BITS)

    def inside(self, outline_m: Path | FloatArray, window: tuple[slice, slice]) -> Picture:
        """Return the (rows, columns) of a window, 255 inside a polygon and 0 outside, with a soft edge."""
        rows, columns = window
        mask = np.zeros((rows.stop - rows.start, columns.stop - columns.start), np.uint8)
        corner_px = np.array([columns.start, rows.start]) * 2**_FRACTION_BITS
        pixels = (self.pixels(outline_m) - corner_px).astype(np.int32)
        cv2.fillPoly(mask, [pixels], 255, cv2.LINE_AA, _FRACTION_BITS)
        return mask

    def window(self, points_m: Path | FloatArray, margin_m: float) -> tuple[slice, slice]:
        """Return rows and columns around some points."""
        pixels = self.pixels(points_m) / 2**_FRACTION_BITS
        margin_px = margin_m * self.px_per_m
        low = np.clip(np.floor(pixels.min(axis=0) - margin_px), 0, (self.width_px, self.height_px)).astype(int)
        high = np.clip(np.ceil(pixels.max(axis=0) + margin_px) + 1, 0, (self.width_px, self.height_px)).astype(int)
        return slice(low[1], high[1]), slice(low[0], high[0])


def fractal(
    rng: np.random.Generator, shape: tuple[int, int], coarsest: int, finest: int, gain: float = 0.6
) -> Float32Array:
    """Return value noise of zero mean and unit deviation.

    Args:
        rng: Source of chance.
        shape: Rows and columns of the result.
        coarsest: Cells of the first octave along the longer side.
        finest: Cells of the last octave.
        gain: Amplitude of each octave relative to the one before.
    """
    field, amplitude = np.zeros((1, 1), np.float32), 1.0
    cells = coarsest
    while cells <= finest:
        size = tuple(max(2, round(side * cells / max(shape))) for side in shape)
        white = np.frombuffer(rng.bytes(size[0] * size[1]), np.uint8).reshape(size)
        octave = cv2.subtract(white, 127.5, dtype=cv2.CV_32F)
        field = cv2.scaleAdd(octave, amplitude, cv2.resize(field, size[::-1], interpolation=cv2.INTER_CUBIC))
        amplitude *= gain
        cells *= 2
    mean, deviation = cv2.meanStdDev(field)
    scale = 1.0 / float(deviation[0, 0])
    resized = cv2.resize(field, shape[::-1], interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.addWeighted(resized, scale, resized, 0.0, -float(mean[0, 0]) * scale), np.float32)
