"""Yes and no as labelling programs write them."""

from __future__ import annotations

from typing import Final

_YES: Final = frozenset({"1", "1.0", "true", "yes", "t", "y"})
_NO: Final = frozenset({"", "0", "0.0", "false", "no", "f", "n", "none", "null", "unspecified"})
"""The last is what Pascal VOC's own files have where nobody said."""


def is_true(value: object) -> bool:
    """Return what a value means that says whether something holds; nothing, and what nobody specified, is no.

    Raises:
        ValueError: It is neither yes nor no.

    >>> [is_true(value) for value in (True, 1, "1", " True ", 0, "0", "false", None, "Unspecified")]
    [True, True, True, True, False, False, False, False, False]
    """
    said = "" if value is None else str(value).strip().lower()
    if said not in _YES | _NO:
        raise ValueError(f"{str(value)[:30]!r}, neither yes nor no")
    return said in _YES
