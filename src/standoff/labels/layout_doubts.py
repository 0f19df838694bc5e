"""Doubts that a set is in the layout that it seems to be in: all its boxes together tell what a single one cannot."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from standoff.core.errors import DataError
from standoff.core.homography import BoolArray, FloatArray
from standoff.labels.source import SourcePicture

_SLACK: Final = 0.02
"""Of the picture's sides; boxes of any layout stick out by so much."""
_COUNTING_PX: Final = 1.0
"""Between ways of counting pixels."""
_LARGEST_ID: Final = 1e9
_FEWEST_OUTSIDE: Final = 3
_SHARE_OUTSIDE: Final = 0.1
_MANY: Final = 100
"""Boxes; of more, a tenth of so many outside is enough, where none is in the other layout."""


@dataclass(frozen=True, slots=True)
class Layout:
    """What the four numbers of a box mean.

    Attributes:
        name: For people.
        to_edges: (N, 4) numbers as left, top, right, bottom edges.
        from_edges: The other way.
    """

    name: str
    to_edges: Callable[[FloatArray], FloatArray]
    from_edges: Callable[[FloatArray], FloatArray]


def _extents(xyxy: FloatArray) -> FloatArray:
    return xyxy[:, 2:] - xyxy[:, :2]


CORNERS: Final = Layout("the left and the upper, the right and the lower edge, xyxy", np.array, np.array)
"""Pascal VOC."""
CORNER_AND_EXTENT: Final = Layout(
    "the left and the upper edge, a width and a height, xywh",
    lambda xywh: np.hstack([xywh[:, :2], xywh[:, :2] + xywh[:, 2:]]),
    lambda xyxy: np.hstack([xyxy[:, :2], _extents(xyxy)]),
)
"""COCO."""
CENTRE_AND_EXTENT: Final = Layout(
    "the centre, a width and a height, cxcywh",
    lambda cxcywh: np.hstack([cxcywh[:, :2] - cxcywh[:, 2:] / 2, cxcywh[:, :2] + cxcywh[:, 2:] / 2]),
    lambda xyxy: np.hstack([(xyxy[:, :2] + xyxy[:, 2:]) / 2, _extents(xyxy)]),
)
"""YOLO."""
_LAYOUTS: Final = (CORNERS, CORNER_AND_EXTENT, CENTRE_AND_EXTENT)


def check_layout(pictures: Sequence[SourcePicture], source: Path, stated: Layout) -> None:
    """Refuse a set whose boxes lie in their pictures in another layout only.

    A box may stick out of its picture, or end before it begins, where it was badly drawn. So a single one tells only
    where the other layout is one that few numbers have by chance: edges, which must be in order. Between a centre and a
    corner several must tell.

    Args:
        pictures: Of the set.
        source: Where it is, for messages.
        stated: The layout that its kind has, in which the boxes were read.

    Raises:
        DataError: Boxes leave their pictures, and in another layout none does.
    """
    boxes, sizes = _all_boxes(pictures)
    numbers = stated.from_edges(boxes + 0.5)
    outside = ~_inside(boxes + 0.5, sizes)
    if not outside.any():
        return
    others = [other for other in _LAYOUTS if other is not stated and _inside(other.to_edges(numbers), sizes).all()]
    is_told = outside.sum() >= max(_FEWEST_OUTSIDE, _SHARE_OUTSIDE * min(len(boxes), _MANY))
    ends_early = (_extents(boxes) < 0).any()
    likely = [other for other in others if other is CORNERS or ends_early or is_told]
    if likely:
        raise DataError(
            expected=f"{stated.name}, as the numbers of the boxes in {source}",
            found="boxes that lie in their pictures only if those are " + ", or ".join(other.name for other in likely),
            fix="export them again, in the layout that the file's kind has",
        )


def check_counting(used: Collection[object], known: Collection[object], source: Path) -> None:
    """Refuse class ids that are counted from another number than the labels.

    Args:
        used: Ids of boxes.
        known: Ids of labels.
        source: Where the set is, for messages.

    Raises:
        DataError: One beyond either end is used, and the last one at the other end is not.
    """
    ids, of_labels = _numbers(used), _numbers(known)
    if not ids or not of_labels or set(ids) <= set(of_labels):
        return
    first, last = of_labels[0], of_labels[-1]
    from_one_more = ids[0] > first and ids[-1] == last + 1
    from_one_less = ids[0] == first - 1 >= 0 and ids[-1] < last  # -1 is a program's word for none
    if from_one_more or from_one_less:
        raise DataError(
            expected=f"class ids {first:g} to {last:g} in {source}, which has so many labels",
            found=f"{ids[0]:g} to {ids[-1]:g}, as if they were counted from another number",
            fix="correct the ids, or add a label for the one that is not used",
        )


def _numbers(ids: Collection[object]) -> list[float]:
    return sorted(number for number in ids if isinstance(number, (int, float)) and abs(number) < _LARGEST_ID)


def _all_boxes(pictures: Sequence[SourcePicture]) -> tuple[FloatArray, FloatArray]:
    """Return (N, 4) boxes and (N, 2) sizes of their pictures."""
    boxes = [picture.xyxy_px for picture in pictures]
    sizes = [np.tile(picture.size_px, (len(picture.xyxy_px), 1)) for picture in pictures]
    return np.concatenate([np.zeros((0, 4)), *boxes]), np.concatenate([np.zeros((0, 2)), *sizes])


def _inside(xyxy: FloatArray, size: FloatArray) -> BoolArray:
    """Tell which boxes (N, 4), counted from the picture's edge, have an area and lie in their pictures."""
    slack = _SLACK * size + _COUNTING_PX
    lies_in = (xyxy[:, :2] >= -slack).all(axis=1) & (xyxy[:, 2:] <= size + slack).all(axis=1)
    return np.asarray(lies_in & (_extents(xyxy) > 0).all(axis=1))
