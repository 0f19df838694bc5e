"""What the status page is told: one type for each answer, from which the page's own types are made."""

from __future__ import annotations

from typing import Literal, TypeAlias

from pydantic import Field

from standoff.core.hazards import Phase, Severity
from standoff.core.health import StreamState
from standoff.messages.events import Delay
from standoff.service.answering import Told

Box: TypeAlias = tuple[float, float, float, float]
Overall: TypeAlias = Literal["ok", "degraded", "failing"]


class Quantiles(Told):
    """How long something takes."""

    p50: float
    p95: float
    p99: float
    count: int


class OpenHazardAnswer(Told):
    """A hazard that is open."""

    hazard_id: str
    rule: str
    severity: Severity
    phase: Phase
    zone: str
    track_ids: list[int]
    distance_m: float | None
    gap_m: float | None
    sigma_m: float | None
    reason: str


class TrackAnswer(Told):
    """A track, where it was in the picture."""

    id: int
    kind: str
    xyxy_px: Box


class StreamAnswer(Told):
    """One stream."""

    name: str
    state: StreamState
    reason: str
    is_watched: bool = Field(description="Live, and its analysis answers: only then its silence means anything.")
    picture_age_ms: float | None = Field(description="Since the newest picture came; null: none did.")
    captured_age_ms: float | None = Field(
        description="Since the newest picture that was analysed was taken; null: unknown."
    )
    delay: Delay
    size_px: tuple[int, int] | None
    frames: int
    not_looked_at: int = Field(description="Pictures that came while an earlier one was analysed.")
    arrival_to_result_ms: Quantiles | None
    detect_ms: Quantiles | None
    map: str = Field(description="How the ground map was found; empty: there is none.")
    map_reason: str
    watched_share: float | None
    unwatched: dict[str, float]
    hazards: list[OpenHazardAnswer]
    tracks: list[TrackAnswer]


class DeviceAnswer(Told):
    """One receiver."""

    name: str
    supervised: bool
    reason: str
    streams: list[str]


class ShelfAnswer(Told):
    """An alarm that is set aside."""

    id: str
    stream: str
    zone: str
    hazard_id: str
    author: str
    reason: str
    until_unix_s: float


class ProcessAnswer(Told):
    """One process of the service."""

    name: str
    is_answering: bool
    starts: int


class StatusAnswer(Told):
    """All of a site at this moment."""

    site: str
    at_unix_s: float
    overall: Overall
    problems: list[str]
    streams: list[StreamAnswer]
    devices: list[DeviceAnswer]
    shelves: list[ShelfAnswer]
    processes: list[ProcessAnswer]
    broker: str
    broker_connected: bool
    letters: dict[str, int] = Field(description="Messages by state: waiting, delivered, expired, superseded.")
    to_wrist_ms: Quantiles | None = Field(description="From a picture's capture to its alert on a device.")
    sent_to_shown_ms: Quantiles | None


class HealthAnswer(Told):
    """Whether the service works."""

    overall: Overall
    problems: list[str]
