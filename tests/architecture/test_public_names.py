"""What a program may import, written down, so that a change of it is a decision and not an accident."""

from __future__ import annotations

import importlib
import pkgutil
import subprocess
import sys

import pytest

import standoff

PUBLIC_NAMES = {
    "standoff.cli": {"app", "main"},
    "standoff.clips": {
        "COLUMNS", "DETECTIONS_FILE", "FOOT_COLUMNS", "RecordedDetections", "is_recording", "metadata_of",
        "read_detections",
    },
    "standoff.config": {
        "GroundSettings", "MarkerSettings", "ReferenceSettings", "Replacement", "STAGE_NAMES", "Settings",
        "SiteSettings", "StreamSettings", "build_ground", "build_marker_observer", "build_replacement", "build_stage",
        "build_watcher", "build_zones", "import_factory", "load_settings", "load_site", "read_params",
        "read_settings_file", "resolved",
    },
    "standoff.evaluation.coverage": {
        "ClipSamples", "CoverageResult", "PairRow", "PairSamples", "PositionRow", "PositionSamples",
        "evaluate_coverage", "read_samples", "score_samples",
    },
    "standoff.evaluation.detection": {"ClassScore", "Curve", "DetectionScore", "score_detections"},
    "standoff.evaluation.paper": {
        "BoxError", "Clip", "ClipResult", "PaperFigure", "PooledMap", "Trial", "evaluate_clip", "load_clip", "pool",
        "write_report",
    },
    "standoff.evaluation.watched": {
        "Missed", "WatchedResult", "WorkerSamples", "evaluate_watched", "read_worker_samples", "score_watched",
    },
    "standoff.labels": {
        "LabelledData", "LabelledPicture", "Problem", "ProposedPicture", "SPLITS", "Split", "load_picture",
        "read_data", "to_site_classes", "write_coco", "write_label_studio",
    },
    "standoff.monitor": {
        "FanOut", "LiveQueue", "Monitor", "QueueState", "Run", "RunFolder", "RunRecord", "build_monitor", "open_run",
        "warnings_of",
    },
    "standoff.simulation.behaviour": {
        "carrying_between", "crossing_behind", "digging", "dozing", "driving_through", "grading", "idle",
        "keep_distance", "loader_loading", "near_miss", "pair_talking", "random_stance", "rolling", "spreading",
        "standing_working", "stooping", "truck_loading", "walking_past",
    },
    "standoff.simulation.render": {"Cutout", "Look", "Rendered", "Renderer"},
    "standoff.stages.detect": {
        "DEFAULT_CLASS_MAP", "DetectParams", "OnnxDetector", "RecordedDetector", "SHIPPED_MODELS", "SharedDetector",
        "ShippedModel", "available_providers", "find_model",
    },
    "standoff.stages.frames": {
        "ArrayPicture", "AvPicture", "Scaler", "Source", "SourceParams", "frame_from_array", "local_path",
        "open_source",
    },
    "standoff.stages.ground": {
        "BoardView", "CalibrationResult", "FixedCamera", "FusedGround", "FusedParams", "GivenPlace",
        "MARKER_FAMILIES", "MarkerFamily", "MarkerObserver", "MarkerPlace", "Markers", "PointObservation",
        "Reference", "ReferenceGround", "ReferenceParams", "ReferenceShape", "ScaleWatch", "SurveyedGround",
        "TelemetryPose", "Unmapped", "belief_from_points", "calibrate", "calibrate_views", "find_corners",
        "find_markers", "fit_points", "load_camera", "load_survey", "map_from_view", "marker_pattern", "read_boards",
        "save_camera", "view_from_telemetry",
    },
    "standoff.stages.hazard": {"HazardMonitor", "HazardParams"},
    "standoff.stages.locate": {"LocateParams", "Locator"},
    "standoff.stages.motion": {"MotionEstimator", "MotionParams"},
    "standoff.stages.proximity": {"ProximityMeter", "ProximityParams", "side_classes"},
    "standoff.stages.sinks": {
        "Composer", "DETECTIONS", "DrawParams", "FRAMES", "HazardSink", "PROXIMITY", "ReportParams", "ReportSink",
        "ShowParams", "TRACKS", "Table", "TableParams", "TableSink", "VideoParams", "VideoSink", "Wanted",
        "ZONED_TRACKS", "detections_table", "make_sink", "percent_text", "prepare_output",
    },
    "standoff.stages.track": {"TrackParams", "Tracker"},
    "standoff.stages.watched": {"GroundWatcher", "WatchedParams"},
    "standoff.targets": {"PAPERS", "Paper", "SIZE_LIMITS_M", "Target", "Tile", "tiles", "write_target"},
    "standoff.testing": {"DrawnFilm", "FakeClock", "MemorySink", "ScriptedDetector"},
    "standoff.training": {
        "efficientnet_lite0_cfg", "export_darknet", "yolo_fastest_xl_cfg", "yolov3_cfg", "yolov3_tiny_cfg",
    },
    "standoff.training.architectures": {
        "ARCHITECTURES", "Anchors", "Architecture", "efficientnet_lite0_cfg", "yolo_fastest_xl_cfg", "yolov3_cfg",
        "yolov3_tiny_cfg",
    },
    "standoff.training.frame_selection": {
        "Choice", "LABEL_FILES", "LabelPlan", "LabelReport", "SelectionParams", "choose", "label_frames",
    },
    "standoff.training.ground_point": {
        "Patches", "PointError", "PointTraining", "measure_points", "read_patches", "train_points", "write_points",
    },
    "standoff.training.my_site": {"prepare_plan", "read_preset"},
}  # fmt: skip


@pytest.mark.parametrize("module", PUBLIC_NAMES)
def test_a_package_exports_what_is_written_down(module: str) -> None:
    package = importlib.import_module(module)
    assert set(package.__all__) == PUBLIC_NAMES[module]
    assert all(hasattr(package, name) for name in package.__all__)


def test_every_package_that_exports_anything_is_written_down() -> None:
    packages = (module.name for module in pkgutil.walk_packages(standoff.__path__, "standoff.") if module.ispkg)
    exporting = {name for name in packages if hasattr(importlib.import_module(name), "__all__")}
    assert exporting | {"standoff"} == PUBLIC_NAMES.keys() | {"standoff"}


_HEAVY = {"cv2", "torch", "onnxruntime", "numba", "matplotlib", "pyarrow", "av", "scipy"}


@pytest.mark.parametrize(
    ("light", "allowed"),
    [
        ("standoff", set()),
        ("standoff.cli", set()),
        ("standoff.files.json_text", set()),
        ("standoff.files.whole", set()),
        ("standoff.stages.sinks", {"cv2", "pyarrow", "av"}),
    ],
)
def test_heavy_libraries_wait_until_something_needs_them(light: str, allowed: set[str]) -> None:
    program = f"import sys, {light}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert _HEAVY & set(done.stdout.split()) <= allowed
