"""A frame becomes detections, a ground map, tracks, ground positions, proximities, hazards; sinks write them down."""

import os

# ONNX Runtime reads it when it is loaded, and would report to its maker before anybody could switch that off.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

__version__ = "0.1.0"
