"""A frame becomes detections, a ground map, tracks, ground positions, proximities, hazards; sinks write them down."""

__version__ = "0.1.0"
