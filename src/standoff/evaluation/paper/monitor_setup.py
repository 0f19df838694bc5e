"""How the monitor is set up on a clip."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from standoff.clips import Clip, TrueReference, is_recording
from standoff.config import Settings, build_stage, build_watcher, load_settings
from standoff.core.errors import DataError
from standoff.core.protocols import Detector, Tracker
from standoff.evaluation.paper.truth_detector import REFERENCE_MARGIN_PX, BoxError, TrueBoxes
from standoff.monitor import Monitor
from standoff.stages.detect import RecordedDetector
from standoff.stages.frames import FileSource
from standoff.stages.ground import ReferenceMethod, ReferenceShape, ScaleWatch
from standoff.stages.locate import Anchor, LocateParams
from standoff.stages.proximity import ProximityParams

CameraKnowledge = Literal["file", "unknown"]
HeightKnowledge = Literal["known", "unknown"]


@dataclass(frozen=True, slots=True)
class MonitorSetup:
    """What is tried.

    Attributes:
        method: How the reference is found. With "paper" everything is as printed: the centre of the box, its outlier
            filter, lens distortion left in the picture. Otherwise the clip's camera file removes it.
        detector: "truth", "noisy", a model, or a run of the clip (its folder or its table of detections) to replay.
        anchor: Point of the box that stands for an entity; None: the centre with "paper", standoff's default otherwise.
        box_error: For "noisy".
        seed: For "noisy".
        camera: "file" removes the lens distortion of the clip's camera file, "unknown" keeps it from the monitor;
            None: unknown with "paper", else the file.
        height: Whether the monitor is told how high the reference is, where the clip's settings say it.
    """

    method: ReferenceMethod = "paper"
    detector: Literal["truth", "noisy"] | Path = "truth"
    anchor: Anchor | None = None
    box_error: BoxError = field(default_factory=BoxError)
    seed: int = 0
    camera: CameraKnowledge | None = None
    height: HeightKnowledge = "known"

    @property
    def anchor_used(self) -> Anchor:
        """The point of the box, decided."""
        return self.anchor or ("box_centre" if self.method == "paper" else LocateParams().anchor)

    @property
    def outlier_filter(self) -> str:
        """What removes outliers of distances."""
        return "paper" if self.method == "paper" else ProximityParams().outlier_filter

    @property
    def knows_lens(self) -> bool:
        """Whether the monitor has the camera file."""
        return self.method != "paper" if self.camera is None else self.camera == "file"

    def _detector_name(self) -> str:
        if isinstance(self.detector, str):
            return self.detector
        name = self.detector.resolve().name
        return f"recorded in {name}" if is_recording(self.detector) else name

    def describe(self) -> dict[str, Any]:
        """Return what was tried, for people and machines."""
        about: dict[str, Any] = {
            "method": self.method,
            "anchor": self.anchor_used,
            "detector": self._detector_name(),
            "camera": "file" if self.knows_lens else "unknown",
            "height of the reference": self.height,
            "outlier filter": self.outlier_filter,
        }
        if not isinstance(self.detector, Path):
            about["reference box drawn wide by, px"] = REFERENCE_MARGIN_PX
        if self.detector == "noisy":
            about["box error, px"] = self.box_error.px
            about["box error, share of the side"] = self.box_error.share
            about["seed"] = self.seed
        return about


def build_monitor(clip: Clip, setup: MonitorSetup, source: FileSource) -> Monitor:
    """Make the monitor for one clip.

    Args:
        clip: The truth, of which the monitor is shown the reference's shape and what the setup says.
        setup: What to try.
        source: The clip's video.

    Raises:
        DataError: There is no reference object.
        StandoffError: The model or the recorded detections cannot be used, or the clip's own files are broken.
    """
    settings = settings_for(clip, setup)
    detector: Detector
    tracker: Tracker
    if isinstance(setup.detector, Path):
        detector, tracker = build_stage("detect", settings), build_stage("track", settings)
        _check_reference_class(detector, setup.detector)
        if isinstance(detector, RecordedDetector):
            detector.check_source(source.describe())
    else:
        detector = tracker = TrueBoxes(clip, setup.box_error if setup.detector == "noisy" else None, setup.seed)
    ground = build_stage("ground", settings, source.camera_prior)
    return Monitor(
        detector=detector,
        motion=build_stage("motion", settings),
        # Truth judges the metres here; a watch that withheld some of them would hide what the method does.
        ground=ground.inner if isinstance(ground, ScaleWatch) else ground,
        tracker=tracker,
        locator=build_stage("locate", settings),
        watcher=build_watcher(settings, detector),
        proximity=build_stage("proximity", settings),
        hazard=build_stage("hazard", settings),
    )


def settings_for(clip: Clip, setup: MonitorSetup) -> Settings:
    """Return the settings: the clip's own description of its reference, and what the setup changes.

    Raises:
        DataError: There is no reference object.
        ConfigError: `reference.yaml` is not a settings file.
    """
    if clip.reference is None:
        raise DataError(
            expected="a clip with a reference object", found=f"none in {clip.folder}", fix="choose another preset"
        )
    # The detector says where the reference is, nobody but the clip which of its corners is the first.
    place = {"box_px": None, "box_time_s": None, "first_corner_px": _first_corner_px(clip, clip.reference)}
    height = {} if setup.height == "known" else {"height_m": None}
    ground: dict[str, Any] = {
        "reference": {"params": {"method": setup.method}, **place, **height},
        "camera": str(clip.camera_file) if setup.knows_lens else None,
    }
    overrides: dict[str, Any] = {
        "ground": ground,
        "locate": {"anchor": setup.anchor_used, "smooth": setup.method != "paper"},
        "proximity": {"outlier_filter": setup.outlier_filter},
    }
    if isinstance(setup.detector, Path):
        overrides["detections" if is_recording(setup.detector) else "model"] = str(setup.detector)
    return load_settings(clip.settings_file, overrides)


def _first_corner_px(clip: Clip, reference: TrueReference) -> list[float] | None:
    """Return where the shape's first corner is when the reference is first seen; None when it never is."""
    seen = np.isfinite(clip.reference_box_px).all(axis=1) & np.isfinite(reference.corners_px).all(axis=(1, 2))
    if not seen.any():
        return None
    first_m = ReferenceShape.from_corners(reference.corners_m).corners_m[0]
    corner = np.linalg.norm(reference.corners_m - first_m, axis=1).argmin()
    corner_px: list[float] = reference.corners_px[seen.argmax(), corner].tolist()
    return corner_px


def _check_reference_class(detector: Detector, model: Path) -> None:
    class_map = detector.describe().get("class_map")
    # A detector of somebody's own, replayed, may not say what it knows.
    if class_map is not None and "reference" not in class_map.values():
        raise DataError(
            expected="a model with a class `reference`, which tells where the reference object is",
            found=f"{model} without one",
            fix="use another model, or --detector truth",
        )
