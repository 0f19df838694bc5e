"""Lines of YOLO's label files: a class, and a box, a polygon, a turned box or keypoints beside a box.

| values | what |
|---|---|
| 5 | class, box |
| 8 | class, box, one keypoint: x, y, visibility |
| 5 + 2 K or 5 + 3 K | class, box, K keypoints, where data.yaml has `kpt_shape: [K, 2]` or `[K, 3]` |
| 5 + 3 K | the same without `kpt_shape`, where every third value is a visibility, 0, 1 or 2 |
| 1 + 2 M, M 3 or more | class, corners of a polygon; M is 4 for a turned box |

All but class and visibility are shares of the picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from standoff.core.homography import FloatArray

KeypointShape = tuple[int, int]
"""How many keypoints, and values of each: 2, or 3 with a visibility."""

_BOX, _BOX_AND_POINT = 5, 8
_FARTHEST: Final = 2.0
"""From the picture's edge, in its sides: labels of things that stick out end well before."""


class Unplaceable(ValueError):
    """Numbers that are no shares of a picture; says which."""


def read_rows(text: str, keypoints: KeypointShape | None = None) -> FloatArray:
    """Return (N, 7): class, centre and extent of the box, and a keypoint, NaN where none is marked.

    Polygons and turned boxes give the box around them. Several keypoints tell nothing of where a thing stands; a
    single one is its ground point.

    Args:
        text: Of a label file; an empty one has no rows.
        keypoints: What data.yaml says of them.

    Raises:
        Unplaceable: Numbers are no shares.
        ValueError: Something else is written there; says what.

    >>> read_rows("0 0.1 0.1 0.4 0.1 0.4 0.4 0.1 0.4")[0, :5].tolist()
    [0.0, 0.25, 0.25, 0.30000000000000004, 0.30000000000000004]
    """
    rows = [row for line in text.splitlines() if (row := line.split())]
    _check_end(text, [len(row) for row in rows])
    numbers = [_read(row, keypoints) for row in rows]
    return np.array(numbers, np.float64).reshape(-1, 7)


def _check_end(text: str, counts: Sequence[int]) -> None:
    """Refuse a last line that ends before its like: cut short, a polygon may read as a smaller one, or as a box."""
    *others, last = counts or [0]
    if others and not text.endswith("\n") and set(others) == {max(others)} and last < others[0]:
        raise ValueError(f"a last line of {last} values after lines of {others[0]}: cut off")


def _read(row: Sequence[str], keypoints: KeypointShape | None) -> list[float]:
    try:
        values = np.array(row, np.float64)
    except ValueError as error:
        raise ValueError(f"not a number ({error})") from error
    if not np.isfinite(values).all():
        raise ValueError("a number that is not finite")
    if _has_box(values, keypoints):
        box, point = values[1:5], _point(values, keypoints)
    else:
        corners = values[1:].reshape(-1, 2)
        first, last = corners.min(axis=0), corners.max(axis=0)
        box, point = np.concatenate([(first + last) / 2, last - first]), [np.nan, np.nan]
    if np.abs(box).max() > _FARTHEST:
        said = " ".join(row[1:5])
        raise Unplaceable(f"{said}, where shares of the picture from 0 to 1 should be: are they pixels, or per cent?")
    return [values[0], *box.tolist(), *point]


def _has_box(values: FloatArray, keypoints: KeypointShape | None) -> bool:
    """Tell a box, with keypoints or without, from the corners of a polygon.

    Raises:
        ValueError: It is neither, or may be both.
    """
    count = len(values)
    if count == _BOX:
        return True
    if keypoints is not None:
        number, each = keypoints
        if count != _BOX + number * each:
            raise ValueError(f"a line of {count} values instead of {_BOX + number * each}, for {number} keypoints")
        return True
    may_be_polygon = count >= 7 and count % 2 == 1
    seen = set(values[7::3].tolist()) if count > _BOX and (count - _BOX) % 3 == 0 else {np.nan}
    if seen <= {0.0, 1.0, 2.0} and not (may_be_polygon and 2.0 not in seen):
        return True
    if not may_be_polygon:
        detected = " (do they end with a detector's confidence?)" if count == _BOX + 1 else ""
        raise ValueError(f"a line of {count} values instead of {_BOX}{detected}")
    if seen <= {0.0, 1.0}:
        raise ValueError(f"a line of {count} values, a polygon or keypoints: write `kpt_shape` into data.yaml")
    return False


def _point(values: FloatArray, keypoints: KeypointShape | None) -> list[float]:
    is_single = keypoints[0] == 1 if keypoints is not None else len(values) == _BOX_AND_POINT
    if len(values) == _BOX or not is_single or (len(values) == _BOX_AND_POINT and values[7] == 0.0):
        return [np.nan, np.nan]
    return [float(values[5]), float(values[6])]
