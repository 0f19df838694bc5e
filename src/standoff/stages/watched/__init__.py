"""Which of the ground in a picture is watched: Frame, ground map, tracks and positions in, WatchedGround out."""

from standoff.stages.watched.params import WatchedParams
from standoff.stages.watched.watcher import GroundWatcher

__all__ = ["GroundWatcher", "WatchedParams"]
