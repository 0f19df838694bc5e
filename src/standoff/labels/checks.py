"""From what a data set says to what holds: classes mapped, boxes inside the picture, nothing twice or contradictory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from standoff.core.boxes import overlaps
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.labels.source import UNPLACEABLE, BadPicture, SourcePicture
from standoff.labels.types import Problem

_ROUNDING_PX: Final = 1.0
"""Boxes at the picture's edge stick out by this much because they were rounded; that is no mistake."""
_MIN_SIDE_PX: Final = 0.5
_TWICE_IOU: Final = 0.95
"""Nobody marks two things of a class so alike; two passes over the same picture mark one thing so."""
_SHARES_PX: Final = 2.0
"""No further from the corner than this lie boxes whose numbers are not pixels."""
_CONTRADICTORY_IOU: Final = 0.99
"""Of two classes: a rider and what is ridden may be nearly one box."""


@dataclass(frozen=True, slots=True, eq=False)
class CheckedBoxes:
    """Boxes of one picture that can be learned from.

    Attributes:
        xyxy_px: (N, 4) inside the picture.
        class_id: (N,).
        ignored: (N,).
        foot_px: (N, 2) ground points; inside the picture or not, NaN where none is marked.
        problems: What was dropped or mended.
    """

    xyxy_px: FloatArray
    class_id: IntArray
    ignored: BoolArray
    foot_px: FloatArray
    problems: tuple[Problem, ...]


def check_boxes(picture: SourcePicture, class_ids: Mapping[str, int | None]) -> CheckedBoxes:
    """Map the labels of a picture and mend its boxes.

    Args:
        picture: As its set marks it.
        class_ids: Of each label that is kept; None: the label's boxes are ignored regions. Others are dropped.

    Raises:
        BadPicture: One box has two classes, or all boxes are nowhere, or may be: such a picture is not one
            without things.
    """
    kept = np.array([label in class_ids for label in picture.labels], np.bool_)
    ids = [class_ids[label] for label in picture.labels if label in class_ids]
    class_id = np.array([0 if number is None else number for number in ids], np.int64)
    ignored = picture.ignored[kept] | np.array([number is None for number in ids], np.bool_)
    xyxy_px = picture.xyxy_px[kept]

    cut_px = inside(xyxy_px, picture.size_px)
    first = _first_of_each(picture, cut_px, class_id, ignored)
    real = _has_area(xyxy_px)
    visible = real & _has_area(cut_px)
    cut = visible & (np.abs(cut_px - xyxy_px).max(axis=1, initial=0.0) > _ROUNDING_PX)
    faults = (
        (~first, "box marked twice"),
        (first & ~real, "box without area"),
        (first & real & ~visible, "box outside the picture"),
        (first & cut, "box cut at the picture's edge"),
    )
    if len(xyxy_px) and np.abs(xyxy_px).max() <= _SHARES_PX < min(picture.size_px) / 8:
        found = f"all {len(xyxy_px)} boxes in the first pixels: shares of the picture where pixels are expected?"
        raise BadPicture(picture.path, found, UNPLACEABLE)
    if len(xyxy_px) and not visible.any():
        raise BadPicture(picture.path, _nowhere(xyxy_px), UNPLACEABLE)
    problems = tuple(_mended(picture, int(where.sum()), kind) for where, kind in faults if where.any())
    good = first & visible
    return CheckedBoxes(cut_px[good], class_id[good], ignored[good], picture.foot_px[kept][good], problems)


def inside(xyxy_px: FloatArray, size_px: tuple[int, int]) -> FloatArray:
    """Return (N, 4) boxes cut at the edges of a picture.

    >>> inside(np.array([[-3.0, 2.0, 9.0, 20.0]]), (8, 10)).tolist()
    [[-0.5, 2.0, 7.5, 9.5]]
    """
    return np.clip(xyxy_px, -0.5, np.tile(size_px, 2) - 0.5)


def _first_of_each(picture: SourcePicture, xyxy_px: FloatArray, class_id: IntArray, ignored: BoolArray) -> BoolArray:
    """Return False for repetitions of a box; ignored regions may repeat one."""
    first = np.ones(len(xyxy_px), np.bool_)
    for row in np.flatnonzero(~ignored).tolist():
        alike = overlaps(xyxy_px[row : row + 1], xyxy_px[:row])[0]
        same_class = class_id[:row] == class_id[row]
        if (alike[~same_class & ~ignored[:row]] >= _CONTRADICTORY_IOU).any():
            raise BadPicture(picture.path, "one box with two classes", "contradictory labels")
        first[row] = not (alike[same_class & ~ignored[:row]] >= _TWICE_IOU).any()
    return first


def _has_area(xyxy_px: FloatArray) -> BoolArray:
    return np.asarray((xyxy_px[:, 2:] - xyxy_px[:, :2]).min(axis=1, initial=np.inf) >= _MIN_SIDE_PX)


def _nowhere(xyxy_px: FloatArray) -> str:
    first = " ".join(f"{number:g}" for number in np.clip(xyxy_px[0], -1e9, 1e9).round(1))
    return f"none of its {len(xyxy_px)} boxes has an area in the picture, the first is at {first}"


def _mended(picture: SourcePicture, count: int, kind: str) -> Problem:
    return Problem(picture.path, f"{kind} ({count})", kind, skipped_picture=False)
