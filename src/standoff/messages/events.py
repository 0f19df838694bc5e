"""The data of each kind of CloudEvent that the service sends."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Literal

from annotated_types import Ge, MaxLen

from standoff.core.hazards import Phase, Severity
from standoff.core.health import StreamState

Delay = Literal["told", "measured", "bound", "unknown"]
"""How it is known when a picture was taken: the sender tells; it was measured with `standoff latency`; the operator
answers for an upper bound; nobody knows."""

Because = Literal["position", "near", "zone", "stream", "everything", "escalation"]
"""Why a device is told: its wearer is one of the tracks; he is near them and no track is his; it is told of the zone's,
the stream's or all hazards; somebody before it in line has not acknowledged."""

Text = Annotated[str, MaxLen(500)]


@dataclass(frozen=True, slots=True)
class Timing:
    """When something was said, and for how long it holds; filled in at the moment of sending.

    Attributes:
        clock: Names the service's clock; another name means that its milliseconds begin anew.
        sent_ms: By that clock.
        remaining_ms: For so much longer it holds; then it must not be acted on.
        age_ms: How long ago the picture that it rests on was taken; an upper bound where `delay` is "bound", null where
            nobody knows.
    """

    clock: Annotated[str, MaxLen(64)]
    sent_ms: float
    remaining_ms: float
    age_ms: float | None


@dataclass(frozen=True, slots=True)
class HazardNews:
    """One event in the life of a hazard.

    Attributes:
        site: Name of the site.
        stream: Name of the stream.
        session: Of the stream's monitor: track ids of another session are others.
        hazard_id: Shared by all events of a hazard.
        phase: "opened" first, "closed" last; "unknown" while it cannot be measured.
        rule: "proximity", "zone" or "measurement".
        severity: "unknown" where it was never measured.
        track_ids: Of whom it is.
        classes: Of each of them.
        zone: Name of the zone; empty for other rules.
        distance_m: Centre to centre, or to the zone; null while unknown.
        gap_m: Distance less both action radii; null while unknown.
        sigma_m: Standard error of the distance; null while unknown.
        breach_now: Probability that the gap is negative; null while unknown.
        breach_ahead: Probability that it is, or will be within the horizon; null while unknown.
        reason: Why it is unknown or closed; empty otherwise.
        time_s: Of the stream.
        captured_at: When the picture was taken, as far as known, UTC.
        delay: How that is known.
        shelved_by: Who has set the alarm aside for a while; empty: nobody.
    """

    site: Annotated[str, MaxLen(64)]
    stream: Annotated[str, MaxLen(64)]
    session: Annotated[str, MaxLen(64)]
    hazard_id: Annotated[str, MaxLen(64)]
    phase: Phase
    rule: Annotated[str, MaxLen(64)]
    severity: Severity
    track_ids: Annotated[tuple[int, ...], MaxLen(8)]
    classes: Annotated[tuple[str, ...], MaxLen(8)]
    zone: Annotated[str, MaxLen(64)]
    distance_m: float | None
    gap_m: float | None
    sigma_m: float | None
    breach_now: float | None
    breach_ahead: float | None
    reason: Text
    time_s: float
    captured_at: datetime | None
    delay: Delay
    shelved_by: Text = ""


@dataclass(frozen=True, slots=True)
class Alert:
    """A hazard, told to one device.

    Attributes:
        device: Name of the device.
        hazard: What happened.
        because: Why this device is told.
        silent: Whether it is only to be shown: nothing got worse since it last sounded.
    """

    device: Annotated[str, MaxLen(64)]
    hazard: HazardNews
    because: Because
    silent: bool


@dataclass(frozen=True, slots=True)
class WatchedZone:
    """Whether a zone is watched.

    Attributes:
        name: Of the zone.
        share: Part of it on which a worker would be found.
        reason: Why not all of it; empty where all is.
    """

    name: Annotated[str, MaxLen(64)]
    share: float
    reason: Text


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """A frame was watched to its end; made of nothing else, so that it stops when watching does.

    Attributes:
        site: Name of the site.
        stream: Name of the stream.
        session: Of the stream's monitor.
        sequence: Rises by one with each heartbeat of the stream, for as long as the service runs.
        frame: Number of the frame that it was made of.
        time_s: Of that frame.
        measured: Whether there is a ground map.
        reason: Why there is none; empty otherwise.
        watched_share: Part of the ground in the picture on which a worker would be found; null: nobody judged.
        unwatched: Part of the ground by the reason why it is not watched.
        zones: Whether each zone is watched.
        delay: How it is known when the picture was taken.
        open_hazards: Ids of the hazards that are open.
    """

    site: Annotated[str, MaxLen(64)]
    stream: Annotated[str, MaxLen(64)]
    session: Annotated[str, MaxLen(64)]
    sequence: Annotated[int, Ge(0)]
    frame: Annotated[int, Ge(0)]
    time_s: float
    measured: bool
    reason: Text
    watched_share: float | None
    unwatched: dict[str, float]
    zones: Annotated[tuple[WatchedZone, ...], MaxLen(200)]
    delay: Delay
    open_hazards: Annotated[tuple[str, ...], MaxLen(1000)]


@dataclass(frozen=True, slots=True)
class Supervision:
    """Whether somebody would be warned, told to his device once a second, and only after frames that were watched.

    Attributes:
        device: Name of the device.
        sequence: Rises by one with each of them.
        supervised: Whether he would.
        reason: Why not; empty otherwise.
        streams: Those that see him, or that the device is told of.
        candidates: How many tracks may be his; more than one: he is warned for all of them.
    """

    device: Annotated[str, MaxLen(64)]
    sequence: Annotated[int, Ge(0)]
    supervised: bool
    reason: Text
    streams: Annotated[tuple[str, ...], MaxLen(100)]
    candidates: Annotated[int, Ge(0)] = 0


@dataclass(frozen=True, slots=True)
class HealthNews:
    """A stream's state has changed.

    Attributes:
        site: Name of the site.
        stream: Name of the stream.
        state: Only "live" says anything about safety.
        reason: Why; empty where it is live.
        time_s: Of the stream.
        since: When, UTC.
    """

    site: Annotated[str, MaxLen(64)]
    stream: Annotated[str, MaxLen(64)]
    state: StreamState
    reason: Text
    time_s: float
    since: datetime
