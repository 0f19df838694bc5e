"""Make the sink of each output."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from standoff.core.outputs import OUTPUTS
from standoff.core.protocols import Sink
from standoff.core.zones import Zone
from standoff.stages.sinks.hazards import HazardSink
from standoff.stages.sinks.params import ReportParams, ShowParams, TableParams, VideoParams
from standoff.stages.sinks.report import ReportSink
from standoff.stages.sinks.tables import FRAMES, PROXIMITY, TRACKS, ZONED_TRACKS, Table, TableSink, detections_table
from standoff.stages.sinks.video import VideoSink


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What the sinks of one run have to know.

    Attributes:
        source: The source's description, and the detector's (None: it has none), without which detections cannot be
            replayed.
        detector: As above.
        tables: How tables are written.
        video: The annotated film.
        report: How much the report keeps.
        show: The unit of lengths, and whether people are made unrecognisable.
        zones: What is drawn and listed of the site.
        warning_gap_m: Gap below which the hazard stage warns by distance, to be drawn.
        checked: Gives after the last frame what the report says of how true the stated errors are; None: nothing.
    """

    source: Mapping[str, Any]
    detector: Mapping[str, Any] | None
    tables: TableParams
    video: VideoParams
    report: ReportParams
    show: ShowParams
    zones: tuple[Zone, ...] = ()
    warning_gap_m: float = 1.0
    checked: Callable[[], str] | None = None


def make_sink(name: str, folder: Path, wanted: Wanted) -> Sink:
    """Make the sink of an output of `standoff.core.outputs.OUTPUTS`.

    Raises:
        OSError: It cannot be begun.
    """
    return _MAKERS[name](folder / OUTPUTS[name], wanted)


def _table(choose: Callable[[Wanted], Table]) -> Callable[[Path, Wanted], Sink]:
    return lambda path, wanted: TableSink(path, choose(wanted), wanted.tables)


def _report(path: Path, wanted: Wanted) -> Sink:
    return ReportSink(
        path,
        wanted.report,
        warning_gap_m=wanted.warning_gap_m,
        checked=wanted.checked,
        zones=wanted.zones,
        show=wanted.show,
    )


_MAKERS: Mapping[str, Callable[[Path, Wanted], Sink]] = {
    "tracks": _table(lambda wanted: ZONED_TRACKS if wanted.zones else TRACKS),
    "proximity": _table(lambda wanted: PROXIMITY),
    "frames": _table(lambda wanted: FRAMES),
    "detections": _table(lambda wanted: detections_table(wanted.source, wanted.detector)),
    "hazards": lambda path, wanted: HazardSink(path),
    "video": lambda path, wanted: VideoSink(path, wanted.video, wanted.zones, wanted.show),
    "report": _report,
}
