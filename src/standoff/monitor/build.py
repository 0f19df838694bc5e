"""Make the monitor that the settings describe."""

from __future__ import annotations

from standoff.config import Settings, build_stage
from standoff.core.camera import CameraPrior
from standoff.core.errors import ConfigError
from standoff.core.protocols import Detector
from standoff.monitor.monitor import Monitor
from standoff.stages.proximity import side_classes


def _check_visible(settings: Settings, detector: Detector) -> None:
    """Raise ConfigError where the model can never show what is to be measured: its silence would read as safety."""
    class_map = detector.describe().get("class_map")
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


def build_monitor(settings: Settings, camera: CameraPrior | None = None, detector: Detector | None = None) -> Monitor:
    """Make one stream's monitor; all state belongs to the objects made here.

    Args:
        settings: What to build.
        camera: What the source knows of its camera.
        detector: In place of the configured one: a `SharedDetector` that other streams ask as well.

    Raises:
        StandoffError: A model, survey, camera or replacement that cannot be used.
    """
    detector = detector or build_stage("detect", settings)
    _check_visible(settings, detector)
    return Monitor(
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
