"""What a data.yaml says of itself: does it hang together, and is every split under a name that is read?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final

from standoff.core.errors import DataError
from standoff.labels.source import split_named
from standoff.labels.strays import plain
from standoff.labels.yolo_rows import KeypointShape

SPLIT_KEYS: Final = ("train", "val", "valid", "validation", "test")
"""In the order in which they are read; `validation` as Ultralytics takes it."""
_OTHER_KEYS: Final = ("names", "nc", "path", "kpt_shape")
_ALIKE: Final = 0.65
"""Of difflib: `vla` and `val`, `tset` and `test` are as like as that; `minival` is no `val`."""


def check_keys(content: Mapping[str, Any], path: Path) -> None:
    """Refuse a key that is nearly one that is read: what it holds would be passed over.

    Raises:
        DataError: Names the key that is likely meant.
    """
    for key, value in content.items():
        if str(key) in (*SPLIT_KEYS, *_OTHER_KEYS):
            continue
        meant = _meant(str(key), value)
        if meant is not None:
            raise DataError(
                expected=f"the keys {', '.join((*SPLIT_KEYS, *_OTHER_KEYS))} in {path}",
                found=f"`{key}`, which is not read",
                fix=f"write `{meant}` if that is meant, or remove it",
            )


def _meant(key: str, value: object) -> str | None:
    """Return the key that was likely meant; None where it is some other one."""
    same = [known for known in (*SPLIT_KEYS, *_OTHER_KEYS) if plain(known) == plain(key)]
    if same:
        return same[0]
    places = value if isinstance(value, list) else [value]
    if not all(isinstance(place, str) and place for place in places):
        return None
    words = key.lower().replace("-", "_").replace(" ", "_").split("_")
    named = [split for word in words if (split := split_named(word)) is not None]
    return next(iter([*named, *get_close_matches(key.lower(), SPLIT_KEYS, n=1, cutoff=_ALIKE)]), None)


def check_count(count: object, labels: Sequence[str], path: Path) -> None:
    """Refuse another number of classes than of names: some name is missing, or one too many.

    Args:
        count: `nc`; None: not said.
        labels: Names by class id.
        path: Of the file, for messages.

    Raises:
        DataError: They differ.
    """
    if count is None or (not isinstance(count, bool) and str(count).strip() == str(len(labels))):
        return
    raise DataError(
        expected=f"as many `names` as `nc` says in {path}",
        found=f"nc {count} and {len(labels)} names ({', '.join(labels[:10])})",
        fix="correct the one that is wrong",
    )


def keypoints_of(shape: object, path: Path) -> KeypointShape | None:
    """Return what `kpt_shape` says; None where nothing is said.

    Raises:
        DataError: It is something else.
    """
    if shape is None:
        return None
    match shape:
        case [int(number), 2 | 3 as each] if number > 0 and not isinstance(number, bool):
            return number, int(each)
    raise DataError(
        expected=f"`kpt_shape` in {path}: how many keypoints, and 2 or 3 values of each",
        found=repr(shape),
        fix="correct it",
    )
