"""Whether two runs are one: of the same film, with the same settings, files and standoff."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from standoff import __version__
from standoff.config import Settings, named_files, resolved
from standoff.core.errors import ConfigError
from standoff.core.outputs import RECORD_FILE
from standoff.files.fingerprint import digests
from standoff.files.json_text import json_text, plain, read_json
from standoff.stages.frames import open_source

_OF_THE_SOURCE: Final = ("fingerprint", "telemetry")
"""What makes a film, with the log beside it, another one."""


def other_means(
    record: Mapping[str, Any], settings: Settings, files: Mapping[str, str], version: str = __version__
) -> str:
    """Return by what else than these a run was made; empty: by nothing.

    Args:
        record: Of the run.
        settings: To be compared.
        files: SHA-256 of each file that the settings name.
        version: Of standoff.
    """
    before, now = _that_matter(record.get("settings") or {}), _that_matter(plain(resolved(settings)))
    for name in sorted(before.keys() | now.keys()):
        if before.get(name) != now.get(name):
            return f"setting `{name}`"
    recorded = record.get("files") or {}
    for name in sorted(recorded.keys() | files.keys()):
        if recorded.get(name) != files.get(name):
            return f"content of the file that `{name}` names"
    return "" if record["versions"]["standoff"] == version else "version of standoff"


def other_film(record: Mapping[str, Any], film: Path, settings: Settings) -> str:
    """Return by what a film, or the flight log beside it, is not the one of a run; empty: it is.

    Raises:
        SourceError: It cannot be read.
    """
    with open_source(film, **asdict(settings.source)) as source:
        now = plain(source.describe())
    is_same = all(record["source"].get(name) == now[name] for name in _OF_THE_SOURCE)
    return "" if is_same else "film of this name, or flight log"


def looks_name(source: Mapping[str, Any], settings: Settings, files: Mapping[str, str]) -> str:
    """Return the name under which a run keeps what its detector saw: another for all that is not the same run.

    Args:
        source: The source's description.
        settings: Of the run.
        files: SHA-256 of each file that the settings name.
    """
    film = {name: source.get(name) for name in _OF_THE_SOURCE}
    means = {"film": film, "settings": _that_matter(resolved(settings)), "files": files, "version": __version__}
    return hashlib.sha256(json_text(plain(means)).encode()).hexdigest()[:16]


def check_resumable(film: Path, out: Path, settings: Settings) -> None:
    """Refuse to go on where there is nothing to go on with.

    Raises:
        ConfigError: The folder holds no run that was cut short, or one of another film, settings, files or version.
        StandoffError: Its record or the film cannot be read.
    """
    path = out / RECORD_FILE
    record = read_json(path, "a run's record") if path.is_file() else None
    if record is None or record.get("status") == "complete":
        raise ConfigError(
            expected=f"a run in {out} that was cut short",
            found="none" if record is None else "one that is complete",
            fix="leave --resume out",
        )
    other = other_means(record, settings, digests(named_files(settings))) or other_film(record, film, settings)
    if other:
        raise ConfigError(
            expected=f"the film and the settings of the run in {out} that was cut short",
            found=f"another {other}",
            fix="give the same ones, or pass --overwrite instead of --resume to begin again",
        )


def _that_matter(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings without the one that makes a run quicker and no other."""
    return {
        **settings,
        "detect": {name: value for name, value in settings.get("detect", {}).items() if name != "intra_op_threads"},
    }
