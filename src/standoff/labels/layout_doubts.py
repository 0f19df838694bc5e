"""Doubts that a set is in the layout that it seems to be in: all its boxes together tell what a single one cannot."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from standoff.core.errors import DataError
from standoff.core.homography import BoolArray, FloatArray
from standoff.labels.source import SourcePicture

_SLACK: Final = 0.02
"""Of the picture's sides; boxes of any layout stick out by so much."""
_LARGEST_ID: Final = 1e9


def check_not_corners(pictures: Sequence[SourcePicture], source: Path, *, centred: bool) -> None:
    """Refuse boxes whose width and height are really their right and lower edge.

    Args:
        pictures: Of the set.
        source: Where it is, for messages.
        centred: Whether the first two numbers are the box's centre (YOLO); else its upper left corner (COCO).

    Raises:
        DataError: As corners all boxes lie in their pictures; as they are read some do not.
    """
    xyxy, size = _all_boxes(pictures)
    second = xyxy[:, 2:] - xyxy[:, :2]
    first = xyxy[:, :2] + 0.5 + (second / 2 if centred else 0.0)
    as_corners = _inside(np.hstack([first, second]), size) & (second > first).all(axis=1)
    if as_corners.all() and not _inside(xyxy + 0.5, size).all():
        raise _other_layout(source, "a width and a height", "the right and the lower edge, xyxy")


def check_not_extents(pictures: Sequence[SourcePicture], source: Path) -> None:
    """Refuse boxes whose right and lower edge are really their width and height.

    Raises:
        DataError: Some end before they begin, and with widths and heights all lie in their pictures.
    """
    xyxy, size = _all_boxes(pictures)
    end_early = (xyxy[:, 2:] < xyxy[:, :2]).any()
    if end_early and _inside(np.hstack([xyxy[:, :2], xyxy[:, :2] + xyxy[:, 2:]]), size).all():
        raise _other_layout(source, "the right and the lower edge", "a width and a height, xywh")


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
    """Tell which boxes (N, 4), counted from the picture's edge, lie in their pictures."""
    slack = _SLACK * size
    return np.asarray((xyxy[:, :2] >= -slack).all(axis=1) & (xyxy[:, 2:] <= size + slack).all(axis=1))


def _other_layout(source: Path, expected: str, found: str) -> DataError:
    return DataError(
        expected=f"{expected} as the last two numbers of the boxes in {source}",
        found=f"boxes that lie in their pictures only if those are {found}",
        fix="export them again, in the layout that the file's kind has",
    )
