"""Make the stages that the settings describe."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any

from standoff.config.settings import ReferenceSettings, Replacement, Settings, StageName
from standoff.core import protocols
from standoff.core.camera import Camera, CameraPrior
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ConfigError
from standoff.core.finding import WorkerFinding
from standoff.core.geographic import GeographicOrigin
from standoff.core.protocols import CameraMotionEstimator, Detector, Ground, missing_of
from standoff.core.zones import Zone
from standoff.files.zone_file import read_zones
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
from standoff.stages.proximity import ProximityMeter, machines_near_people
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


def build_replacement(name: str, replacement: Replacement, contract: type) -> Any:  # noqa: ANN401
    """Make a stage or a sink of the user's own.

    Args:
        name: What it stands for.
        replacement: What makes it.
        contract: What it must be able to do: one of `standoff.core.protocols`.

    Raises:
        ConfigError: It cannot be imported, does not take the options, or makes something that lacks a method.
    """
    factory = import_factory(replacement)
    try:
        made = factory(**replacement.options)
    except (TypeError, ValueError, OSError) as error:
        raise ConfigError(
            expected=f"{replacement.factory} to make {name} of its options",
            found=str(error),
            fix="correct the options",
        ) from error
    if missing := missing_of(made, contract):
        raise ConfigError(
            expected=f"{replacement.factory} to make a {contract.__name__}",
            found=f"{type(made).__name__} without {', '.join(missing)}",
            fix=f"derive it from standoff.core.protocols.{contract.__name__}, which has what you need not write",
        )
    return made


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
        WorkerFinding.of_detector(detector.describe()),
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
    return read_zones(settings.zones, site_origin(settings))


def site_origin(settings: Settings) -> GeographicOrigin | None:
    """Return where on the earth the site frame begins; None: no survey in degrees says so.

    Raises:
        GroundError: The survey cannot be used.
    """
    survey = settings.ground.survey
    own_ground = "ground" in settings.replace
    return None if survey is None or own_ground else load_survey(survey).origin


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


_CONTRACTS: Mapping[StageName, type] = {
    "detect": protocols.Detector,
    "motion": protocols.CameraMotionEstimator,
    "ground": protocols.Ground,
    "track": protocols.Tracker,
    "locate": protocols.Locator,
    "watched": protocols.GroundWatcher,
    "proximity": protocols.ProximityMeter,
    "hazard": protocols.HazardMonitor,
}

_MAKERS: Mapping[StageName, Callable[[Settings], Any]] = {
    "detect": build_detector,
    "motion": build_motion,
    "track": lambda settings: Tracker(settings.track),
    "locate": lambda settings: Locator(settings.locate),
    "proximity": lambda settings: ProximityMeter(settings.proximity),
    "hazard": lambda settings: HazardMonitor(
        settings.hazard,
        build_zones(settings),
        machines_near_people(settings.proximity.pairs),
        settings.proximity.parked_after_s,
    ),
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
        return build_replacement(name, settings.replace[name], _CONTRACTS[name])
    if name == "ground":
        return build_ground(settings, camera)
    if name == "watched":
        return build_watcher(settings, detector or build_stage("detect", settings))
    return _MAKERS[name](settings)
