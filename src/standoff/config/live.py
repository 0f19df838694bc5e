"""Settings of a site that is watched live: streams beyond their monitors, who is told, and through what."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Final, Literal
from urllib.parse import urlsplit
from zoneinfo import ZoneInfo

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from standoff.config.secret import FOLDER, SecretSetting
from standoff.core.stream_watch import WatchLimits

NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
"""Names of sites, streams and devices stand in topics, addresses and file names."""

_BROKER_PORTS: Final = {"mqtt": 1883, "mqtts": 8883}


def _name(given: str) -> str:
    if NAME.fullmatch(given) is None:
        raise ValueError("a name has letters, digits, - and _ only, and begins with one of the first two")
    return given


def _anchored(given: Path, info: ValidationInfo) -> Path:
    folder: Path = (info.context or {}).get(FOLDER, Path())
    return (folder / given).resolve()


def _readable(given: Path, info: ValidationInfo) -> Path:
    path = _anchored(given, info)
    try:
        is_there = path.is_file()
    except OSError:  # A name that is too long.
        is_there = False
    if not is_there:
        raise ValueError(f"no such file: {given}")
    return path


Name = Annotated[str, AfterValidator(_name)]
FilePath = Annotated[Path, AfterValidator(_readable)]
FolderPath = Annotated[Path, AfterValidator(_anchored)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class CaptureSettings(_Part):
    """How the pictures of a stream come, beside its address."""

    enabled: Annotated[bool, Field(description="False: nobody watches it, and everybody sees that.")] = True
    user: Annotated[str, Field(description="Who asks for the stream.")] = ""
    password: Annotated[SecretSetting | None, Field(description="env:NAME or file:PATH.")] = None
    ca_file: Annotated[FilePath | None, Field(description="Certificates that vouch for rtsps and rtmps senders.")] = (
        None
    )
    delay_bound_s: Annotated[
        float | None,
        Field(
            gt=0,
            le=30,
            description="The most that its pictures are late, s, where neither sender nor `standoff latency` tells: "
            "you answer for it. Without any of them receivers are not warned by this stream.",
        ),
    ] = None
    watch: Annotated[WatchLimits, Field(description="When it is not live any more.")] = WatchLimits()
    dji_serial: Annotated[
        str | None,
        Field(
            pattern=r"^[A-Za-z0-9]{4,32}$",
            description="Serial number of a DJI drone whose telemetry comes through the broker (Cloud API).",
        ),
    ] = None

    @model_validator(mode="after")
    def _whose_password(self) -> CaptureSettings:
        if self.password is not None and not self.user:
            raise ValueError("a password needs a `user`")
        if self.delay_bound_s is not None and self.delay_bound_s > self.watch.late_after_s:
            raise ValueError(
                f"delay_bound_s is above watch.late_after_s ({self.watch.late_after_s:g} s): the stream would be "
                "late for ever; raise late_after_s if you answer for warnings that are so late"
            )
        return self


class ReceiverSettings(_Part):
    """One device that tells a person."""

    wearer: Annotated[
        Literal["worker", "machine", "nobody"],
        Field(
            description="Who carries it: a worker, or a machine's operator, both found by the device's position; or "
            "nobody whom the streams should see."
        ),
    ] = "worker"
    everything: Annotated[bool, Field(description="Is told of every hazard of the site.")] = False
    streams: Annotated[tuple[str, ...], Field(description="Is told of every hazard of these streams.")] = ()
    zones: Annotated[tuple[str, ...], Field(description="Is told of every hazard of these zones.")] = ()

    @model_validator(mode="after")
    def _has_a_reason(self) -> ReceiverSettings:
        if self.wearer == "nobody" and not (self.everything or self.streams or self.zones):
            raise ValueError("worn by nobody it needs `everything`, `streams` or `zones`: it would never be told")
        return self


class AlertSettings(_Part):
    """How people are told."""

    valid_s: Annotated[
        float,
        Field(
            ge=2,
            le=60,
            description="An alert that is older is not delivered any more; s. While a hazard lasts there is a new "
            "one each second.",
        ),
    ] = 5.0
    cooldown_s: Annotated[
        float,
        Field(
            ge=0,
            le=600,
            description="A hazard of the same kind that opens again so soon is shown, but does not sound again "
            "unless graver; s.",
        ),
    ] = 5.0
    escalate_after_s: Annotated[
        float,
        Field(
            gt=0, le=3600, description="Danger that nobody has acknowledged for so long goes to the next in line; s."
        ),
    ] = 15.0
    escalate_to: Annotated[tuple[str, ...], Field(description="Receivers in line, one after another.")] = ()


class BrokerSettings(_Part):
    """The MQTT broker through which people are told."""

    address: Annotated[str, Field(description="mqtt://host:port, or mqtts://host:port (TLS).")] = (
        "mqtt://127.0.0.1:1883"
    )
    user: Annotated[str, Field(description="Account of the service.")] = ""
    password: Annotated[SecretSetting | None, Field(description="env:NAME or file:PATH.")] = None
    ca_file: Annotated[FilePath | None, Field(description="Certificates that vouch for the broker.")] = None
    cert_file: Annotated[FilePath | None, Field(description="The service's own certificate.")] = None
    key_file: Annotated[FilePath | None, Field(description="Its key.")] = None
    protocol: Annotated[
        Literal["5", "3.1.1"], Field(description="3.1.1 has no expiry: receivers alone drop what is too late.")
    ] = "5"
    prefix: Annotated[
        str, Field(pattern=r"^[^#+/\s\x00]+(/[^#+/\s\x00]+)*$", description="Of all topics; {site} is the site's name.")
    ] = "standoff/{site}"
    home_assistant: Annotated[
        bool, Field(description="Announce streams and receivers to Home Assistant (MQTT discovery).")
    ] = False

    @field_validator("address")
    @classmethod
    def _scheme(cls, given: str) -> str:
        try:
            parts = urlsplit(given)
            host, _ = parts.hostname, parts.port
        except ValueError:
            host = None
        if host is None or parts.scheme not in _BROKER_PORTS or parts.path not in ("", "/"):
            raise ValueError("write mqtt://host:port or mqtts://host:port")
        if parts.username or parts.password:
            raise ValueError("write `user:` and `password: env:NAME` beside the address")
        return given

    @model_validator(mode="after")
    def _go_together(self) -> BrokerSettings:
        if (self.cert_file is None) != (self.key_file is None):
            raise ValueError("cert_file and key_file go together")
        if self.password is not None and not self.is_secure and self.host not in ("127.0.0.1", "localhost", "::1"):
            raise ValueError("a password goes through mqtts:// only, unless the broker is on this machine")
        return self

    @property
    def is_secure(self) -> bool:
        """Whether it is asked by TLS."""
        return urlsplit(self.address).scheme == "mqtts"

    @property
    def host(self) -> str:
        """Name or number of its machine."""
        return urlsplit(self.address).hostname or ""

    @property
    def port(self) -> int:
        """On that machine."""
        parts = urlsplit(self.address)
        return parts.port or _BROKER_PORTS[parts.scheme]


class NotifySettings(_Part):
    """A messenger or a web service that is told as well."""

    apprise: Annotated[
        SecretSetting | None,
        Field(description="Apprise address of a messenger, as env:NAME or file:PATH: it holds a token."),
    ] = None
    webhook: Annotated[
        str | None, Field(pattern=r"^https?://[^\s@]+$", description="Address that is sent each event.")
    ] = None
    secret: Annotated[SecretSetting | None, Field(description="Signs what the web service is sent (HMAC-SHA256).")] = (
        None
    )
    severities: Annotated[
        tuple[Literal["warning", "danger", "unknown"], ...], Field(description="Of which hazards it is told.")
    ] = ("danger",)

    @model_validator(mode="after")
    def _one_way(self) -> NotifySettings:
        if (self.apprise is None) == (self.webhook is None):
            raise ValueError("give one of apprise and webhook")
        if (self.webhook is None) != (self.secret is None):
            raise ValueError("webhook and secret go together")
        return self


class ShiftSettings(_Part):
    """When people work: of this time the daily record tells what was watched."""

    begin: Annotated[str, Field(pattern=r"^([01]\d|2[0-3]):[0-5]\d$", description="Local time, HH:MM.")] = "00:00"
    end: Annotated[str, Field(pattern=r"^([01]\d|2[0-3]):[0-5]\d$|^24:00$", description="Local time, HH:MM.")] = "24:00"
    timezone: Annotated[str, Field(description="As Europe/Berlin.")] = "UTC"

    @field_validator("timezone")
    @classmethod
    def _known(cls, given: str) -> str:
        try:
            ZoneInfo(given)
        except (OSError, ValueError, KeyError) as error:
            raise ValueError("no such time zone") from error
        return given

    @model_validator(mode="after")
    def _lasts(self) -> ShiftSettings:
        if self.begin == self.end:
            raise ValueError("begin and end are the same")
        return self


class PageSettings(_Part):
    """The status page, on this machine only."""

    port: Annotated[int, Field(ge=0, le=65535, description="0: any that is free.")] = 8765


class LiveSettings(_Part):
    """What a site that is watched live has beside its streams."""

    site: Annotated[Name, Field(description="Its name, in topics and messages.")] = "site"
    state: Annotated[
        FolderPath, Field(validate_default=True, description="Folder for what must outlive a restart.")
    ] = Path("standoff-state")
    broker: Annotated[BrokerSettings, Field(description="Through which people are told.")] = BrokerSettings()
    receivers: Annotated[dict[Name, ReceiverSettings], Field(description="Devices by name.")] = {}
    alerts: Annotated[AlertSettings, Field(description="How people are told.")] = AlertSettings()
    notify: Annotated[tuple[NotifySettings, ...], Field(description="Messengers and web services.")] = ()
    shift: Annotated[ShiftSettings, Field(description="When people work.")] = ShiftSettings()
    page: Annotated[PageSettings, Field(description="The status page.")] = PageSettings()

    @model_validator(mode="after")
    def _known_receivers(self) -> LiveSettings:
        for name in self.alerts.escalate_to:
            if name not in self.receivers:
                raise ValueError(f"alerts.escalate_to: no receiver {name}")
        return self
