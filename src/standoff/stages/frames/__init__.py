"""Video files, image folders and live streams become frames, each with its own time; pixels wait until somebody asks.

from standoff.stages.frames import open_source

with open_source("site.mp4", start_s=10.0, every=2) as source:
    for frame in source:
        ...
"""

from standoff.stages.frames.instruments import PROFESSIONAL as PROFESSIONAL_ERRORS
from standoff.stages.frames.instruments import telemetry_of
from standoff.stages.frames.live import LivePicture, LiveStream, StreamRefused, StreamUnreachable
from standoff.stages.frames.live_address import PROTOCOLS, LiveAddress, masked
from standoff.stages.frames.params import SourceParams
from standoff.stages.frames.pictures import ArrayPicture, AvPicture, Scaler
from standoff.stages.frames.source import FileSource, frame_from_array, local_path, open_source

__all__ = [
    "PROFESSIONAL_ERRORS",
    "PROTOCOLS",
    "ArrayPicture",
    "AvPicture",
    "FileSource",
    "LiveAddress",
    "LivePicture",
    "LiveStream",
    "Scaler",
    "SourceParams",
    "StreamRefused",
    "StreamUnreachable",
    "frame_from_array",
    "local_path",
    "masked",
    "open_source",
    "telemetry_of",
]
