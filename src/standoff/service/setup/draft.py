"""What a person has clicked and typed so far, and what it says as settings."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from standoff.core.classes import CLASSES, Role
from standoff.core.errors import ConfigError
from standoff.core.homography import FloatArray
from standoff.core.lengths import UNITS, TypedLength, UnitName
from standoff.core.zones import Zone, ZoneKind
from standoff.files.json_text import read_json, write_json

_Coordinate: TypeAlias = Annotated[float, Field(ge=-1e6, le=1e6)]
Pixel: TypeAlias = tuple[_Coordinate, _Coordinate]
"""As somebody clicked it; inside the picture or about there."""
Place: TypeAlias = tuple[Annotated[float, Field(ge=-1e7, le=1e7)], Annotated[float, Field(ge=-1e7, le=1e7)]]
"""Metres in the site frame, as somebody typed or drew it: grids of whole countries are within."""
Seconds: TypeAlias = Annotated[float, Field(ge=0, le=1e6)]
"""Time in the film."""
Shape: TypeAlias = Literal["square", "rectangle", "sides"]
Metres: TypeAlias = Annotated[float, Field(gt=0, le=1000)]
SHAPE_LENGTHS: Final = {"square": 1, "rectangle": 2, "sides": 5}
"""How many lengths each shape has: side; length and width; four sides in order and the first diagonal."""
SAME_S: Final = 1e-3
"""Times this near to each other are of one picture."""
_CORNERS: Final = 4
_GROWS_BY: Final = 0.12
"""The box about clicked corners is so much larger than they, in longer sides of it: the sides below the top count."""
_FLATTEST: Final = 0.02
"""Least sine between neighbouring sides: less is three points in a row."""


class _Part(BaseModel):
    # What has a default is always there when it is told.
    model_config = ConfigDict(extra="forbid", json_schema_serialization_defaults_required=True)


class ReferenceDraft(_Part):
    """The reference object: four corners of its top, clicked in order, and what was measured of it."""

    shape: Shape = "square"
    lengths_m: list[Metres | None] = Field(default_factory=list, description="As `shape` wants them; null: not typed.")
    height_m: float | None = Field(default=None, ge=0, le=100, description="Of its top; null: estimated.")
    corners_px: list[Pixel] = Field(default_factory=list, max_length=_CORNERS)
    time_s: Seconds = Field(default=0.0, description="Of the picture in which they were clicked.")


class PointDraft(_Part):
    """A surveyed point: where it is in the picture, and on the site."""

    name: str = Field(min_length=1, max_length=60)
    at_px: Pixel | None = Field(default=None, description="null: not clicked yet.")
    m: Place | None = None
    lonlat: tuple[Annotated[float, Field(ge=-180, le=180)], Annotated[float, Field(ge=-90, le=90)]] | None = Field(
        default=None, description="Degrees (WGS 84), in place of `m`."
    )
    z_m: float | None = Field(default=None, ge=-1e4, le=1e4)


class SurveyDraft(_Part):
    """Surveyed points, seen in one picture."""

    points: list[PointDraft] = Field(default_factory=list, max_length=200)
    time_s: Seconds = 0.0

    @property
    def seen(self) -> list[PointDraft]:
        """Those that have been clicked."""
        return [point for point in self.points if point.at_px is not None]


class ZoneDraft(_Part):
    """A part of the site with a rule of its own."""

    name: str = Field(min_length=1, max_length=60)
    kind: ZoneKind
    ring_m: list[Place] = Field(max_length=200)


class Draft(_Part):
    """All of it. `ground` says which part tells the metres."""

    ground: Literal["reference", "survey", "auto"] = "reference"
    reference: ReferenceDraft = Field(default_factory=ReferenceDraft)
    survey: SurveyDraft = Field(default_factory=SurveyDraft)
    zones: list[ZoneDraft] = Field(default_factory=list, max_length=200)
    radius_m: dict[str, Metres] = Field(default_factory=dict, description="By class, where not the usual one.")
    unit: UnitName = "metres"

    def missing(self) -> str:
        """Return what is still to be clicked or typed before there can be metres, or ""."""
        if self.ground == "reference":
            left = _CORNERS - len(self.reference.corners_px)
            if left:
                return f"corners: {left}"
            lengths = self.reference.lengths_m
            if len(lengths) != SHAPE_LENGTHS[self.reference.shape] or None in lengths:
                return "lengths"
        if self.ground == "survey" and len(self.survey.seen) < _CORNERS:
            return f"points: {_CORNERS - len(self.survey.seen)}"
        return ""

    def settings(self, survey_file: Path | None, zones_file: Path | None) -> dict[str, Any]:
        """Return what it says as nested settings, as a settings file has them; files where they will be.

        Args:
            survey_file: Where `survey_text` is or will be.
            zones_file: Where the zones are or will be.

        Raises:
            ConfigError: Corners that no picture of such a shape can have.
        """
        ground: dict[str, Any] = {"survey": None, "reference": None}
        if self.ground == "reference":
            ground["reference"] = self._reference()
        elif self.ground == "survey":
            ground["survey"] = str(survey_file)
        return {
            "ground": ground,
            "zones": str(zones_file) if self.zones else None,
            "locate": {"radius_m": dict(self.radius_m)},
            "show": {"unit": self.unit},
        }

    def _reference(self) -> dict[str, Any]:
        reference = self.reference
        lengths = [float(one) for one in reference.lengths_m if one is not None]
        corners_px, is_turned = corners_in_order(reference.corners_px)
        if is_turned:
            # The sides were typed as the corners were clicked: the last one is now the first.
            sides = len(lengths) - (reference.shape == "sides")
            lengths[:sides] = reversed(lengths[:sides])
        said: dict[Shape, dict[str, Any]] = {
            "square": {"square_m": lengths[0]},
            "rectangle": {"rectangle_m": lengths},
            "sides": {"sides_m": lengths[:4], "diagonal_m": lengths[-1]},
        }
        low, high = corners_px.min(axis=0), corners_px.max(axis=0)
        grows_px = _GROWS_BY * float((high - low).max())
        box = [*(low - grows_px), *(high + grows_px)]
        return {
            **said[reference.shape],
            "height_m": reference.height_m,
            "box_px": [round(float(edge), 1) for edge in box],
            "box_time_s": round(reference.time_s, 3),
            "first_corner_px": [round(float(one), 1) for one in corners_px[0]],
        }

    def survey_text(self, size_px: tuple[int, int]) -> dict[str, Any]:
        """Return the surveyed points as a survey file has them."""
        points = [
            {name: value for name, value in point.model_dump(mode="json", by_alias=True).items() if value is not None}
            for point in self.survey.seen
        ]
        for point in points:
            point["px"] = point.pop("at_px")
        return {"image_size_px": list(size_px), "time_s": round(self.survey.time_s, 3), "points": points}

    def zones_of_site(self) -> tuple[Zone, ...]:
        """Return the zones.

        Raises:
            ConfigError: One has no area, or two have one name.
        """
        names = [zone.name for zone in self.zones]
        twice = next((name for name in names if names.count(name) > 1), None)
        thin = next((zone.name for zone in self.zones if len(zone.ring_m) < 3), None)
        if twice is not None or thin is not None:
            found = f"two called {twice}" if twice is not None else f"fewer in {thin}"
            raise ConfigError(
                expected="zones of three corners or more, each with a name of its own", found=found, fix="correct it"
            )
        return tuple(Zone(zone.name, zone.kind, [[np.array(zone.ring_m)]]) for zone in self.zones)


def corners_in_order(corners_px: list[Pixel]) -> tuple[FloatArray, bool]:
    """Return (4, 2) corners counter-clockwise as seen from above, the first one first, and whether they were not.

    Seen from above the picture shows a surface as it is, so that counter-clockwise is so in the picture, too.

    Raises:
        ConfigError: They are no convex quadrilateral.
    """
    corners = np.array(corners_px, dtype=np.float64)
    steps = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(steps, axis=1)
    after = np.roll(steps, -1, axis=0)
    turns = steps[:, 0] * after[:, 1] - steps[:, 1] * after[:, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        sines = turns / (lengths * np.roll(lengths, -1))
    if not np.isfinite(sines).all() or np.abs(sines).min() < _FLATTEST:
        raise _no_corners("three of them in a row")
    if len(set(np.sign(sines))) > 1:
        raise _no_corners("sides that cross, or a corner that points inwards")
    # The picture's y points down: a turn to the right there is a positive one.
    is_turned = bool(sines[0] > 0)
    return (np.concatenate([corners[:1], corners[:0:-1]]) if is_turned else corners), is_turned


def _no_corners(found: str) -> ConfigError:
    return ConfigError(
        expected="four corners, one after another around the reference's top",
        found=found,
        fix="move or click them again",
    )


class DraftStale(Exception):
    """Somebody else has changed the draft since.

    Args:
        revision: The draft's own.
    """

    def __init__(self, revision: int) -> None:
        super().__init__(f"revision {revision}")
        self.revision = revision


class DraftFile:
    """The draft on disk: a page that is closed half-way loses nothing, two pages cannot overwrite each other unseen.

    Args:
        path: The file; it need not be there.
        first: What to begin with where it is not there.

    Attributes:
        revision: Rises with every change.
    """

    def __init__(self, path: Path, first: Draft) -> None:
        self.path = path
        self.revision = 0
        self._draft = first
        self._lock = threading.Lock()
        if path.is_file():
            self.revision, self._draft = _read(path)

    @property
    def draft(self) -> Draft:
        """As it is now; not to be changed."""
        return self._draft

    def replace(self, draft: Draft, revision: int) -> int:
        """Replace it, if nobody else has since a revision; return the new one.

        Raises:
            DraftStale: Somebody has.
            OutputError: It cannot be written.
        """
        with self._lock:
            if revision != self.revision:
                raise DraftStale(self.revision)
            write_json(self.path, {"revision": revision + 1, "draft": draft.model_dump(mode="json")})
            self._draft, self.revision = draft, revision + 1
            return self.revision

    def remove(self) -> None:
        """Forget the file: what it said is in the settings now."""
        with suppress(FileNotFoundError):
            self.path.unlink()


def _read(path: Path) -> tuple[int, Draft]:
    content = read_json(path, "a draft of a site", ConfigError)
    try:
        if not isinstance(content, Mapping) or not isinstance(content.get("revision"), int):
            raise ValueError("something else")
        return content["revision"], Draft.model_validate(content.get("draft"))
    except (ValidationError, ValueError) as error:
        found = f"{error.errors()[0]['msg']}" if isinstance(error, ValidationError) else str(error)
        raise ConfigError(
            expected=f"a draft that `standoff setup` wrote at {path}",
            found=found,
            fix="remove the file, or name another",
        ) from error


def usual_radius_m() -> dict[str, float]:
    """Return the usual action radius of every class that has one, by name."""
    return {one.name: one.action_radius_m for one in CLASSES if one.role is not Role.REFERENCE}


def read_length_m(text: str, unit: UnitName) -> float:
    """Return the length that somebody typed into a field whose label says a unit.

    Raises:
        ConfigError: It is no length.

    >>> read_length_m("2.89", "metres"), round(read_length_m("10", "feet"), 3), read_length_m("2.5 m", "feet")
    (2.89, 3.048, 2.5)
    """
    try:
        typed = TypedLength.read(text.strip().replace(",", "."))
    except ValueError as error:
        raise ConfigError(
            expected="a length", found=repr(text), fix="type a number such as 2.89, 9.5 ft or 9'6\""
        ) from error
    return typed.length_m * (1.0 if typed.names_unit else UNITS[unit].in_m)
