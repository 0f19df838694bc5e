"""Find files in a folder and below it, through links to folders too: large data sets are often linked, not copied."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path


def files_below(folder: Path, suffixes: Collection[str]) -> Iterator[Path]:
    """Yield the files in a folder and below it whose names end so, but nothing hidden, in the order of their paths.

    Args:
        folder: Where to look; in what is no folder there are no files. Each folder is gone through once, though
            several links lead to it, or one leads back.
        suffixes: In small letters, as `{".txt"}`.
    """
    return _below(folder, suffixes, set()) if folder.is_dir() else iter(())


def _below(folder: Path, suffixes: Collection[str], seen: set[Path]) -> Iterator[Path]:
    here = folder.resolve()
    if here in seen:
        return
    seen.add(here)
    for path in sorted(path for path in folder.iterdir() if not path.name.startswith(".")):
        if path.is_dir():
            yield from _below(path, suffixes, seen)
        elif path.suffix.lower() in suffixes:
            yield path
