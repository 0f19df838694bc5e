"""Boxes of COCO's annotations, compared with what else an annotation says of its extent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from standoff.core.homography import FloatArray
from standoff.labels.source import UNPLACEABLE, BadPicture

_Entry = Mapping[str, Any]
_ROUNDING_PX: Final = 2.0
"""Between a box and its own outline."""
_ROUNDING_SHARE: Final = 0.02
_LARGEST_PX2: Final = 1e12


def read_bboxes(boxes: Sequence[_Entry], path: Path) -> FloatArray:
    """Return (N, 4) left, top, right, bottom of annotations, in pixels from the picture's edge.

    An annotation without `bbox` has the box around its polygons.

    Args:
        boxes: Annotations of one picture.
        path: Of the picture, for messages.

    Raises:
        BadPicture: A box is not four numbers, or contradicts its own outline.
    """
    outlines = [_outline(box) for box in boxes]
    try:
        given = [_bbox(box, outline) for box, outline in zip(boxes, outlines, strict=True)]
        xywh = np.array(given, dtype=np.float64).reshape(len(boxes), 4)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise BadPicture(path, "an annotation whose bbox is not four numbers", "unreadable labels") from error
    if not np.isfinite(xywh).all():
        raise BadPicture(path, "a number that is not finite", "unreadable labels")
    if len(boxes) and all(
        _are_corners(numbers, box, outline) for numbers, box, outline in zip(xywh, boxes, outlines, strict=True)
    ):
        found = "boxes around whose own outlines the last two numbers are the right and the lower edge: xyxy, not xywh?"
        raise BadPicture(path, found, UNPLACEABLE)
    xyxy = xywh.copy()
    xyxy[:, 2:] += xywh[:, :2]
    return xyxy


def _bbox(box: _Entry, outline: FloatArray | None) -> Sequence[float]:
    if outline is not None and not box.get("bbox"):
        return [*outline[:2].tolist(), *(outline[2:] - outline[:2]).tolist()]
    return box["bbox"]  # type: ignore[no-any-return]


def _outline(box: _Entry) -> FloatArray | None:
    """Return (4,) left, top, right, bottom of an annotation's polygons; None where it has none that can be read."""
    polygons = box.get("segmentation")
    if not isinstance(polygons, list) or not polygons:
        return None
    try:
        points = np.concatenate([np.array(polygon, np.float64).reshape(-1, 2) for polygon in polygons])
    except (TypeError, ValueError, OverflowError):
        return None
    if not len(points) or not np.isfinite(points).all():
        return None
    return np.concatenate([points.min(axis=0), points.max(axis=0)])


def _are_corners(numbers: FloatArray, box: _Entry, outline: FloatArray | None) -> bool:
    """Tell whether a box is where its outline is, or as large as its area, only if its numbers are corners."""
    extent = numbers[2:] - numbers[:2]
    if (extent <= 0).any():
        return False
    if outline is not None:
        read = np.concatenate([numbers[:2], numbers[:2] + numbers[2:]])
        return bool(np.abs(numbers - outline).max() <= _ROUNDING_PX < np.abs(read - outline).max())
    area = box.get("area")
    if not isinstance(area, (int, float)) or not 0 < area < _LARGEST_PX2:
        return False
    as_corners, as_read = float(extent.prod()), float(numbers[2:].prod())
    return abs(as_corners - area) <= _ROUNDING_SHARE * area < abs(as_read - area)
