"""The settings of a site that several cameras watch: what they share, in what each differs, and who is told."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ValidationError

from standoff.config.build import build_zones
from standoff.config.live import NAME, BrokerSettings, CaptureSettings, LiveSettings
from standoff.config.load import anchor_paths, config_error, read_settings_file, settings_from
from standoff.config.secret import FOLDER, Secret
from standoff.config.settings import Settings
from standoff.core.errors import ConfigError, SourceError
from standoff.stages.frames import LiveAddress

_PARTS: Final = ("defaults", "streams")

Part = TypeVar("Part", bound=BaseModel)


@dataclass(frozen=True, slots=True)
class StreamSettings:
    """One stream of a site.

    Attributes:
        address: Where its pictures come from: see `LiveAddress`.
        capture: How they come.
        settings: Of its monitor, the site's defaults filled in.
    """

    address: str
    capture: CaptureSettings
    settings: Settings

    @property
    def live_address(self) -> LiveAddress:
        """Where its pictures come from, with credentials."""
        capture = self.capture
        password = "" if capture.password is None else capture.password.value
        return LiveAddress.read(self.address, capture.user, password, capture.ca_file)


@dataclass(frozen=True, slots=True)
class SiteSettings:
    """All streams of a site, and who is told.

    Attributes:
        defaults: What holds for a stream that says nothing else.
        streams: By name.
        live: All else.
    """

    defaults: Settings
    streams: Mapping[str, StreamSettings]
    live: LiveSettings

    @property
    def secrets(self) -> tuple[str, ...]:
        """All secrets that the settings name; never to be shown."""
        live = self.live
        held: list[Secret | None] = [one.capture.password for one in self.streams.values()]
        held += [live.broker.password, *(part for one in live.notify for part in (one.apprise, one.secret))]
        return tuple(one.value for one in held if one is not None)


def is_site(content: Mapping[str, Any]) -> bool:
    """Tell whether settings are those of a site, and not of one run."""
    return "streams" in content


def load_site(path: Path | str) -> SiteSettings:
    """Read the settings of a site.

    The file has `streams`, by name: each an `address`, what `CaptureSettings` has, and whatever settings differ from
    `defaults`, which are settings as for `load_settings`; and all that `LiveSettings` has. Paths are relative to the
    file; the environment wins over streams and defaults.

    Raises:
        ConfigError: It cannot be read, has no stream, or something in it is not as it should be; all of it is checked
            at once, and what one part says of another, too.
    """
    path = Path(path)
    content = read_settings_file(path)
    known = (*_PARTS, *LiveSettings.model_fields)
    unknown = sorted(str(name) for name in content if name not in known)
    defaults, streams = content.get("defaults") or {}, content.get("streams")
    if unknown or not isinstance(defaults, dict) or not isinstance(streams, dict) or not streams:
        found = f"{', '.join(unknown)} at the top level" if unknown else "no stream by name"
        raise ConfigError(
            expected=f"{', '.join(known)} in {path}",
            found=found,
            fix="write what all streams share below `defaults`, and below `streams` a name with an `address` for each",
        )
    anchor_paths(defaults, path.parent)
    live = {key: value for key, value in content.items() if key not in _PARTS}
    site = SiteSettings(
        settings_from(defaults, f"{path}: defaults"),
        {str(name): _stream(str(name), given, defaults, path) for name, given in streams.items()},
        _part(LiveSettings, live, path, str(path)),
    )
    _check_names(site, path)
    return site


def _stream(name: str, given: object, defaults: Mapping[str, Any], path: Path) -> StreamSettings:
    where = f"{path}: streams.{name}"
    if NAME.fullmatch(name) is None:
        raise ConfigError(
            expected=f"names of streams of letters, digits, - and _ in {path}", found=repr(name), fix="name it anew"
        )
    if not isinstance(given, dict) or not isinstance(given.get("address"), str) or not given["address"]:
        raise ConfigError(expected=f"an `address` in {where}", found="none", fix="say where its pictures come from")
    of_capture = {key: value for key, value in given.items() if key in CaptureSettings.model_fields}
    own = {key: value for key, value in given.items() if key != "address" and key not in of_capture}
    anchor_paths(own, path.parent)
    capture = _part(CaptureSettings, of_capture, path, where)
    made = StreamSettings(
        _anchored(given["address"], path.parent), capture, settings_from(_merged(defaults, own), where)
    )
    try:
        _ = made.live_address
    except SourceError as error:
        raise ConfigError(expected=f"{error.expected} in {where}", found=error.found, fix=error.fix) from None
    return made


def _anchored(address: str, folder: Path) -> str:
    """Make the path of a film that is replayed absolute."""
    scheme, sign, rest = address.partition("://")
    if scheme != "replay" or not rest:
        return address
    try:
        return f"{scheme}{sign}{(folder / rest).resolve()}"
    except ValueError:
        # No path can be so: `LiveAddress` says that.
        return address


def _part(kind: type[Part], given: Mapping[str, Any], path: Path, where: str) -> Part:
    try:
        return kind.model_validate(dict(given), context={FOLDER: path.parent})
    except ValidationError as error:
        raise config_error(where, error) from None


def broker_settings(given: Mapping[str, Any]) -> BrokerSettings:
    """Check the settings of a broker that were given one by one; paths are relative to the current folder.

    Raises:
        ConfigError: One of them cannot be.
    """
    return _part(BrokerSettings, given, Path.cwd() / "broker", "the broker")


def _check_names(site: SiteSettings, path: Path) -> None:
    """Raise ConfigError for receivers of streams or zones that do not exist: they would never be told."""
    zones = {zone.name for stream in site.streams.values() for zone in build_zones(stream.settings)}
    for name, receiver in site.live.receivers.items():
        for what, asked, known in (("stream", receiver.streams, site.streams.keys()), ("zone", receiver.zones, zones)):
            unknown = sorted(set(asked) - set(known))
            if unknown:
                raise ConfigError(
                    expected=f"receivers.{name}.{what}s to be {what}s of {path}",
                    found=", ".join(unknown),
                    fix=f"there are {', '.join(sorted(known))}" if known else f"the site has no {what}",
                )


def _merged(defaults: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Return the defaults with what differs: sections are merged, everything else is replaced."""
    merged = copy.deepcopy(dict(defaults))
    for key, value in own.items():
        before = merged.get(key)
        merged[key] = _merged(before, value) if isinstance(before, dict) and isinstance(value, dict) else value
    return merged
