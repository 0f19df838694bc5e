"""Find the files that labels name, also where their paths are those of another computer."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from standoff.labels.source import ELSEWHERE, split_named
from standoff.labels.types import Problem

_LEADS_OUT = re.compile(r"[A-Za-z]:|[/~\\]|\.\.")


def readings_of(text: str) -> Iterator[str]:
    r"""Yield what a path may mean here, the likeliest first.

    As written; of Windows; then, where it leads out of the set, ever less of it, since C:\\Users\\me\\set\\images,
    /content/set/images (Colab) and /data/local-files/?d=images (Label Studio) are folders of another computer. What
    names a split is never left away.

    >>> list(readings_of("/content/set/train/images"))
    ['/content/set/train/images', 'content/set/train/images', 'set/train/images', 'train/images']
    """
    yield text
    slashed = text.rpartition("?d=")[2].replace("\\", "/")
    if slashed != text:
        yield slashed
    if not _LEADS_OUT.match(text):
        return
    parts = [part for part in re.sub(r"^[A-Za-z]:", "", slashed).split("/") if part not in ("", ".", "..")]
    for start in range(len(parts)):
        shorter = "/".join(parts[start:])
        if shorter not in (text, slashed):
            yield shorter
        if split_named(parts[start]) and not any(split_named(part) for part in parts[start + 1 :]):
            return


def find_named(
    text: str, folders: Sequence[Path], exists: Callable[[Path], bool] = Path.is_file
) -> tuple[Path, str | None]:
    """Return what a path in labels means.

    Args:
        text: As written.
        folders: It may be relative to.
        exists: What to look for.

    Returns:
        The path, and the reading of the text that found it, None where it was found as written. Where nothing is
        found: the first path, as written.
    """
    for reading in readings_of(text):
        found = first_there([folder / reading for folder in folders], exists)
        if found is not None:
            return found, None if reading == text else reading
    return folders[0] / text, None


def first_there(candidates: Iterable[Path], exists: Callable[[Path], bool] = Path.is_file) -> Path | None:
    """Return the first of some paths that exists."""
    for candidate in candidates:
        # a name out of a damaged label file may be too long to be looked for
        with suppress(OSError, ValueError):
            if exists(candidate):
                return candidate
    return None


def elsewhere(path: Path, text: str, reading: str | None) -> tuple[Problem, ...]:
    """Return a note where a path did not mean what it says."""
    if reading is None:
        return ()
    return (Problem(path, f"'{text}' is not there; read {reading}", ELSEWHERE, skipped_picture=False),)
