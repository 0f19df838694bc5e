"""One Settings tree, and the pipeline that it describes.

Every stage's own settings are a plain dataclass beside the stage; this module is the only one that
knows pydantic, which checks their bounds. Sources, strongest first: the command line, environment
variables (`STANDOFF_DETECT_EVERY=3`, `STANDOFF_TRACK__MAX_COAST_S=2`), the YAML file, the defaults.
"""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_type_hints

import yaml
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator
from pydantic_core import ErrorDetails
from pydantic_settings import BaseSettings, InitSettingsSource, PydanticBaseSettingsSource, SettingsConfigDict

from standoff.core.camera import Camera
from standoff.core.errors import ConfigError
from standoff.core.protocols import Detector, Ground
from standoff.core.types import Frame, Sink
from standoff.pipeline import Pipeline
from standoff.stages.detect import DetectParams, OnnxDetector
from standoff.stages.ground import (
    ReferenceGround,
    ReferenceParams,
    ReferenceShape,
    Unmapped,
    load_camera,
    load_survey,
)
from standoff.stages.hazard import HazardMonitor, HazardParams
from standoff.stages.locate import LocateParams, Locator
from standoff.stages.proximity import ProximityMeter, ProximityParams
from standoff.stages.sinks import ReportParams, TableParams, VideoParams
from standoff.stages.track import Tracker, TrackParams

Point = tuple[float, float]
StageName = Literal["detect", "ground", "track", "locate", "proximity", "hazard"]
STAGE_NAMES: tuple[StageName, ...] = ("detect", "ground", "track", "locate", "proximity", "hazard")
OutputName = Literal["tracks", "proximity", "frames", "hazards", "video", "report"]
OUTPUT_NAMES: tuple[OutputName, ...] = ("tracks", "proximity", "frames", "hazards", "video", "report")


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ReferenceSettings(_Section):
    """The reference object: its true shape in one of four ways, and where to look for it."""

    square_m: Annotated[float | None, Field(gt=0, description="Side of a square; m.")] = None
    rectangle_m: Annotated[Point | None, Field(description="Length and width of a rectangle; m.")] = None
    sides_m: Annotated[
        tuple[float, float, float, float] | None,
        Field(description="Four sides in order, counter-clockwise seen from above; m. Needs diagonal_m."),
    ] = None
    diagonal_m: Annotated[
        float | None, Field(gt=0, description="From the first corner to the third; m. Goes with sides_m.")
    ] = None
    corners_m: Annotated[
        tuple[Point, Point, Point, Point] | None,
        Field(description="Four corners, counter-clockwise seen from above, in the site frame; m."),
    ] = None
    box_px: Annotated[
        tuple[float, float, float, float] | None,
        Field(description="Its box in one frame: left, top, right, bottom; px. Absent: the detector finds it."),
    ] = None
    box_time_s: Annotated[
        float | None, Field(ge=0, description="The time of that frame; s. Absent: the first frame that is read.")
    ] = None
    first_corner_px: Annotated[
        Point | None, Field(description="Picture point nearest the first corner in that frame; px.")
    ] = None
    params: Annotated[ReferenceParams, Field(description="How its corners are found.")] = ReferenceParams()

    @model_validator(mode="after")
    def _one_shape(self) -> ReferenceSettings:
        given = [n for n in ("square_m", "rectangle_m", "sides_m", "corners_m") if getattr(self, n) is not None]
        if len(given) != 1:
            raise ValueError(
                f"give one of square_m, rectangle_m, sides_m, corners_m (there are {', '.join(given) or 'none'})"
            )
        if (self.sides_m is None) != (self.diagonal_m is None):
            raise ValueError("sides_m and diagonal_m go together")
        return self

    def shape(self) -> ReferenceShape:
        """Return the shape in metres."""
        if self.square_m is not None:
            return ReferenceShape.square(self.square_m)
        if self.rectangle_m is not None:
            return ReferenceShape.rectangle(*self.rectangle_m)
        if self.sides_m is not None and self.diagonal_m is not None:
            return ReferenceShape.from_sides(self.sides_m, self.diagonal_m)
        assert self.corners_m is not None, "checked in _one_shape"
        return ReferenceShape.from_corners(self.corners_m)


