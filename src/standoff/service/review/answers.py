"""What the page of a finished run is told: one type for each answer, from which the page's own types are made."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import BaseModel, Field, StringConstraints

from standoff.clips.reviews import Verdict
from standoff.core.hazards import Severity
from standoff.core.zones import ZoneKind
from standoff.service.answering import Told

Pixel: TypeAlias = tuple[float, float]
Place: TypeAlias = tuple[float, float]
"""Metres in the site frame."""
Shown: TypeAlias = Literal["film", "annotated", "none"]
"""The film itself; the one that the run drew, with everything in it; neither."""
Rule: TypeAlias = Literal["proximity", "zone", "measurement"]


class Party(Told):
    """One of those whom a hazard is about."""

    kind: str = Field(description="Name of a class, or unknown.")
    track_id: int


class HazardAnswer(Told):
    """A hazard, from its first event to its last, and what was said of it."""

    hazard_id: str
    rule: Rule
    severity: Severity
    parties: list[Party]
    zone: str
    opened_s: float
    closed_s: float | None = Field(description="null: open when the run ended.")
    worst_s: float
    distance_text: str
    gap_text: str
    reason: str
    verdict: Verdict
    comment: str


class ZoneAnswer(Told):
    """A zone of the site."""

    name: str
    kind: ZoneKind
    rings_m: list[list[Place]]


class RunAnswer(Told):
    """The run."""

    name: str
    status: str = Field(description="complete, interrupted, failed or running; empty: it does not tell.")
    message: str
    first_s: float
    last_s: float
    width_px: int
    height_px: int
    shows: Shown
    is_video: bool = Field(description="Whether a browser may play it; false: pictures one by one.")
    film_starts_s: float = Field(description="Time of the run at which the shown film begins.")
    why_not: str = Field(description="Why it is not the film itself; empty: it is.")
    unit: str = Field(description="Symbol of the unit of lengths.")
    metre: float = Field(description="How long a metre is in it.")
    mapped_share: float | None
    watched_share: float | None
    warnings: list[str]
    missing: list[str] = Field(description="Tables that the run did not keep, and what is not shown therefore.")
    zones: list[ZoneAnswer]
    plan_m: tuple[float, float, float, float] | None = Field(description="Least x and y, largest x and y; site frame.")
    hazards: list[HazardAnswer]
    assistance: str


class TrackAt(Told):
    """Somebody or something at a moment."""

    track_id: int
    kind: str
    box_px: tuple[float, float, float, float]
    at_m: Place | None = Field(description="null: not known.")
    radius_m: float
    circle_px: list[Pixel] = Field(description="Its action radius on the ground, as it is in the picture.")
    is_seen: bool = Field(description="false: predicted, or hidden.")
    severity: Severity | None = Field(description="Of the gravest hazard about it; null: none.")


class PairAt(Told):
    """Two that are near to each other at a moment."""

    track_a: int
    track_b: int
    ends_px: tuple[Pixel, Pixel] | None = Field(description="The line between them; null: not in the picture.")
    text: str = Field(description="How far apart, with its error; unknown where it was not measured.")
    severity: Severity | None


class FrameAt(Told):
    """A frame of the run."""

    time_s: float
    has_map: bool
    reason: str = Field(description="Why there is no map; empty: there is one.")
    watched_share: float | None
    is_moved: bool = Field(description="Places are counted from elsewhere than in the frame before.")
    tracks: list[TrackAt]
    pairs: list[PairAt]


class FramesAnswer(Told):
    """Frames of a span of time."""

    frames: list[FrameAt]


class CurvesAnswer(Told):
    """What changed in the run: one value for each span, the worst in it."""

    time_s: list[float]
    gap: list[float | None] = Field(description="Least gap of any pair, in the unit of the run; null: not measured.")
    watched: list[float | None] = Field(description="Least watched share of the ground; null: not judged.")


class ReviewChange(BaseModel):
    """What somebody says of a hazard."""

    hazard_id: str = Field(max_length=60)
    verdict: Verdict
    comment: Annotated[str, StringConstraints(strip_whitespace=True, max_length=2000)] = ""
