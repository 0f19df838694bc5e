"""The film that a run was made from: its name and digest are in the record, where it lies nobody said."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from standoff.core.errors import ConfigError, StandoffError
from standoff.stages.frames import open_source


def film_of_run(
    folder: Path, source: Mapping[str, Any], given: Path | None, fps: float | None
) -> tuple[Path | None, str]:
    """Return the film, and why there is none.

    Args:
        folder: Of the run.
        source: What the run's record says of its source.
        given: Where somebody says that it is; None: beside the run, or where we are.
        fps: Pictures a second, as the run was told; None: it was not.

    Raises:
        StandoffError: What was given cannot be read, or is another film.
    """
    if given is not None:
        found = _fingerprint(given, fps)
        if source.get("fingerprint") not in (None, found):
            raise ConfigError(
                expected=f"the film of {folder}, {source.get('name')}", found=f"another one at {given}", fix="name it"
            )
        return given, ""
    name = source.get("name")
    if not name or not source.get("fingerprint"):
        return None, "the run does not tell which film it is of"
    for path in _places(folder, str(name)):
        try:
            if _fingerprint(path, fps) == source["fingerprint"]:
                return path, ""
        except StandoffError:
            continue
    return None, f"{name} is neither beside the run nor here: name it with --film"


def _places(folder: Path, name: str) -> Iterator[Path]:
    near = (folder.resolve().parent, folder.resolve(), Path.cwd())
    return (path for path in dict.fromkeys(place / name for place in near) if path.exists())


def _fingerprint(path: Path, fps: float | None) -> str | None:
    with open_source(path, fps=fps) as opened:
        digest = opened.describe().get("fingerprint")
        return None if digest is None else str(digest)
