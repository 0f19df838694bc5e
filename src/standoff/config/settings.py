"""The Settings tree: what a run depends on, with bounds and meanings."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import is_dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, get_type_hints

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ModelWrapValidatorHandler, model_validator
from pydantic.fields import FieldInfo
from pydantic_settings import BaseSettings, SettingsConfigDict

from standoff.config.markers import MarkerSettings, check_markers
from standoff.core.outputs import OUTPUTS
from standoff.stages.detect import DetectParams, ShippedModel
from standoff.stages.frames import SourceParams
from standoff.stages.ground import MarkerFamily, ReferenceParams, ReferenceShape
from standoff.stages.hazard import HazardParams
from standoff.stages.locate import LocateParams
from standoff.stages.motion import MotionParams
from standoff.stages.proximity import ProximityParams
from standoff.stages.sinks import ReportParams, ShowParams, TableParams, VideoParams
from standoff.stages.track import TrackParams
from standoff.stages.watched import WatchedParams

Point = tuple[float, float]
StageName = Literal["detect", "motion", "ground", "track", "locate", "watched", "proximity", "hazard"]
STAGE_NAMES: tuple[StageName, ...] = ("detect", "motion", "ground", "track", "locate", "watched", "proximity", "hazard")


def _known_output(name: str) -> str:
    if name not in OUTPUTS:
        raise ValueError(f"no output; there are {', '.join(OUTPUTS)}")
    return name


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ReferenceSettings(_Section):
    """The reference object: its true shape in one of five ways, and where to look for it."""

    square_m: Annotated[float | None, Field(gt=0, description="Side of a square; m.")] = None
    rectangle_m: Annotated[Point | None, Field(description="Length and width of a rectangle; m.")] = None
    regular_m: Annotated[
        tuple[int, float] | None,
        Field(description="Number of sides of a regular polygon, 3 to 12, and the length of one; m."),
    ] = None
    sides_m: Annotated[
        tuple[float, float, float, float] | None,
        Field(description="Four sides in order, counter-clockwise seen from above; m. Needs diagonal_m."),
    ] = None
    diagonal_m: Annotated[
        float | None, Field(gt=0, description="From the first corner to the third; m. Goes with sides_m.")
    ] = None
    corners_m: Annotated[
        tuple[Point, ...] | None,
        Field(
            min_length=3,
            max_length=12,
            description="Corners of a convex polygon, counter-clockwise seen from above, in the site frame; m.",
        ),
    ] = None
    height_m: Annotated[
        float | None,
        Field(ge=0, description="Height of its top above the ground; m. 0: flat. Absent: unknown and estimated."),
    ] = None
    box_px: Annotated[
        tuple[float, float, float, float] | None,
        Field(description="Its box in one frame: left, top, right, bottom; px. Absent: the detector finds it."),
    ] = None
    box_time_s: Annotated[
        float | None, Field(ge=0, description="The time of that frame; s. Absent: the first frame that is read.")
    ] = None
    first_corner_px: Annotated[
        Point | None,
        Field(
            description="Picture point nearest the first corner in that frame; without box_px in the frame in which "
            "the detector first sees the reference; px."
        ),
    ] = None
    params: Annotated[ReferenceParams, Field(description="How its corners are found.")] = ReferenceParams()

    @model_validator(mode="after")
    def _one_shape(self) -> ReferenceSettings:
        ways = ("square_m", "rectangle_m", "regular_m", "sides_m", "corners_m")
        given = [name for name in ways if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"give one of {', '.join(ways)} (there are {', '.join(given) or 'none'})")
        if (self.sides_m is None) != (self.diagonal_m is None):
            raise ValueError("sides_m and diagonal_m go together")
        return self

    def shape(self) -> ReferenceShape:
        """Return the shape in metres."""
        if self.square_m is not None:
            return ReferenceShape.square(self.square_m)
        if self.rectangle_m is not None:
            return ReferenceShape.rectangle(*self.rectangle_m)
        if self.regular_m is not None:
            return ReferenceShape.regular(*self.regular_m)
        if self.sides_m is not None and self.diagonal_m is not None:
            return ReferenceShape.from_sides(self.sides_m, self.diagonal_m)
        assert self.corners_m is not None, "checked in _one_shape"
        return ReferenceShape.from_corners(self.corners_m)


class GroundSettings(_Section):
    """Where a pixel becomes a metre: a survey, a reference object, markers, or what the source tells by itself."""

    auto: Annotated[
        bool,
        Field(
            description="Without survey and reference: measure by the drone's telemetry and by the sizes of people as "
            "well. False: by markers only, and by nothing where there are none."
        ),
    ] = True

    survey: Annotated[
        Path | None,
        Field(
            description="YAML file of surveyed points. Of a fixed camera; where the camera moves, of one picture: with "
            "time_s in the file, or beside reference objects and markers."
        ),
    ] = None
    reference: Annotated[
        ReferenceSettings | None,
        Field(
            description="A reference object: its shape (square_m, rectangle_m, regular_m, sides_m with diagonal_m, or "
            "corners_m), where it is (box_px, box_time_s, first_corner_px), and params (method, thresholds)."
        ),
    ] = None
    more_references: Annotated[
        tuple[ReferenceSettings, ...],
        Field(
            description="Further reference objects. One with corners_m lies there in the site frame; another stands "
            "wherever it is seen, and so does the first one beside a survey."
        ),
    ] = ()
    markers: Annotated[
        tuple[MarkerSettings, ...],
        Field(
            description="Printed markers (see `standoff marker`): id, size_m, and a place unless it is the only one."
        ),
    ] = ()
    marker_family: Annotated[MarkerFamily, Field(description="Of all printed markers.")] = "apriltag36h11"
    camera: Annotated[Path | None, Field(description="Camera file whose lens distortion is removed first.")] = None

    @model_validator(mode="after")
    def _one_source(self) -> GroundSettings:
        if self.more_references and self.reference is None:
            raise ValueError("more_references need a reference, which says where the site frame is")
        if len({one.params.method for one in self.references}) > 1:
            raise ValueError("all references are looked for by one method")
        check_markers(self.markers, "survey" if self.survey else "reference" if self.reference else None)
        return self

    @property
    def references(self) -> tuple[ReferenceSettings, ...]:
        """All reference objects, the most important one first."""
        return () if self.reference is None else (self.reference, *self.more_references)


class Replacement(_Section):
    """A stage of your own in place of standoff's."""

    factory: Annotated[str, Field(pattern=r"^[\w.]+:\w+$", description="`package.module:callable`.")]
    options: Annotated[dict[str, Any], Field(description="Keyword arguments for it.")] = {}


