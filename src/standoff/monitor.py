"""One run from a source to a folder of outputs: what `standoff run` does, for use from Python.

from standoff.config import load_settings
from standoff.monitor import open_run
for result in open_run("site.mp4", "out", load_settings(Path("site.yaml"))):
    ...
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from standoff.clips import DETECTIONS_FILE
from standoff.config import Settings, build_pipeline, build_replacement, build_zones, resolved
from standoff.core.errors import OutputError
from standoff.core.types import FrameResult, Outcome, Sink
from standoff.core.zones import Zone
from standoff.files.in_use import FolderInUse
from standoff.files.zone_file import write_zones
from standoff.pipeline import Pipeline
from standoff.stages.detect import RecordedDetector
from standoff.stages.frames import Source, local_path, open_source
from standoff.stages.sinks import (
    FRAMES,
    OUTPUT_FILES,
    PROXIMITY,
    TRACKS,
    HazardSink,
    RecordSink,
    ReportSink,
    TableSink,
    VideoSink,
    detections_table,
    prepare_output,
    tracks_table,
)

RECORD = "run.json"
ZONES = "zones.geojson"


@dataclass
class Run:
    """An opened run; iterate over it once, and it is done.

    Attributes:
        source: Where the frames come from.
        pipeline: The stages.
        folder: Where the outputs are; nobody else may write there until the run has ended.
        record_sink: Knows what `run.json` says, or should say.
    """

    source: Source
    pipeline: Pipeline
    folder: Path
    record_sink: RecordSink
    _mark: FolderInUse

    @property
    def record(self) -> Mapping[str, Any]:
        """What `run.json` says, or should say where it could not be written."""
        return self.record_sink.record

    @property
    def warnings(self) -> list[str]:
        """What is odd about the source, the set-up and what was seen so far, a clause each."""
        return _warnings(self.source, self.pipeline)

    def __iter__(self) -> Generator[FrameResult, None, None]:
        """Yield each frame's result once it is written."""
        try:
            yield from self.pipeline.run()
        finally:
            self.source.close()
            self._mark.release()


def open_run(
    source: Path | str,
    out: Path | str,
    settings: Settings,
    *,
    overwrite: bool = False,
    checked: Callable[[], str] | None = None,
) -> Run:
    """Open the source, build the pipeline, then prepare the folder: nothing is written if anything is wrong.

    Args:
        source: Video file or folder of pictures, or its `file:` address.
        out: Output folder; created.
        settings: What to run.
        overwrite: Replace the files of an earlier run in the folder.
        checked: For the report, after the last frame: how true the stated errors are, where truth is known.

    Raises:
        StandoffError: A source, model, survey, camera, setting or folder that cannot be used.
    """
    _refuse_to_replace(local_path(source).resolve(), Path(out).resolve(), "the source")
    if settings.detections is not None:
        _refuse_to_replace(settings.detections.resolve(), Path(out).resolve(), "the recorded detections")
    if settings.zones is not None:
        _refuse_to_replace(settings.zones.resolve(), Path(out).resolve(), "the zones")
    zones = build_zones(settings)
    frames = open_source(
        source,
        start_s=settings.start_s,
        stop_s=settings.stop_s,
        every=settings.every,
        fps=settings.fps,
        telemetry=settings.telemetry,
    )
    pipeline = build_pipeline(settings, frames, frames.camera_prior)
    if (check_size := getattr(pipeline.ground, "check_size", None)) is not None:
        check_size(frames.size_px)
    if isinstance(pipeline.detector, RecordedDetector):
        pipeline.detector.check_source(frames.description)
    descriptions = {
        "settings": resolved(settings),
        "source": frames.description,
        "model": getattr(pipeline.detector, "description", None),
        **_known_so_far(frames, pipeline),
    }

    def at_close() -> dict[str, Any]:
        """Return what is known of the film and the ground, now that the frames have been seen."""
        return _known_so_far(frames, pipeline)

    extra = {name: build_replacement(name, replacement) for name, replacement in settings.extra_outputs.items()}
    folder = prepare_output(out, overwrite=overwrite)
    mark = FolderInUse(folder)
    # The record first, so that a folder without room is told before anything else is begun.
    record = RecordSink(folder / RECORD, descriptions, at_close)
    try:
        if zones:
            write_zones(folder / ZONES, zones)
        own = build_sinks(settings, folder, descriptions, at_close, checked, zones)
    except OSError as error:
        refused = OutputError(
            expected=f"room for the outputs in {folder}",
            found=error.strerror or str(error),
            fix="make room, or choose another folder",
        )
        with suppress(OutputError):
            record.close(Outcome("failed", str(refused)))
        raise refused from error
    # And closed last, so that it times all others.
    pipeline.sinks = {**own, **extra, "record": record}
    return Run(frames, pipeline, folder, record, mark)


def _known_so_far(source: Source, pipeline: Pipeline) -> dict[str, Any]:
    return {
        "source": source.description,
        "ground": getattr(pipeline.ground, "description", None),
        "watched": getattr(pipeline.watcher, "description", None),
        "alarms": getattr(pipeline.hazard, "description", {}).get("alarms"),
        "warnings": _warnings(source, pipeline),
    }


def _warnings(source: Source, pipeline: Pipeline) -> list[str]:
    stages = (pipeline.detector, pipeline.motion, pipeline.ground, pipeline.watcher, pipeline.hazard)
    return [*source.warnings, *stage_warnings(*stages)]


def stage_warnings(*stages: object) -> list[str]:
    """Return what stages say of their own set-up, and of what they have seen so far."""
    return [text for stage in stages for text in getattr(stage, "description", {}).get("warnings", ())]


def _refuse_to_replace(source: Path, out: Path, what: str) -> None:
    """Raise OutputError where the outputs would replace what is read, or lie among its pictures."""
    if source == out or (source.parent == out and source.name in OUTPUT_FILES):
        raise OutputError(
            expected=f"outputs apart from {what}", found=f"{source} and {out}", fix="choose another output folder"
        )


def build_sinks(
    settings: Settings,
    folder: Path,
    descriptions: dict[str, Any],
    at_close: Callable[[], Mapping[str, Any]] | None = None,
    checked: Callable[[], str] | None = None,
    zones: tuple[Zone, ...] = (),
) -> dict[str, Sink]:
    """Make the configured outputs of standoff's own, without the record.

    Args:
        settings: Of everything.
        folder: Where they go.
        descriptions: For the report.
        at_close: Gives descriptions anew once the last frame has been seen.
        checked: Gives then what the report says of how true the stated errors are, where truth is known.
        zones: What is drawn and listed of the site.
    """
    makers: dict[str, Any] = {
        "tracks": lambda: TableSink(folder / "tracks.parquet", tracks_table() if zones else TRACKS, settings.tables),
        "proximity": lambda: TableSink(folder / "proximity.parquet", PROXIMITY, settings.tables),
        "frames": lambda: TableSink(folder / "frames.parquet", FRAMES, settings.tables),
        "detections": lambda: TableSink(
            folder / DETECTIONS_FILE,
            detections_table(descriptions["source"], descriptions["model"]),
            settings.tables,
        ),
        "hazards": lambda: HazardSink(folder / "hazards.jsonl"),
        "video": lambda: VideoSink(folder / "annotated.mp4", settings.video, zones, settings.show),
        "report": lambda: ReportSink(
            folder / "report.html",
            settings.report,
            descriptions,
            warning_gap_m=settings.hazard.buffer_m,
            at_close=at_close,
            checked=checked,
            zones=zones,
            show=settings.show,
        ),
    }
    return {name: makers[name]() for name in settings.outputs}
