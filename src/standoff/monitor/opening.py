"""From a source, a folder and settings to a run that is ready to begin."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from standoff.clips import KeptLooks
from standoff.config import Settings, build_replacement, build_zones, named_files, resolved
from standoff.core.errors import OutputError
from standoff.core.outputs import LOOKS_FOLDER, RUN_FILES, ZONES_FILE
from standoff.core.protocols import EACH_ALONE, Sink
from standoff.core.types import Outcome
from standoff.files.fingerprint import digests
from standoff.files.zone_file import write_zones
from standoff.monitor.build import build_monitor
from standoff.monitor.monitor import Monitor
from standoff.monitor.record import RecordKeeper
from standoff.monitor.run import Run, describe_run
from standoff.monitor.same_run import looks_name
from standoff.stages.detect import RecordedDetector, RememberingDetector
from standoff.stages.frames import local_path, open_source
from standoff.stages.sinks import LooksSink, Wanted, make_sink, prepare_output


def open_run(
    source: Path | str,
    out: Path | str,
    settings: Settings,
    *,
    overwrite: bool = False,
    resume: bool = False,
    checked: Callable[[], str] | None = None,
    more_sinks: Mapping[str, Sink] | None = None,
    overlaps: bool = True,
) -> Run:
    """Open the source, build the monitor, then prepare the folder: nothing is written if anything is wrong.

    Args:
        source: Video file or folder of pictures, or its `file:` address.
        out: Output folder; created.
        settings: What to run.
        overwrite: Replace the files of an earlier run in the folder.
        resume: Keep what the detector saw in the folder's run so far, where that is the same run: by film, settings,
            files and version. Results are those of a run that was not cut short.
        more_sinks: Beside those of the settings, and before them.
        overlaps: As of `Run`.
        checked: For the report, after the last frame: how true the stated errors are, where truth is known.

    Raises:
        StandoffError: A source, model, survey, camera, setting or folder that cannot be used.
    """
    read = {
        "the source": local_path(source),
        "the recorded detections": settings.detections,
        "the zones": settings.zones,
    }
    for what, path in read.items():
        if path is not None:
            _refuse_to_replace(path.resolve(), Path(out).resolve(), what)
    zones = build_zones(settings)
    frames = open_source(source, **asdict(settings.source))
    monitor = build_monitor(settings, frames.camera_prior)
    monitor.prepare(frames.size_px)
    if isinstance(monitor.detector, RecordedDetector):
        monitor.detector.check_source(frames.describe())
    extra = {name: build_replacement(name, one, Sink) for name, one in settings.extra_outputs.items()}
    wanted = Wanted(
        source=frames.describe(),
        detector=monitor.detector.describe(),
        tables=settings.tables,
        video=settings.video,
        report=settings.report,
        show=settings.show,
        zones=zones,
        warning_gap_m=settings.hazard.buffer_m,
        checked=checked,
    )
    # The record first, so that a folder without room is told before anything else is begun.
    files = digests(named_files(settings))
    about = {"settings": resolved(settings), "files": files, **describe_run(frames, monitor)}
    looks = looks_name(wanted.source, settings, files)
    path = prepare_output(out, overwrite=overwrite, looks=looks if resume else "")
    folder = RecordKeeper(path, about)
    own = _begin_outputs(folder, settings.outputs, wanted)
    sinks = {**(more_sinks or {}), **own, **extra}
    if (wanted.detector or {}).get(EACH_ALONE):
        # Last: it is told whether all others are whole.
        sinks["looks"] = _keep_looks(monitor, path / LOOKS_FOLDER / looks, wanted)
    return Run(frames, monitor, sinks, folder, overlaps=overlaps)


def _keep_looks(monitor: Monitor, folder: Path, wanted: Wanted) -> Sink:
    """Let a monitor's detector look only where nobody has, and what it sees be kept until the run is complete."""
    kept = KeptLooks(folder)
    sink = LooksSink(folder, kept, wanted.source, wanted.detector or {}, wanted.tables)
    if len(kept):
        monitor.detector = RememberingDetector(monitor.detector, kept)
    return sink


def _begin_outputs(folder: RecordKeeper, names: Iterable[str], wanted: Wanted) -> dict[str, Sink]:
    """Begin the outputs of these names; where one cannot be, the run has failed and says so.

    Raises:
        OutputError: There is no room.
    """
    try:
        if wanted.zones:
            write_zones(folder.path / ZONES_FILE, wanted.zones)
        return {name: make_sink(name, folder.path, wanted) for name in names}
    except OSError as error:
        refused = OutputError(
            expected=f"room for the outputs in {folder.path}",
            found=error.strerror or str(error),
            fix="make room, or choose another folder",
        )
        with suppress(OutputError):
            folder.finish(Outcome("failed", str(refused)), {})
        raise refused from error


def _refuse_to_replace(source: Path, out: Path, what: str) -> None:
    """Raise OutputError where the outputs would replace what is read, or lie among its pictures."""
    if source == out or (source.parent == out and source.name in RUN_FILES):
        raise OutputError(
            expected=f"outputs apart from {what}", found=f"{source} and {out}", fix="choose another output folder"
        )
