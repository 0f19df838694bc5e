"""What a program may import, written down, so that a change of it is a decision and not an accident."""

from __future__ import annotations

import importlib
import pkgutil
import subprocess
import sys

import pytest

import standoff
import standoff_sim

PUBLIC_NAMES = {
    "standoff.cli": {"app", "main"},
    "standoff.clips": {
        "ANNOTATIONS_FILE", "CAMERA_FILE", "CLIP_FILES", "CLIP_FORMAT", "CLIP_FRAMES_FILE", "CLIP_FRAMES_SCHEMA",
        "COLUMNS", "Clip", "Column", "Columns", "DETECTIONS_FILE", "DEVICES_FILE", "DEVICES_SCHEMA", "FOOT_COLUMNS",
        "FRAME_COLUMNS", "MAP_COLUMNS",
        "NOISY_DETECTIONS_FILE", "NOISY_DETECTIONS_SCHEMA", "PAIRS_FILE", "PAIRS_SCHEMA", "REFERENCE_FILE",
        "RENDER_AGAIN", "RecordedDetections", "RunFolder", "RunTable", "SCENE_FILE", "TELEMETRY_FILE", "TRUTH_FILE",
        "TRUTH_FILES", "TRUTH_NUMBERS", "TRUTH_SCHEMA", "TrueBoard", "TrueReference", "VIDEO_FILE", "chosen_rows",
        "columns_of", "detections_of", "is_recording", "load_clip", "map_of", "map_values",
        "metadata_of", "read_clip_table", "read_columns",
        "read_detections", "read_scene", "schema_of",
    "KeptLooks", "part_path"},
    "standoff.config": {
        "AlertSettings", "BrokerSettings", "CaptureSettings", "GroundSettings", "LiveSettings", "MarkerSettings",
        "NotifySettings", "ReceiverSettings", "ReferenceSettings", "Replacement", "STAGE_NAMES", "Secret", "Settings",
        "ShiftSettings", "SiteSettings", "StreamSettings", "anchor_paths", "broker_settings", "build_ground",
        "build_marker_observer", "is_site", "read_secret",
        "build_replacement", "build_stage",
        "build_watcher", "build_zones", "import_factory", "load_settings", "load_site", "named_files", "read_params",
        "read_settings_file", "recorded_settings", "resolved", "settings_from",
        "site_origin",
    },
    "standoff.evaluation.coverage": {
        "ClipSamples", "CoverageResult", "PairRow", "PairSamples", "PositionRow", "PositionSamples",
        "evaluate_coverage", "read_samples", "score_samples",
    },
    "standoff.evaluation.detection": {"ClassScore", "Curve", "DetectionScore", "score_detections"},
    "standoff.evaluation.paper": {
        "BoxError", "ClipResult", "MonitorSetup", "PaperFigure", "PooledMap", "evaluate_clip", "pool", "write_report",
    },
    "standoff.evaluation.watched": {
        "Missed", "WatchedResult", "WorkerSamples", "evaluate_watched", "read_worker_samples", "score_watched",
    },
    "standoff.labels": {
        "LabelledData", "LabelledPicture", "Problem", "ProposedPicture", "SPLITS", "Split", "load_picture",
        "read_data", "to_site_classes", "write_coco", "write_label_studio",
    },
    "standoff.messages": {
        "Acknowledgement", "Alert", "CONTENT_TYPE", "DevicePosition", "DeviceTopics", "EVENT_TYPES", "Echo",
        "HazardNews", "HealthNews", "Heartbeat", "Supervision", "Timing", "Topics", "Unreadable", "WatchedZone",
        "event_text", "read_event", "read_message",
    },
    "standoff.monitor": {
        "ABOUT", "FanOut", "LiveQueue", "Monitor", "QueueState", "RecordKeeper", "Run", "RunRecord", "build_monitor",
        "open_run", "warnings_of",
    "check_resumable", "looks_name", "other_film", "other_means"},
    "standoff.scale": {
        "FilmPlan", "FilmResult", "Findings", "Moment", "find_films", "plan_films", "watch_films", "write_moments",
        "write_overview", "write_tables",
    "FilmPart", "parts_of"},
    "standoff.schemas": {"SCHEMAS"},
    "standoff.service.review": {"ReviewPage", "open_review", "review_app", "serve_review"},
    "standoff.service.latency": {"clock_picture", "measure_latency", "read_clock"},
    "standoff.service.status": {"Overview", "run", "status_app"},
    "standoff.service.wearable": {"DeviceClock", "LANGUAGES", "Level", "Phrases", "Receiver", "Shown", "Signal"},
    "standoff.service.setup": {"Draft", "SetupPage", "open_setup", "serve_setup", "setup_app"},
    "standoff.stages.detect": {
        "BOXES_OUTPUT", "CLASS_INPUT", "CROPS_INPUT", "Candidates", "DetectParams", "Letterbox", "ModelCard",
        "Network", "ONNX_ERRORS", "OnnxDetector", "PICTURE_INPUT", "POINTS_OUTPUT", "POINT_CLASSES",
        "POINT_CROP_AROUND", "POINT_CROP_PX", "Provider", "RecordedDetector", "SHIPPED_MODELS", "SharedDetector",
        "ShippedModel", "available_providers", "detections_in_rows", "find_ground_points", "find_model",
        "open_session", "point_crop", "point_metadata", "point_squares_px", "resize",
    "RememberingDetector"},
    "standoff.stages.frames": {
        "ArrayPicture", "AvPicture", "FileSource", "LiveAddress", "LivePicture", "LiveStream", "PROFESSIONAL_ERRORS",
        "PROTOCOLS", "Scaler", "SourceParams", "StreamRefused", "StreamUnreachable", "frame_from_array", "local_path",
        "masked", "open_source", "telemetry_of",
    },
    "standoff.stages.ground": {
        "Belief", "BoardView", "CalibrationResult", "Edges", "FixedCamera", "FusedGround", "FusedParams",
        "GivenPlace", "MARKER_FAMILIES", "MarkerFamily", "MarkerObserver", "MarkerPlace", "Markers", "OutlineFinder",
        "PointObservation", "Quadrilateral", "Reference", "ReferenceGround", "ReferenceMethod", "ReferenceParams",
        "ReferenceShape", "ScaleWatch", "SizesEstimator", "SurveyedGround", "TelemetryPose", "Unmapped",
        "belief_from_points", "calibrate", "calibrate_views", "canny", "check_square", "find_corners", "find_markers",
        "fit_points", "line_through", "load_camera", "load_survey", "map_from_view", "marker_pattern",
        "ransac_contours", "read_boards", "rectified_scale_m_per_px", "sample_pairs", "save_camera",
        "scale_from_sizes", "sobel_gradients", "unit_hint", "view_from_telemetry",
    },
    "standoff.stages.hazard": {"HazardMonitor", "HazardParams"},
    "standoff.stages.locate": {"Anchor", "LocateParams", "Locator"},
    "standoff.stages.motion": {"MotionEstimator", "MotionParams"},
    "standoff.stages.proximity": {
        "Excuses", "ProximityMeter", "ProximityParams", "machines_near_people", "side_classes",
    },
    "standoff.stages.sinks": {
        "Composer", "DETECTIONS", "DrawParams", "FRAMES", "FrameMeasurements", "HazardSink", "PROXIMITY",
        "ReportParams", "ReportSink", "ShowParams", "TRACKS", "Table", "TableParams", "TableSink", "VideoParams",
        "VideoSink", "Wanted", "ZONED_TRACKS", "detections_table", "make_sink", "percent_text", "prepare_output",
    "LooksSink"},
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
        "Patches", "PointError", "PointTraining", "as_found", "measure_points", "read_eyes", "read_patches",
        "train_points", "write_points",
    },
    "standoff.training.my_site": {"prepare_plan", "read_preset"},
    "standoff_sim.behaviour": {
        "carrying_between", "crossing_behind", "digging", "dozing", "driving_off", "driving_through", "errand",
        "grading", "hauling", "heaping", "idle", "keep_distance", "loader_loading", "near_miss", "pair_talking",
        "random_stance", "riding", "rolling", "spreading", "standing_working", "staying", "stooping", "truck_loading",
        "walking_past",
    },
    "standoff_sim.render": {"Cutout", "Look", "Rendered", "Renderer"},
}  # fmt: skip


