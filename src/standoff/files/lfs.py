"""Tell a Git LFS pointer from the file that it stands for."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from standoff.core.errors import StandoffError

POINTER: Final = "a Git LFS pointer, not the file"
FETCH: Final = "run `git lfs pull` in its repository, or download the file itself"
_BEGINNING: Final = b"version https://git-lfs.github.com/spec/"


def is_pointer(path: Path) -> bool:
    """Tell whether a file only says which file Git LFS would put in its place; what cannot be read is none.

    Source:
        Git LFS specification: the first line of every pointer is its version.
    """
    try:
        with path.open("rb") as file:
            return file.read(len(_BEGINNING)) == _BEGINNING
    except OSError:
        return False


def refuse_pointer(path: Path, expected: str, error: type[StandoffError]) -> None:
    """Refuse a pointer.

    Args:
        path: Of the file.
        expected: What it should be, for the message.
        error: What to raise.

    Raises:
        StandoffError: It is one.
    """
    if is_pointer(path):
        raise error(expected=expected, found=POINTER, fix=FETCH)