class Settings(BaseSettings):
    """Everything that a run depends on, beside its source."""

    model_config = SettingsConfigDict(
        extra="forbid",
        frozen=True,
        env_prefix="STANDOFF_",
        env_nested_delimiter="__",
        nested_model_default_partial_update=True,
    )

    model: Annotated[
        ShippedModel | Path,
        Field(description="The detector: site (ours), or an ONNX file (see `standoff export`)."),
    ] = "site"
    detections: Annotated[
        Path | None,
        Field(
            description="An earlier run of the same source (its folder, or its detections.parquet) whose detections "
            "are replayed; model, detect and a detect stage of your own then have no effect."
        ),
    ] = None
    source: Annotated[SourceParams, Field(description="Which part of the source is read, and how.")] = SourceParams()
    detect_every: Annotated[int, Field(ge=1, description="Detect on every k-th frame read; tracks coast between.")] = 1
    detect_near_m: Annotated[
        float | None,
        Field(
            ge=0,
            description="With detect_every: on every frame while a pair's gap is, or within a second will be, below so "
            "many m, or is not measured. null: never.",
        ),
    ] = 3.0
    detect: Annotated[DetectParams, Field(description="The detector.")] = DetectParams()
    motion: Annotated[MotionParams, Field(description="How the picture is followed.")] = MotionParams()
    ground: Annotated[GroundSettings, Field(description="The ground map.")] = GroundSettings()
    track: Annotated[TrackParams, Field(description="The tracker.")] = TrackParams()
    locate: Annotated[LocateParams, Field(description="From boxes to places on the ground.")] = LocateParams()
    watched: Annotated[WatchedParams, Field(description="Where on the ground a worker would be found.")] = (
        WatchedParams()
    )
    zones: Annotated[
        Path | None,
        Field(description="GeoJSON file of zones in the site frame, and who must not be in them. Absent: none."),
    ] = None
    proximity: Annotated[ProximityParams, Field(description="Distances of pairs.")] = ProximityParams()
    hazard: Annotated[HazardParams, Field(description="From distances to warnings.")] = HazardParams()
    outputs: Annotated[
        tuple[Annotated[str, AfterValidator(_known_output)], ...],
        Field(description="What is written beside run.json."),
    ] = tuple(OUTPUTS)
    tables: Annotated[TableParams, Field(description="The Parquet tables.")] = TableParams()
    show: Annotated[ShowParams, Field(description="How people read lengths and see people.")] = ShowParams()
    video: Annotated[VideoParams, Field(description="The annotated video.")] = VideoParams()
    report: Annotated[ReportParams, Field(description="The report.")] = ReportParams()
    replace: Annotated[dict[StageName, Replacement], Field(description="Stages of your own.")] = {}
    extra_outputs: Annotated[dict[str, Replacement], Field(description="Sinks of your own, by name.")] = {}

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_names(cls, values: dict[str, Any]) -> dict[str, Any]:
        _refuse_unknown_key(values, cls.model_fields, "the top level", _inner_names(cls.model_fields))
        for name, info in cls.model_fields.items():
            _refuse_unknown(info.annotation, values.get(name), name)
        return values

    @model_validator(mode="wrap")
    @classmethod
    def _refuse_boolean_numbers(cls, values: Any, handler: ModelWrapValidatorHandler[Settings]) -> Settings:  # noqa: ANN401
        settings = handler(values)
        _refuse_boolean(values, settings, "")
        return settings

    @model_validator(mode="after")
    def _refuse_taken_names(self) -> Settings:
        taken = sorted(self.extra_outputs.keys() & {*OUTPUTS, "looks", "record"})
        if taken:
            raise ValueError(f"extra_outputs: {', '.join(taken)} is the name of an output of standoff's own")
        return self


