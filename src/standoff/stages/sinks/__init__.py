"""Results become files: tables, events, an annotated video, a report and a record of the run."""

from standoff.core.watched_shares import percent_text
from standoff.stages.sinks.folder import prepare_output
from standoff.stages.sinks.frame_measurements import FrameMeasurements
from standoff.stages.sinks.hazards import HazardSink
from standoff.stages.sinks.looks import LooksSink
from standoff.stages.sinks.make import Wanted, make_sink
from standoff.stages.sinks.params import DrawParams, ReportParams, ShowParams, TableParams, VideoParams
from standoff.stages.sinks.report import ReportSink
from standoff.stages.sinks.tables import (
    DETECTIONS,
    FRAMES,
    PROXIMITY,
    TRACKS,
    ZONED_TRACKS,
    Table,
    TableSink,
    detections_table,
)
from standoff.stages.sinks.video import Composer, VideoSink

__all__ = [
    "DETECTIONS",
    "FRAMES",
    "PROXIMITY",
    "TRACKS",
    "ZONED_TRACKS",
    "Composer",
    "DrawParams",
    "FrameMeasurements",
    "HazardSink",
    "LooksSink",
    "ReportParams",
    "ReportSink",
    "ShowParams",
    "Table",
    "TableParams",
    "TableSink",
    "VideoParams",
    "VideoSink",
    "Wanted",
    "detections_table",
    "make_sink",
    "percent_text",
    "prepare_output",
]
