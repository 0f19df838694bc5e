"""Results become files: tables, events, an annotated video, a report and a record of the run."""

from standoff.stages.sinks.folder import OUTPUT_FILES, prepare_output
from standoff.stages.sinks.hazards import HazardSink
from standoff.stages.sinks.params import DrawParams, ReportParams, ShowParams, TableParams, VideoParams
from standoff.stages.sinks.record import RecordSink
from standoff.stages.sinks.report import ReportSink
from standoff.stages.sinks.scene import OpenHazards, Scene
from standoff.stages.sinks.tables import (
    DETECTIONS,
    FRAMES,
    PROXIMITY,
    TRACKS,
    Table,
    TableSink,
    detections_table,
    tracks_table,
)
from standoff.stages.sinks.video import Composer, VideoSink
from standoff.stages.sinks.watched_shares import percent_text

__all__ = [
    "DETECTIONS",
    "FRAMES",
    "OUTPUT_FILES",
    "PROXIMITY",
    "TRACKS",
    "Composer",
    "DrawParams",
    "HazardSink",
    "OpenHazards",
    "RecordSink",
    "ReportParams",
    "ReportSink",
    "Scene",
    "ShowParams",
    "Table",
    "TableParams",
    "TableSink",
    "VideoParams",
    "VideoSink",
    "detections_table",
    "percent_text",
    "prepare_output",
    "tracks_table",
]