class GroundSettings(_Section):
    """Where a pixel becomes a metre: a survey, or a reference object, or nothing (no measurement)."""

    survey: Annotated[Path | None, Field(description="YAML file of surveyed points, for a fixed camera.")] = None
    reference: Annotated[
        ReferenceSettings | None,
        Field(
            description="A reference object: its shape (square_m, rectangle_m, sides_m with diagonal_m, or corners_m), "
            "where it is (box_px, box_time_s, first_corner_px), and params (method, thresholds)."
        ),
    ] = None
    camera: Annotated[Path | None, Field(description="Camera file whose lens distortion is removed first.")] = None

    @model_validator(mode="after")
    def _one_source(self) -> GroundSettings:
        if self.survey is not None and self.reference is not None:
            raise ValueError("give either survey or reference, not both")
        return self


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

    model: Annotated[Path | None, Field(description="The detector, an ONNX file (see `standoff export`).")] = None
    start_s: Annotated[float, Field(ge=0, description="Begin here; s.")] = 0.0
    stop_s: Annotated[float | None, Field(gt=0, description="End here; s. Absent: the source's end.")] = None
    every: Annotated[int, Field(ge=1, description="Read every k-th frame only.")] = 1
    fps: Annotated[float | None, Field(gt=0, description="Frames a second of an image folder.")] = None
    detect_every: Annotated[int, Field(ge=1, description="Detect on every k-th frame read; tracks coast between.")] = 1
    detect: Annotated[DetectParams, Field(description="The detector.")] = DetectParams()
    ground: Annotated[GroundSettings, Field(description="The ground map.")] = GroundSettings()
    track: Annotated[TrackParams, Field(description="The tracker.")] = TrackParams()
    locate: Annotated[LocateParams, Field(description="From boxes to places on the ground.")] = LocateParams()
    proximity: Annotated[ProximityParams, Field(description="Distances of pairs.")] = ProximityParams()
    hazard: Annotated[HazardParams, Field(description="From distances to warnings.")] = HazardParams()
    outputs: Annotated[tuple[OutputName, ...], Field(description="What is written beside run.json.")] = OUTPUT_NAMES
    tables: Annotated[TableParams, Field(description="The Parquet tables.")] = TableParams()
    video: Annotated[VideoParams, Field(description="The annotated video.")] = VideoParams()
    report: Annotated[ReportParams, Field(description="The report.")] = ReportParams()
    replace: Annotated[dict[StageName, Replacement], Field(description="Stages of your own.")] = {}
    extra_outputs: Annotated[dict[str, Replacement], Field(description="Sinks of your own, by name.")] = {}

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_names(cls, values: dict[str, Any]) -> dict[str, Any]:
        for name, info in cls.model_fields.items():
            _refuse_unknown(info.annotation, values.get(name), name)
        return values

    @model_validator(mode="after")
    def _refuse_taken_names(self) -> Settings:
        taken = sorted(self.extra_outputs.keys() & {*OUTPUT_NAMES, "record"})
        if taken:
            raise ValueError(f"extra_outputs: {', '.join(taken)} is the name of an output of standoff's own")
        return self


def _refuse_unknown(annotation: object, value: object, path: str) -> None:
    """Raise ValueError for a key that no field has, also in the plain dataclasses, which pydantic lets pass."""
    if not is_dataclass(annotation) or not isinstance(value, Mapping):
        return
    hints = get_type_hints(annotation)
    for key, inner in value.items():
        if key not in hints:
            near = difflib.get_close_matches(str(key), hints, n=1)
            meant = f"did you mean {near[0]}?" if near else f"there are {', '.join(hints)}"
            raise ValueError(f"{path} has no setting {key!r}; {meant}")
        _refuse_unknown(hints[key], inner, f"{path}.{key}")


def _clause(error: ErrorDetails) -> str:
    """Return one pydantic error as `where: what (found ...)`."""
    where = ".".join(str(part) for part in error["loc"])
    message = error["msg"].removeprefix("Value error, ")
    found = "" if isinstance(error["input"], (dict, list)) else f" (found {error['input']!r})"
    return f"{where}: {message}{found}" if where else message


def _config_error(origin: str, error: ValidationError) -> ConfigError:
    clauses = [_clause(one) for one in error.errors()]
    more = f"; and {len(clauses) - 3} more" if len(clauses) > 3 else ""
    return ConfigError(
        expected=f"valid settings in {origin}",
        found="; ".join(clauses[:3]) + more,
        fix="correct them; `standoff config show` lists every setting with its meaning and bounds",
    )


def _read_yaml(path: Path) -> dict[str, Any]:
    try:
        loaded = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(
            expected=f"a readable settings file at {path}", found=str(error.strerror), fix="check the path"
        ) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(expected=f"YAML in {path}", found=str(error), fix="correct the file") from error
    if loaded is None:
        return {}
    if not isinstance(loaded, dict):
        raise ConfigError(
            expected=f"settings by name in {path}", found=type(loaded).__name__, fix="write `name: value` lines"
        )
    return loaded


def _anchor_paths(settings: dict[str, Any], folder: Path) -> None:
    """Make the file's paths relative to the file, not to wherever the program was started."""
    ground = settings.get("ground")
    for section, name in ((settings, "model"), (ground, "survey"), (ground, "camera")):
        if isinstance(section, dict) and isinstance(section.get(name), str):
            section[name] = str(folder / section[name])


