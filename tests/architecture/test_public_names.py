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
        "DEFAULT_CLASS_MAP", "SHIPPED_MODELS", "DetectParams", "OnnxDetector", "RecordedDetector", "ShippedModel",
        "available_providers", "find_model",
    },
    "standoff.clips": {
        "COLUMNS", "DETECTIONS_FILE", "FOOT_COLUMNS", "RecordedDetections", "is_recording", "metadata_of",
        "read_detections",
    },
    "standoff.stages.motion": {"MotionEstimator", "MotionParams"},
    "standoff.stages.track": {"TrackParams", "Tracker"},
    "standoff.stages.locate": {"LocateParams", "Locator"},
    "standoff.stages.proximity": {"ProximityMeter", "ProximityParams", "side_classes"},
    "standoff.stages.hazard": {"HazardMonitor", "HazardParams"},
    "standoff.simulation.render": {"Cutout", "Look", "Rendered", "Renderer"},
    "standoff.simulation.behaviour": {
        "carrying_between", "crossing_behind", "digging", "dozing", "driving_off", "driving_through", "errand",
        "grading", "hauling", "heaping", "idle", "keep_distance", "loader_loading", "near_miss", "pair_talking",
        "random_stance", "riding", "rolling", "spreading", "standing_working", "staying", "stooping", "truck_loading",
        "walking_past",
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
        ("standoff.stages.sinks", {"cv2", "pyarrow", "av"}),
    ],
)
def test_heavy_libraries_wait_until_something_needs_them(light: str, allowed: set[str]) -> None:
    program = f"import sys, {light}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert _HEAVY & set(done.stdout.split()) <= allowed
