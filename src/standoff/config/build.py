"""Make the stages and the pipeline that the settings describe."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from standoff.config.settings import ReferenceSettings, Replacement, Settings, StageName
from standoff.core.camera import Camera, CameraPrior
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ConfigError
from standoff.core.finding import WorkerFinding
from standoff.core.protocols import CameraMotionEstimator, Detector, Ground
from standoff.core.types import Frame
from standoff.core.zones import Zone
from standoff.files.zone_file import read_zones
from standoff.pipeline import Pipeline
from standoff.stages.detect import OnnxDetector, RecordedDetector, find_model
from standoff.stages.ground import (
    FixedCamera,
    FusedGround,
    FusedParams,
    GivenPlace,
    MarkerObserver,
    Reference,
    ReferenceGround,
    ScaleWatch,
    Unmapped,
    load_camera,
    load_survey,
)
from standoff.stages.hazard import HazardMonitor
from standoff.stages.locate import Locator
from standoff.stages.motion import MotionEstimator
from standoff.stages.proximity import ProximityMeter, side_classes
from standoff.stages.track import Tracker
from standoff.stages.watched import GroundWatcher


def import_factory(replacement: Replacement) -> Callable[..., Any]:
    """Import what makes a stage or a sink of the user's own.

    Raises:
        ConfigError: It cannot be imported.
    """
    module_name, _, attribute = replacement.factory.partition(":")
    try:
        factory: Callable[..., Any] = getattr(importlib.import_module(module_name), attribute)
    except (ImportError, AttributeError) as error:
        raise ConfigError(
            expected=f"{replacement.factory} to be importable",
            found=str(error),
            fix="install its package or add its folder to PYTHONPATH, and check both names",
        ) from error
    return factory


def build_replacement(name: str, replacement: Replacement) -> Any:  # noqa: ANN401
    """Make a stage or a sink of the user's own.

    Raises:
        ConfigError: It cannot be imported, or does not take the options.
    """
    factory = import_factory(replacement)
    try:
        return factory(**replacement.options)
    except (TypeError, ValueError, OSError) as error:
        raise ConfigError(
            expected=f"{replacement.factory} to make {name} of its options",
            found=str(error),
            fix="correct the options",
        ) from error


def build_detector(settings: Settings) -> Detector:
    """Load the configured model, or the detections of an earlier run.

    Raises:
        ModelError: The model cannot be used.
        DataError: The detections cannot.
    """
    if settings.detections is not None:
        return RecordedDetector(settings.detections)
    return OnnxDetector(find_model(settings.model), settings.detect)


def _configured_camera(settings: Settings) -> Camera | None:
    """Return the lens that the settings name, or their survey does: motion and map must know the same one."""
    ground = settings.ground
    if ground.camera is not None:
        return load_camera(ground.camera)
    return None if ground.survey is None else load_survey(ground.survey).camera


def build_motion(settings: Settings) -> CameraMotionEstimator:
    """Make what follows the picture, without the lens distortion where a camera file is given, here or in the survey.

    Raises:
        GroundError: The camera file cannot be used.
    """
    return MotionEstimator(settings.motion, _configured_camera(settings))


def build_marker_observer(settings: Settings) -> MarkerObserver | None:
    """Make what watches for the configured markers; None where there are none.

    Raises:
        GroundError: An id that the family does not have.
    """
    if not settings.ground.markers:
        return None
    return MarkerObserver([marker.place() for marker in settings.ground.markers], settings.ground.marker_family)


def build_ground(settings: Settings, known: CameraPrior | None = None) -> Ground:
    """Make the configured ground stage, with a watch over its metres.

    Args:
        settings: Of everything.
        known: What the source knows of its camera; a camera file knows better.

    Raises:
        GroundError: Its points, shape or camera file cannot be used.
    """
    camera = _configured_camera(settings)
    prior = known if camera is None else CameraPrior.calibrated(camera)
    ground = settings.ground
    given = ground.references
    survey = None if ground.survey is None else load_survey(ground.survey, camera=camera)
    if survey is not None and survey.time_s is None and not (given or ground.markers):
        return ScaleWatch(FixedCamera(survey), prior)
    method = given[0].params.method if given else "fused"
    if survey is not None and method != "fused":
        raise _unread("ground.survey", f"the method {method}")
    if method not in ("fused", "refined"):
        if len(given) > 1 or ground.markers:
            raise _unread("more references or ground.markers", f"the method {method}")
        one = _reference(given[0], defines_frame=True)
        return ScaleWatch(ReferenceGround(one.shape, one.params, place=one.place, camera=camera), prior)
    if not (given or ground.auto or ground.markers or survey):
        return Unmapped()
    fused = FusedGround(
        [_reference(one, defines_frame=k == 0 and survey is None) for k, one in enumerate(given)],
        build_marker_observer(settings),
        survey=survey,
        camera=prior,
        # Beside something of known size, people's sizes watch over the scale; alone they would be a guess beside it.
        params=FusedParams(telemetry=ground.auto, sizes=ground.auto and not given and survey is None),
        remember=method == "fused",
    )
    return ScaleWatch(fused, prior)


def build_watcher(settings: Settings, detector: Detector) -> GroundWatcher:
    """Make what judges which ground is watched.

    Args:
        settings: Of everything.
        detector: Says of itself how small a worker it finds.
    """
    worker = CLASS_BY_NAME["worker"]
    return GroundWatcher(
        settings.watched,
        WorkerFinding.of_detector(getattr(detector, "description", {})),
        settings.locate.radius_m.get(worker.name, worker.action_radius_m),
    )


def build_zones(settings: Settings) -> tuple[Zone, ...]:
    """Read the configured zones; those in degrees are placed by the survey.

    Raises:
        ConfigError: They cannot be used, or nobody would watch them.
        GroundError: The survey cannot be used.
    """
    if settings.zones is None:
        return ()
    if "hazard" in settings.replace:
        raise _unread("zones", "a hazard stage of your own")
    survey = settings.ground.survey
    own_ground = "ground" in settings.replace
    return read_zones(settings.zones, None if survey is None or own_ground else load_survey(survey).origin)


def _unread(what: str, beside: str) -> ConfigError:
    # Silence about a marker that nobody reads would pass for a site without one.
    return ConfigError(
        expected="only what the ground stage reads",
        found=f"{what} beside {beside}, which does not read them",
        fix="take one of the two out",
    )


def _reference(settings: ReferenceSettings, *, defines_frame: bool) -> Reference:
    return Reference(
        settings.shape(),
        settings.height_m,
        GivenPlace(settings.box_px, settings.box_time_s, settings.first_corner_px),
        settings.params,
        place_known=defines_frame or settings.corners_m is not None,
    )


_MAKERS: Mapping[StageName, Callable[[Settings], Any]] = {
    "detect": build_detector,
    "motion": build_motion,
    "track": lambda settings: Tracker(settings.track),
    "locate": lambda settings: Locator(settings.locate),
    "proximity": lambda settings: ProximityMeter(settings.proximity),
    "hazard": lambda settings: HazardMonitor(settings.hazard, build_zones(settings)),
}


def build_stage(
    name: StageName, settings: Settings, camera: CameraPrior | None = None, detector: Detector | None = None
) -> Any:  # noqa: ANN401
    """Make one stage, standoff's own or the configured replacement.

    Args:
        name: Of the stage.
        settings: Of everything.
        camera: What the source knows of its camera; for the ground.
        detector: For the watched ground; the configured one is made where it is left out.

    Raises:
        StandoffError: Something that the settings name cannot be used.
    """
    is_replayed = name == "detect" and settings.detections is not None
    if name in settings.replace and not is_replayed:
        return build_replacement(name, settings.replace[name])
    if name == "ground":
        return build_ground(settings, camera)
    if name == "watched":
        return build_watcher(settings, detector or build_stage("detect", settings))
    return _MAKERS[name](settings)


def _check_visible(settings: Settings, detector: Detector) -> None:
    """Raise ConfigError where the model can never show what is to be measured: its silence would read as safety."""
    class_map = getattr(detector, "description", {}).get("class_map")
    if class_map is None:
        return
    visible = frozenset(class_map.values())
    for pair in settings.proximity.pairs:
        for side in pair:
            if not side_classes(side) & visible:
                raise ConfigError(
                    expected=f"a model that can see both sides of proximity.pairs {list(pair)}",
                    found=f"one without any {side} (its labels give {', '.join(sorted(visible))})",
                    fix="choose another model, map its labels with detect.class_map, or change proximity.pairs",
                )
    if any(one.box_px is None for one in settings.ground.references) and "reference" not in visible:
        raise ConfigError(
            expected="to know where the reference object is",
            found="neither a box nor a model with a class `reference`",
            fix="give --reference-box left,top,right,bottom, or ground.reference.box_px",
        )


def build_pipeline(settings: Settings, frames: Iterable[Frame], camera: CameraPrior | None = None) -> Pipeline:
    """Make one stream's pipeline, without sinks; all state belongs to the objects made here.

    Args:
        settings: What to build.
        frames: The source.
        camera: What the source knows of its camera.

    Raises:
        StandoffError: A model, survey, camera or replacement that cannot be used.
    """
    detector = build_stage("detect", settings)
    _check_visible(settings, detector)
    return Pipeline(
        frames=frames,
        detector=detector,
        motion=build_stage("motion", settings),
        ground=build_stage("ground", settings, camera),
        tracker=build_stage("track", settings),
        locator=build_stage("locate", settings),
        watcher=build_stage("watched", settings, detector=detector),
        proximity=build_stage("proximity", settings),
        hazard=build_stage("hazard", settings),
        detect_every=settings.detect_every,
        detect_near_m=settings.detect_near_m,
        sure_score=settings.track.start_score,
    )
