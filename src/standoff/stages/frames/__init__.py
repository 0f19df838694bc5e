"""Video files and image folders become frames, each with its own time; pixels wait until somebody asks.

from standoff.stages.frames import open_source

with open_source("site.mp4", start_s=10.0, every=2) as source:
    for frame in source:
        ...
"""

from standoff.stages.frames.params import SourceParams
from standoff.stages.frames.pictures import ArrayPicture, AvPicture, Scaler
from standoff.stages.frames.source import FileSource, frame_from_array, local_path, open_source

__all__ = [
    "ArrayPicture",
    "AvPicture",
    "FileSource",
    "Scaler",
    "SourceParams",
    "frame_from_array",
    "local_path",
    "open_source",
]
