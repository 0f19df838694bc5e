"""The settings of a site that several cameras watch: what they share, and in what each differs."""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from standoff.config.load import anchor_paths, read_settings_file, settings_from
from standoff.config.settings import Settings
from standoff.core.errors import ConfigError

_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
"""Names of streams stand in topics, addresses and file names."""
_PARTS: Final = ("defaults", "streams")


@dataclass(frozen=True, slots=True)
class StreamSettings:
    """One stream of a site.

    Attributes:
        address: Where its pictures come from: a file, or an address.
        settings: Of its monitor, the site's defaults filled in.
    """

    address: str
    settings: Settings


@dataclass(frozen=True, slots=True)
class SiteSettings:
    """All streams of a site.

    Attributes:
        defaults: What holds for a stream that says nothing else.
        streams: By name.
    """

    defaults: Settings
    streams: Mapping[str, StreamSettings]


def load_site(path: Path | str) -> SiteSettings:
    """Read the settings of a site.

    The file has two parts: `defaults`, settings as for `load_settings`, and `streams`, by name: each an `address` and
    whatever settings differ from the defaults. Paths are relative to the file; the environment wins over both.

    Raises:
        ConfigError: It cannot be read, has no stream, or a stream is not as it should be; all of it is checked at once.
    """
    path = Path(path)
    content = read_settings_file(path)
    unknown = sorted(content.keys() - set(_PARTS))
    defaults, streams = content.get("defaults") or {}, content.get("streams")
    if unknown or not isinstance(defaults, dict) or not isinstance(streams, dict) or not streams:
        found = f"{', '.join(map(str, unknown))} at the top level" if unknown else "no stream by name"
        raise ConfigError(
            expected=f"`defaults` and `streams` in {path}",
            found=found,
            fix="write what all streams share below `defaults`, and below `streams` a name with an `address` for each",
        )
    anchor_paths(defaults, path.parent)
    return SiteSettings(
        settings_from(defaults, f"{path}: defaults"),
        {str(name): _stream(str(name), given, defaults, path) for name, given in streams.items()},
    )


def _stream(name: str, given: object, defaults: Mapping[str, Any], path: Path) -> StreamSettings:
    where = f"{path}: streams.{name}"
    if _NAME.fullmatch(name) is None:
        raise ConfigError(
            expected=f"names of streams of letters, digits, - and _ in {path}", found=repr(name), fix="name it anew"
        )
    if not isinstance(given, dict) or not isinstance(given.get("address"), str) or not given["address"]:
        raise ConfigError(expected=f"an `address` in {where}", found="none", fix="say where its pictures come from")
    own = {key: value for key, value in given.items() if key != "address"}
    anchor_paths(own, path.parent)
    return StreamSettings(given["address"], settings_from(_merged(defaults, own), where))


def _merged(defaults: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Return the defaults with what differs: sections are merged, everything else is replaced."""
    merged = copy.deepcopy(dict(defaults))
    for key, value in own.items():
        before = merged.get(key)
        merged[key] = _merged(before, value) if isinstance(before, dict) and isinstance(value, dict) else value
    return merged
