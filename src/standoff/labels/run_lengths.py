"""Masks of COCO as lengths of runs, column by column: so many pixels without, so many with, and so on.

As a list of numbers, or as a text of five bits a letter in which, from the fourth on, a number is the difference from
the one two before it (pycocotools, `rleToString`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from standoff.core.homography import FloatArray
from standoff.files.number_lists import number_array

_FIRST_LETTER: Final = 48
_BITS: Final = 5
_MORE: Final = 0x20
_SIGN: Final = 0x10
_LONGEST: Final = 6
"""Letters of one number."""


def box_of_runs(mask: Mapping[str, Any]) -> FloatArray | None:
    """Return (4,) left, top, right, bottom edges of what a mask holds, in pixels from the picture's edge.

    Args:
        mask: `size` (height, width) and `counts`.

    Returns:
        None: The mask is empty, or damaged: its runs do not fill its picture.

    >>> box_of_runs({"size": [4, 3], "counts": [5, 2, 5]}).tolist()
    [1.0, 1.0, 2.0, 3.0]
    >>> box_of_runs({"size": [4, 3], "counts": "525"}).tolist()
    [1.0, 1.0, 2.0, 3.0]
    """
    try:
        height_px, width_px = number_array(mask.get("size"), 1).tolist()
        counts = mask.get("counts")
        runs = number_array(_numbers(counts) if isinstance(counts, str) else counts, 1)
    except ValueError:
        return None
    if not len(runs) or not (runs >= 0).all() or runs.sum() != height_px * width_px:
        return None
    ends = np.cumsum(runs)[1::2]
    starts = ends - runs[1::2]
    starts, ends = starts[ends > starts], ends[ends > starts]
    if not len(starts):
        return None
    left, right = starts.min() // height_px, (ends.max() - 1) // height_px
    if (starts // height_px < (ends - 1) // height_px).any():  # a run goes on at the top of the next column
        return np.array([left, 0.0, right + 1, height_px])
    return np.array([left, (starts % height_px).min(), right + 1, ((ends - 1) % height_px).max() + 1])


def _numbers(text: str) -> Sequence[int]:
    """Return what a text of run lengths says.

    Raises:
        ValueError: It ends within a number, or has other letters.
    """
    numbers: list[int] = []
    value, letters = 0, 0
    for letter in text:
        bits = ord(letter) - _FIRST_LETTER
        if not 0 <= bits < 2 * _MORE or letters == _LONGEST:
            raise ValueError("no run lengths")
        value |= (bits & (_MORE - 1)) << (_BITS * letters)
        letters += 1
        if not bits & _MORE:
            if bits & _SIGN:
                value -= 1 << (_BITS * letters)
            numbers.append(value + (numbers[-2] if len(numbers) > 2 else 0))
            value, letters = 0, 0
    if letters:
        raise ValueError("run lengths that end within a number")
    return numbers
