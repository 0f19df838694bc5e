"""Boxes of COCO's annotations, compared with what else an annotation says of its extent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from standoff.core.homography import FloatArray
from standoff.files.number_lists import number_array
from standoff.labels.layout_doubts import CENTRE_AND_EXTENT, CORNER_AND_EXTENT, CORNERS, Layout
from standoff.labels.run_lengths import box_of_runs
from standoff.labels.source import UNPLACEABLE, BadPicture

_Entry = Mapping[str, Any]
_SIDES: Final = 4
_FEWEST_NUMBERS: Final = 6
"""Of a polygon, x and y in turn."""
_ROUNDING_PX: Final = 2.0
"""Between a box and its own outline."""
_ROUNDING_SHARE: Final = 0.02
_LARGEST_PX2: Final = 1e12


def read_bboxes(boxes: Sequence[_Entry], path: Path) -> FloatArray:
    """Return (N, 4) left, top, right, bottom of annotations, in pixels from the picture's edge.

    An annotation without `bbox` has the box around its outline.

    Args:
        boxes: Annotations of one picture.
        path: Of the picture, for messages.

    Raises:
        BadPicture: A box is not four numbers, or contradicts its own outline.
    """
    outlines = [_outline(box) for box in boxes]
    try:
        given = [_bbox(box, outline) for box, outline in zip(boxes, outlines, strict=True)]
    except ValueError as error:
        raise BadPicture(path, f"an annotation whose bbox is not four numbers: {error}", "unreadable labels") from error
    xywh = np.array(given).reshape(len(boxes), _SIDES)
    if not np.isfinite(xywh).all():
        raise BadPicture(path, "a number that is not finite", "unreadable labels")
    for other in (CORNERS, CENTRE_AND_EXTENT):
        if len(boxes) and all(
            _is_only(other, numbers, box, outline) for numbers, box, outline in zip(xywh, boxes, outlines, strict=True)
        ):
            found = f"boxes that are around their own outlines only if their numbers are {other.name}, not xywh"
            raise BadPicture(path, found, UNPLACEABLE)
    return CORNER_AND_EXTENT.to_edges(xywh)


def _bbox(box: _Entry, outline: FloatArray | None) -> FloatArray:
    if outline is not None and not box.get("bbox"):
        return np.concatenate([outline[:2], outline[2:] - outline[:2]])
    numbers = number_array(box.get("bbox"), 1, texts=True)
    if len(numbers) != _SIDES:
        raise ValueError(f"{len(numbers)} numbers")
    return numbers


def _outline(box: _Entry) -> FloatArray | None:
    """Return (4,) left, top, right, bottom of an annotation's polygons or mask; None: none that is whole."""
    marked = box.get("segmentation")
    if isinstance(marked, Mapping):
        return box_of_runs(marked)
    if not isinstance(marked, list) or not marked:
        return None
    try:
        polygons = [number_array(polygon, 1) for polygon in marked]
    except ValueError:
        return None
    if any(len(polygon) < _FEWEST_NUMBERS or len(polygon) % 2 for polygon in polygons):
        return None
    points = np.concatenate(polygons).reshape(-1, 2)
    if not np.isfinite(points).all():
        return None
    return np.concatenate([points.min(axis=0), points.max(axis=0)])


def _is_only(other: Layout, numbers: FloatArray, box: _Entry, outline: FloatArray | None) -> bool:
    """Tell whether a box is where its outline is, or as large as its area, only if its numbers mean something else."""
    as_other, as_read = (layout.to_edges(numbers[None])[0] for layout in (other, CORNER_AND_EXTENT))
    if (as_other[2:] <= as_other[:2]).any():
        return False
    if outline is not None:
        return bool(np.abs(as_other - outline).max() <= _ROUNDING_PX < np.abs(as_read - outline).max())
    area = box.get("area")
    if isinstance(area, bool) or not isinstance(area, (int, float)) or not 0 < area < _LARGEST_PX2:
        return False
    of_other, of_read = (float((one[2:] - one[:2]).prod()) for one in (as_other, as_read))
    return abs(of_other - area) <= _ROUNDING_SHARE * area < abs(of_read - area)