def _refuse_unknown(annotation: object, value: object, path: str) -> None:
    """Raise ValueError for a key that no field has, also in the plain dataclasses, which pydantic lets pass."""
    if is_dataclass(annotation) and isinstance(value, Mapping):
        hints = get_type_hints(annotation)
        _refuse_unknown_key(value, hints, path)
        for key, inner in value.items():
            _refuse_unknown(hints[key], inner, f"{path}.{key}")


def _refuse_boolean(given: object, made: object, path: str) -> None:
    """Raise ValueError for true and false where a number was made of it: pydantic takes them for 1 and 0."""
    if isinstance(given, Mapping):
        for key, inner in given.items():
            of_key = made.get(key) if isinstance(made, Mapping) else getattr(made, str(key), None)
            _refuse_boolean(inner, of_key, f"{path}.{key}".lstrip("."))
    elif isinstance(given, (list, tuple)) and isinstance(made, (list, tuple)):
        for inner, of_inner in zip(given, made, strict=False):
            _refuse_boolean(inner, of_inner, path)
    elif isinstance(given, bool) and isinstance(made, (int, float)) and not isinstance(made, bool):
        raise ValueError(f"{path}: {str(given).lower()} where a number should be")


def _inner_names(fields: Mapping[str, FieldInfo]) -> dict[str, str]:
    """Return by the name of a setting inside a section which section has it, the first one of several."""
    sections = {name: info.annotation for name, info in reversed(list(fields.items())) if is_dataclass(info.annotation)}
    return {inner: name for name, annotation in sections.items() for inner in get_type_hints(annotation)}


def _refuse_unknown_key(
    given: Mapping[str, object], known: Iterable[str], path: str, elsewhere: Mapping[str, str] = MappingProxyType({})
) -> None:
    names = list(known)
    for key in given:
        if key not in names:
            near = difflib.get_close_matches(str(key), names, n=1)
            if key in elsewhere:
                near = [f"{elsewhere[key]}.{key}"]
            meant = f"did you mean {near[0]}?" if near else f"there are {', '.join(names)}"
            raise ValueError(f"{path} has no setting {key!r}; {meant}")
