"""Which parts of a frame the network looks at, one after another."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from standoff.core.homography import BoolArray, FloatArray


@dataclass(frozen=True, slots=True)
class Slice:
    """A part of a frame, in whole pixels.

    Attributes:
        left_px: First column.
        top_px: First row.
        width_px: Columns.
        height_px: Rows.
        frame_size_px: (width, height) of the frame.
    """

    left_px: int
    top_px: int
    width_px: int
    height_px: int
    frame_size_px: tuple[int, int]

    def is_cut(self, xyxy_px: FloatArray, margin_px: tuple[float, float]) -> BoolArray:
        """Tell which boxes end at a border of the view that is not a border of the frame.

        Args:
            xyxy_px: (N, 4) in frame pixels.
            margin_px: How near to the border is at the border: across, and up or down.

        Returns:
            (N,).
        """
        edges_px = np.array([self.left_px, self.top_px, self.left_px + self.width_px, self.top_px + self.height_px])
        frame_edges_px = np.array([0, 0, *self.frame_size_px])
        near = np.abs(xyxy_px - (edges_px - 0.5)) <= np.array([*margin_px, *margin_px])
        cut: BoolArray = (near & (edges_px != frame_edges_px)).any(axis=1)
        return cut


def _starts_and_length(side_px: int, count: int, overlap: float) -> tuple[list[int], int]:
    length_px = min(side_px, math.ceil(side_px * view_share((count, 1), overlap)[0]))
    return [(side_px - length_px) * number // max(1, count - 1) for number in range(count)], length_px


def views(frame_size_px: tuple[int, int], slices: tuple[int, int], overlap: float) -> tuple[Slice, ...]:
    """Lay a grid of overlapping slices over a frame.

    Args:
        frame_size_px: (width, height).
        slices: Columns and rows.
        overlap: Part of a slice's side that its neighbour shows too.

    Returns:
        The whole frame first, so that nothing is too large to be seen, then the slices, if any.

    >>> [(view.left_px, view.width_px) for view in views((1800, 900), (2, 1), 0.2)]
    [(0, 1800), (0, 1000), (800, 1000)]
    """
    whole = Slice(0, 0, *frame_size_px, frame_size_px)
    if slices == (1, 1):
        return (whole,)
    lefts, width_px = _starts_and_length(frame_size_px[0], slices[0], overlap)
    tops, height_px = _starts_and_length(frame_size_px[1], slices[1], overlap)
    return whole, *(Slice(left, top, width_px, height_px, frame_size_px) for top in tops for left in lefts)


def view_share(slices: tuple[int, int], overlap: float) -> tuple[float, float]:
    """Return the parts of a frame's width and height that a slice shows.

    >>> view_share((1, 1), 0.2), view_share((2, 1), 0.0)
    ((1.0, 1.0), (0.5, 1.0))
    """
    across, up = (1.0 / (count - (count - 1) * overlap) for count in slices)
    return across, up


def held_whole_px(frame_size_px: tuple[int, int], slices: tuple[int, int], overlap: float) -> tuple[int, int]:
    """Return the (width, height) up to which some slice shows a thing whole, wherever it is.

    >>> held_whole_px((1800, 900), (2, 1), 0.2)
    (200, 900)
    """
    width_px, height_px = (
        min([length_px, *(start + length_px - following for start, following in pairwise(starts))])
        for starts, length_px in map(_starts_and_length, frame_size_px, slices, (overlap, overlap))
    )
    return width_px, height_px
