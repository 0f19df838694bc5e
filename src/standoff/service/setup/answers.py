"""What the page is told: one type for each answer, from which the page's own types are made."""

from __future__ import annotations

from typing import Literal, TypeAlias

from pydantic import BaseModel, Field

from standoff.core.lengths import UnitName
from standoff.service.answering import Told
from standoff.service.setup.draft import Draft, Pixel, Seconds

Place: TypeAlias = tuple[float, float]
"""Metres in the site frame."""
Point: TypeAlias = tuple[float, float]
"""Pixels; what lies near the horizon may be far outside the picture."""


class FilmAnswer(Told):
    """The film."""

    name: str
    width_px: int
    height_px: int
    first_s: float
    last_s: float
    fps: float | None
    telemetry: str = Field(description="What tells of the drone, for people; empty: nothing.")


class DraftAnswer(Told):
    """The draft, and where it will be saved."""

    revision: int
    draft: Draft
    site_file: str
    usual_radius_m: dict[str, float]


class DraftChange(BaseModel):
    """A new draft in place of the one of a revision."""

    revision: int
    draft: Draft


class RevisionAnswer(Told):
    """A draft was kept."""

    revision: int


class PointQuestion(BaseModel):
    """Which corner is near a point of a picture?"""

    time_s: Seconds
    at_px: Pixel


class PointAnswer(Told):
    """A corner, or the point itself."""

    at_px: Point
    snapped: bool


class LengthQuestion(BaseModel):
    """Which length does somebody mean, or how is one written?"""

    unit: UnitName
    text: str = Field(default="", max_length=60, description="As typed; a bare number is in `unit`.")
    length_m: float | None = Field(default=None, ge=0, le=1e6, description="In place of `text`.")


class LengthAnswer(Told):
    """A length, and how it is written."""

    length_m: float
    text: str


class Contour(Told):
    """Where a place on the ground is this sure: rings in the picture."""

    sigma_m: float
    text: str
    lines_px: list[list[Point]]


class Entity(Told):
    """Who or what the detector sees."""

    kind: str
    score: float
    box_px: tuple[float, float, float, float]
    at_m: Place | None = Field(description="Where it stands; null: not known.")
    circle_px: list[Point] = Field(description="Its action radius on the ground, as it is in the picture.")


class Plan(Told):
    """The ground from above: how its picture lies in the site frame."""

    width_px: int
    height_px: int
    m_per_px: float
    to_plan: list[list[float]] = Field(description="3 x 3, from metres to pixels of the plan.")


class Watched(Told):
    """Which ground is watched, cell by cell."""

    rows: int
    columns: int
    cells: list[list[int]] = Field(description="-1: no ground; 0: watched; else a number of `reasons`.")
    reasons: list[str]
    share: float


class GroundAnswer(Told):
    """What a draft says of the ground in one picture."""

    time_s: float
    found: bool
    missing: str = Field(description="What is still to be clicked or typed; empty: nothing.")
    reason: str = Field(description="Why there is no map; empty: there is one.")
    method: str = ""
    is_rough: bool = Field(default=False, description="Straight from the clicks: edges are looked for afterwards.")
    solid_px: list[list[Point]] = Field(default_factory=list, description="The reference as it is taken to be: lines.")
    corners_px: list[Point] = Field(default_factory=list, description="Its top's corners, as found.")
    off_px: float | None = Field(default=None, description="How far the clicked corners are from them, at most.")
    camera_height_text: str = Field(default="", description="Above the ground; empty: not known.")
    contours: list[Contour] = Field(default_factory=list)
    watched: Watched | None = None
    plan: Plan | None = None
    entities: list[Entity] = Field(default_factory=list)
    zones_px: list[list[Point]] = Field(default_factory=list, description="As drawn on the ground, one ring a zone.")
    warnings: list[str] = Field(default_factory=list, description="What contradicts what.")


class GroundQuestion(BaseModel):
    """What does a draft say of the ground in the picture at a time?"""

    time_s: Seconds
    draft: Draft
    is_dragging: bool = Field(default=False, description="At once, straight from the clicks: a hand moves a corner.")


class TapeQuestion(GroundQuestion):
    """How far is it between two points of the picture?"""

    from_px: Pixel
    to_px: Pixel


class TapeAnswer(Told):
    """A length on the ground; null where one of the two is not on it, or there is no map."""

    length_m: float | None
    sigma_m: float | None
    text: str = ""
    from_m: Place | None = None
    to_m: Place | None = None


class PlacesQuestion(GroundQuestion):
    """Where on the ground are points of the picture?"""

    at_px: list[Pixel] = Field(max_length=1000)


class PlacesAnswer(Told):
    """Their places; null where one is not on the ground."""

    at_m: list[Place | None]


class TrialQuestion(BaseModel):
    """Run some seconds with a draft."""

    time_s: Seconds
    lasts_s: float = Field(default=10.0, gt=0, le=60)
    draft: Draft


TrialState: TypeAlias = Literal["none", "running", "done", "failed", "stopped"]


class TrialSummary(Told):
    """What came of a trial."""

    frames: int
    frames_with_map: int
    distances: int
    measured_distances: int
    watched_share: float | None
    hazards: dict[str, int] = Field(description="How many of each severity.")
    warnings: list[str]


class TrialAnswer(Told):
    """How a trial goes."""

    state: TrialState
    number: int = Field(default=0, description="Of the trial; rises with each.")
    frames: int = 0
    frames_expected: int | None = None
    message: str = ""
    summary: TrialSummary | None = None


class SaveQuestion(BaseModel):
    """Write the settings."""

    draft: Draft


class SaveAnswer(Told):
    """What was written, and what to type next."""

    files: list[str]
    command: str
