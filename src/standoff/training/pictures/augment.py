"""A training sample from labelled pictures: views of them, parts hidden, seen by a worse camera."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from standoff.core.errors import DataError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import ImageArray, IntArray
from standoff.labels.types import LabelledPicture
from standoff.training.pictures.augment_params import AugmentParams
from standoff.training.pictures.cut_outs import hide_parts
from standoff.training.pictures.degrade import degrade
from standoff.training.pictures.views import cut_boxes, draw_view

__all__ = ["AugmentParams", "Sample", "make_sample"]

Pick = Callable[[np.random.Generator], int]
"""Draws the position of a picture."""
Load = Callable[[LabelledPicture, int], ImageArray]
"""Reads a picture as (H, W, 3) uint8, blue first, its sides divided by 1, 2, 4 or 8 (or not, if that is easier);
raises `DataError` for one that cannot be read."""

_REDUCTIONS: Final = (8, 4, 2)
_MOST_FAILURES: Final = 50
"""Pictures in a row that cannot be read: then something is wrong with the folder, not with a picture."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """One input of a network in training.

    Attributes:
        image: (H, W, 3) uint8, blue first, of the network's input size.
        xyxy_px: (N, 4) in input pixels; 0 is the left edge of the first pixel; inside the input.
        class_id: (N,)
        ignored: (N,) as in `LabelledPicture`.
        foot_px: (N, 2) ground points, counted as the boxes are; they may lie outside the input, and are NaN where none
            is marked.
    """

    image: ImageArray
    xyxy_px: FloatArray
    class_id: IntArray
    ignored: BoolArray
    foot_px: FloatArray


def make_sample(
    rng: np.random.Generator,
    data: Sequence[LabelledPicture],
    pick: Pick,
    load: Load,
    size_px: tuple[int, int],
    params: AugmentParams,
) -> Sample:
    """Draw one picture, or four for a mosaic, and show them as another camera might.

    Args:
        rng: Decides everything.
        data: The pictures.
        pick: Draws a position in them. A picture that `load` refuses is replaced by the next draw.
        load: Reads one.
        size_px: (width, height) of the network's input.
        params: What may happen.

    Raises:
        DataError: Many pictures in a row cannot be read.
    """
    image = np.empty((size_px[1], size_px[0], 3), np.uint8)
    parts = []
    for left, top, right, bottom in _cells(rng, size_px, params):
        part = _show(rng, data, pick, load, image[top:bottom, left:right], params)
        shift = np.array([left, top])
        parts.append(replace(part, xyxy_px=part.xyxy_px + np.tile(shift, 2), foot_px=part.foot_px + shift))
    ignored = np.concatenate([part.ignored for part in parts])
    xyxy_px = np.concatenate([part.xyxy_px for part in parts])
    if rng.random() < params.cut_out:
        ignored |= hide_parts(rng, image, xyxy_px, params)
    class_id = np.concatenate([part.class_id for part in parts])
    foot_px = np.concatenate([part.foot_px for part in parts])
    return Sample(degrade(rng, image, params), xyxy_px, class_id, ignored, foot_px)


def _cells(
    rng: np.random.Generator, size_px: tuple[int, int], params: AugmentParams
) -> list[tuple[int, int, int, int]]:
    """Return (left, top, right, bottom) of the whole input, or of a mosaic's four parts."""
    width, height = size_px
    if rng.random() >= params.mosaic:
        return [(0, 0, width, height)]
    middle = round(width * rng.uniform(*params.mosaic_split))
    level = round(height * rng.uniform(*params.mosaic_split))
    columns, rows = ((0, middle), (middle, width)), ((0, level), (level, height))
    return [(left, top, right, bottom) for top, bottom in rows for left, right in columns]


def _show(
    rng: np.random.Generator,
    data: Sequence[LabelledPicture],
    pick: Pick,
    load: Load,
    onto: ImageArray,
    params: AugmentParams,
) -> Sample:
    """Draw a view of the next picture that can be read onto an array, which becomes the sample's image."""
    size_px = (onto.shape[1], onto.shape[0])
    for _ in range(_MOST_FAILURES):
        picture = data[pick(rng)]
        view = draw_view(rng, picture, size_px, params)
        # Below this, interpolation between neighbours would skip pixels; and reading a smaller JPEG is quicker.
        reduction = next((factor for factor in _REDUCTIONS if view.zoom * factor <= 1.0), 1)
        try:
            image = load(picture, reduction)
        except DataError:
            continue
        view.warp(image, onto)
        xyxy_px, present, ignored = cut_boxes(view.carry(picture.xyxy_px), picture.ignored, size_px, params)
        foot_px = view.carry_points(picture.foot_px)[present]
        return Sample(onto, xyxy_px[present], picture.class_id[present], ignored[present], foot_px)
    raise DataError(
        expected="pictures that can be read",
        found=f"{_MOST_FAILURES} in a row that cannot, the last {picture.path}",
        fix="check that the folder of the data set is complete",
    )
