"""What a program may import, written down, so that a change of it is a decision and not an accident."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

PUBLIC_NAMES = {
    "standoff.stages.frames": {
        "ArrayPicture", "AvPicture", "Scaler", "Source", "frame_from_array", "local_path", "open_source",
    },
    "standoff.stages.detect": {
        "BOXES_OUTPUT", "CLASS_INPUT", "CROPS_INPUT", "ONNX_ERRORS", "PICTURE_INPUT", "POINTS_OUTPUT",
        "POINT_CLASSES", "POINT_CROP_AROUND", "POINT_CROP_PX", "SHIPPED_MODELS", "Candidates", "DetectParams",
        "Letterbox", "ModelCard", "Network", "OnnxDetector", "Provider", "RecordedDetector", "ShippedModel",
        "available_providers", "detections_in_rows", "find_model", "open_session", "point_crop", "point_metadata",
        "point_squares_px", "resize",
    },
    "standoff.stages.ground": {
        "MARKER_FAMILIES", "Belief", "BoardView", "CalibrationResult", "Edges", "FixedCamera", "FusedGround",
        "FusedParams", "GivenPlace", "MarkerFamily", "MarkerObserver", "MarkerPlace", "Markers", "OutlineFinder",
        "PointObservation", "Quadrilateral", "Reference", "ReferenceGround", "ReferenceMethod", "ReferenceParams",
        "ReferenceShape", "ScaleWatch", "SurveyedGround", "TelemetryPose", "Unmapped", "belief_from_points",
        "calibrate", "calibrate_views", "canny", "check_square", "find_corners", "find_markers", "fit_points",
        "line_through", "load_camera", "load_survey", "map_from_view", "marker_pattern", "ransac_contours",
        "read_boards", "rectified_scale_m_per_px", "sample_pairs", "save_camera", "scale_from_sizes",
        "SizesEstimator", "sobel_gradients", "unit_hint",
        "view_from_telemetry",
    },
    "standoff.clips": {
        "ANNOTATIONS_FILE", "CAMERA_FILE", "CLIP_FILES", "CLIP_FORMAT", "CLIP_FRAMES_FILE", "CLIP_FRAMES_SCHEMA",
        "COLUMNS", "DETECTIONS_FILE", "DEVICES_FILE", "DEVICES_SCHEMA", "FOOT_COLUMNS", "NOISY_DETECTIONS_FILE",
        "NOISY_DETECTIONS_SCHEMA", "PAIRS_FILE", "PAIRS_SCHEMA", "REFERENCE_FILE", "RENDER_AGAIN", "SCENE_FILE",
        "TELEMETRY_FILE", "TRUTH_FILE", "TRUTH_FILES", "TRUTH_NUMBERS", "TRUTH_SCHEMA", "VIDEO_FILE", "Clip",
        "Column", "Columns", "RecordedDetections", "RunFolder", "RunTable", "TrueBoard", "TrueReference",
        "chosen_rows", "columns_of", "is_recording", "load_clip", "metadata_of", "read_clip_table", "read_columns",
        "read_detections", "read_scene", "schema_of",
    },
    "standoff.stages.motion": {"MotionEstimator", "MotionParams"},
    "standoff.stages.track": {"TrackParams", "Tracker"},
    "standoff.stages.locate": {"Anchor", "LocateParams", "Locator"},
    "standoff.stages.proximity": {"Excuses", "ProximityMeter", "ProximityParams", "side_classes"},
    "standoff.stages.hazard": {"HazardMonitor", "HazardParams"},
    "standoff.simulation.render": {"Cutout", "Look", "Rendered", "Renderer"},
    "standoff.simulation.behaviour": {
        "carrying_between", "crossing_behind", "digging", "dozing", "driving_through", "grading", "idle",
        "keep_distance", "loader_loading", "near_miss", "pair_talking", "random_stance", "rolling", "spreading",
        "standing_working", "stooping", "truck_loading", "walking_past",
    },
}  # fmt: skip


@pytest.mark.parametrize("module", PUBLIC_NAMES)
def test_a_package_exports_what_is_written_down(module: str) -> None:
    assert set(importlib.import_module(module).__all__) == PUBLIC_NAMES[module]


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