def load_settings(path: Path | str | None = None, overrides: Mapping[str, Any] | None = None) -> Settings:
    """Read the settings file, the environment and the overrides into one checked tree.

    Args:
        path: YAML file; paths in it are relative to it. None: defaults.
        overrides: Nested settings that win over everything else, as the command line gives them.

    Raises:
        ConfigError: A file that cannot be read, a name that does not exist, a value out of bounds.
    """
    from_file: dict[str, Any] = {}
    if path is not None:
        path = Path(path)
        from_file = _read_yaml(path)
        _anchor_paths(from_file, path.parent)

    class _FileSettings(Settings):
        @classmethod
        def settings_customise_sources(
            cls,
            settings_cls: type[BaseSettings],
            init_settings: PydanticBaseSettingsSource,
            env_settings: PydanticBaseSettingsSource,
            dotenv_settings: PydanticBaseSettingsSource,
            file_secret_settings: PydanticBaseSettingsSource,
        ) -> tuple[PydanticBaseSettingsSource, ...]:
            return init_settings, env_settings, InitSettingsSource(settings_cls, from_file)

    try:
        return _FileSettings(**dict(overrides or {}))
    except ValidationError as error:
        raise _config_error(str(path) if path else "the command line and environment", error) from error


def resolved(settings: Settings) -> dict[str, Any]:
    """Return the settings as plain JSON values, every default filled in."""
    plain = TypeAdapter(Settings).dump_python(settings, mode="json")
    assert isinstance(plain, dict)
    return plain


def build_replacement(name: str, replacement: Replacement) -> Any:  # noqa: ANN401
    """Make a stage or a sink of the user's own.

    Raises:
        ConfigError: It cannot be imported, or does not take the options.
    """
    module_name, _, attribute = replacement.factory.partition(":")
    try:
        factory = getattr(importlib.import_module(module_name), attribute)
        return factory(**replacement.options)
    except (ImportError, AttributeError, TypeError, ValueError, OSError) as error:
        raise ConfigError(
            expected=f"{replacement.factory} to make {name}",
            found=str(error),
            fix="name an importable `package.module:callable` and options that it takes",
        ) from error


def build_detector(settings: Settings) -> Detector:
    """Load the configured model.

    Raises:
        ConfigError: No model is configured.
        ModelError: It cannot be used.
    """
    if settings.model is None:
        raise ConfigError(
            expected="a detector",
            found="none (no --model, no `model:` in the settings)",
            fix="pass --model model.onnx; `standoff export` makes one from Darknet weights",
        )
    return OnnxDetector(settings.model, settings.detect)


def build_ground(settings: Settings) -> Ground:
    """Make the configured ground stage.

    Raises:
        GroundError: Its points, shape or camera file cannot be used.
    """
    camera: Camera | None = load_camera(settings.ground.camera) if settings.ground.camera else None
    if settings.ground.survey is not None:
        return load_survey(settings.ground.survey, camera=camera)
    reference = settings.ground.reference
    if reference is None:
        return Unmapped()
    return ReferenceGround(
        reference.shape(),
        reference.params,
        box_xyxy_px=reference.box_px,
        box_time_s=reference.box_time_s,
        first_corner_px=reference.first_corner_px,
        camera=camera,
    )


_MAKERS: Mapping[StageName, Callable[[Settings], Any]] = {
    "detect": build_detector,
    "ground": build_ground,
    "track": lambda settings: Tracker(settings.track),
    "locate": lambda settings: Locator(settings.locate),
    "proximity": lambda settings: ProximityMeter(settings.proximity),
    "hazard": lambda settings: HazardMonitor(settings.hazard),
}


def build_stage(name: StageName, settings: Settings) -> Any:  # noqa: ANN401
    """Make one stage, standoff's own or the configured replacement.

    Raises:
        StandoffError: Something that the settings name cannot be used.
    """
    if name in settings.replace:
        return build_replacement(name, settings.replace[name])
    return _MAKERS[name](settings)


def build_pipeline(settings: Settings, frames: Iterable[Frame], sinks: Mapping[str, Sink] | None = None) -> Pipeline:
    """Make one stream's pipeline; all state belongs to the objects made here.

    Args:
        settings: What to build.
        frames: The source.
        sinks: Outputs by name, in the order in which they get each frame.

    Raises:
        StandoffError: A model, survey, camera or replacement that cannot be used.
    """
    return Pipeline(
        frames=frames,
        detector=build_stage("detect", settings),
        ground=build_stage("ground", settings),
        tracker=build_stage("track", settings),
        locator=build_stage("locate", settings),
        proximity=build_stage("proximity", settings),
        hazard=build_stage("hazard", settings),
        sinks=dict(sinks or {}),
        detect_every=settings.detect_every,
    )
