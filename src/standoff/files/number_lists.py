"""Lists of numbers in other people's YAML and JSON, as arrays of exactly the levels that they are expected to have."""

from __future__ import annotations

import numpy as np

from standoff.core.homography import FloatArray


def number_array(value: object, axes: int, *, texts: bool = False) -> FloatArray:
    """Return a number (no axes), a list of numbers (one), or a list of lists (two) as an array.

    Args:
        value: As a file's language gives it.
        axes: Levels of lists; another number of levels is another meaning, and never folded into this one.
        texts: Whether a number may be written as text.

    Raises:
        ValueError: It is something else; says what. True and false are no numbers, nor is nothing.

    >>> number_array([[1, 2.5]], 2).tolist()
    [[1.0, 2.5]]
    >>> number_array([True, 690], 1)
    Traceback (most recent call last):
        ...
    ValueError: true or false where a number should be
    """
    if _has_boolean(value, axes):
        raise ValueError("true or false where a number should be")
    try:
        array = np.array(value)
    except ValueError:
        raise ValueError("rows of different lengths") from None
    if array.dtype.kind not in ("iufU" if texts else "iuf"):
        raise ValueError("something else than numbers")
    if array.ndim != axes:
        raise ValueError(f"lists of {array.ndim} levels where {axes} should be")
    return array.astype(np.float64)


def _has_boolean(value: object, levels: int) -> bool:
    """Tell whether true or false is among numbers: NumPy takes them for 1 and 0."""
    if not isinstance(value, (list, tuple)):
        return isinstance(value, bool)
    if levels > 1:
        return any(_has_boolean(one, levels - 1) for one in value)
    return bool in set(map(type, value))
