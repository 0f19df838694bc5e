"""Follow entities from frame to frame: `Detections` to `Tracks`."""

from standoff.stages.track.params import TrackParams
from standoff.stages.track.tracker import Tracker

__all__ = ["TrackParams", "Tracker"]
