"""Digests by which files are known again: of all of a file, or of a source of pictures without reading all of it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

_PART_BYTES: Final = 65_536
"""Of the first and the last file: in a video they hold the table of its pictures or the first of them."""


def fingerprint(files: Sequence[Path]) -> str:
    """Return a digest of the files' sizes, of how the first one begins and of how the last one ends.

    Args:
        files: One video, or the pictures of a folder in their order.
    """
    digest = hashlib.sha256()
    for file in files:
        digest.update(f"{file.stat().st_size} ".encode())
    with files[0].open("rb") as first:
        digest.update(first.read(_PART_BYTES))
    with files[-1].open("rb") as last:
        last.seek(max(0, files[-1].stat().st_size - _PART_BYTES))
        digest.update(last.read(_PART_BYTES))
    return digest.hexdigest()


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's content, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digests(files: Mapping[str, Path]) -> dict[str, str]:
    """Return the SHA-256 of each of some files, by the same names; of one that cannot be read, nothing."""
    found = {}
    for name, path in files.items():
        with suppress(OSError):
            found[name] = file_sha256(path)
    return found