@pytest.mark.parametrize("module", PUBLIC_NAMES)
def test_a_package_exports_what_is_written_down(module: str) -> None:
    package = importlib.import_module(module)
    assert set(package.__all__) == PUBLIC_NAMES[module]
    assert all(hasattr(package, name) for name in package.__all__)


def test_every_package_that_exports_anything_is_written_down() -> None:
    found = (
        *pkgutil.walk_packages(standoff.__path__, "standoff."),
        *pkgutil.walk_packages(standoff_sim.__path__, "standoff_sim."),
    )
    exporting = {one.name for one in found if one.ispkg and hasattr(importlib.import_module(one.name), "__all__")}
    assert exporting | {"standoff"} == PUBLIC_NAMES.keys() | {"standoff"}


_HEAVY = {"cv2", "torch", "onnxruntime", "numba", "matplotlib", "pyarrow", "av", "scipy"}


@pytest.mark.parametrize(
    ("light", "allowed"),
    [
        ("standoff", set()),
        ("standoff.cli", set()),
        ("standoff.files.json_text", set()),
        ("standoff.files.whole", set()),
        ("standoff.clips", {"pyarrow"}),
        ("standoff.drawing.painter", {"cv2"}),
        ("standoff.labels", {"cv2"}),
        ("standoff.stages.sinks", {"cv2", "pyarrow", "av"}),
    ],
)
def test_heavy_libraries_wait_until_something_needs_them(light: str, allowed: set[str]) -> None:
    program = f"import sys, {light}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert _HEAVY & set(done.stdout.split()) <= allowed
