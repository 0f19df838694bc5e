"""`standoff run`: a video in, distances, hazards, a film and a report out."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterable, Mapping
from contextlib import closing
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any

import typer

from standoff.core.errors import ConfigError, StandoffError
from standoff.core.outputs import OUTPUTS

if TYPE_CHECKING:
    from standoff.core.types import Severity
    from standoff.monitor import Run


def detector_overrides(model: str | None, detections: Path | None) -> dict[str, Any]:
    """Translate `--model` and `--detections` into settings; either wins over what a settings file says of both.

    Raises:
        ConfigError: Both are given.
    """
    if model is not None and detections is not None:
        raise ConfigError(
            expected="--model or --detections", found="both", fix="leave one out: a replay runs no detector"
        )
    if detections is not None:
        return {"detections": str(detections)}
    return {} if model is None else {"model": model, "detections": None}


def run(
    source: Annotated[Path, typer.Argument(help="Video file, or a folder of pictures.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the outputs.", show_default=False)],
    config: Annotated[Path | None, typer.Option(help="Settings, YAML (see `standoff config show`).")] = None,
    model: Annotated[str | None, typer.Option(help="Detector: site (ours, the default), or an ONNX file.")] = None,
    detections: Annotated[
        Path | None,
        typer.Option(help="Replay the detections of an earlier run of this source: its folder, or its table."),
    ] = None,
    ground: Annotated[
        str | None,
        typer.Option(
            help="square:SIDE, rectangle:LENGTH,WIDTH, regular:SIDES,LENGTH (3 to 12 sides of this length) or "
            "polygon:X,Y,X,Y,X,Y,... (corners in order): a reference object, in m or with units (2.89m, 9.5ft, "
            "9'6\"); ,height=H where its top is so high above the ground. Or marker:SIZE[,id=ID] (a printed marker, "
            "side of its black square), survey.yaml (surveyed points), auto (the default: markers of the settings, the "
            "drone's telemetry, sizes of people), or none."
        ),
    ] = None,
    reference_box: Annotated[
        str | None, typer.Option(help="Box of the reference in the first frame: left,top,right,bottom px.")
    ] = None,
    camera: Annotated[Path | None, typer.Option(help="Camera file: removes lens distortion.")] = None,
    telemetry: Annotated[
        str | None, typer.Option(help="The drone's log (.srt), or none. Default: the log beside the film.")
    ] = None,
    zones: Annotated[
        str | None, typer.Option(help="GeoJSON file of zones in the site frame, and who must not be in them.")
    ] = None,
    start: Annotated[float | None, typer.Option(help="Begin here; s.")] = None,
    stop: Annotated[float | None, typer.Option(help="End here; s.")] = None,
    every: Annotated[int | None, typer.Option(help="Read every k-th frame only.")] = None,
    fps: Annotated[float | None, typer.Option(help="Frames a second of a picture folder.")] = None,
    detect_every: Annotated[int | None, typer.Option(help="Detect on every k-th frame; tracks coast between.")] = None,
    outputs: Annotated[
        str | None,
        typer.Option(help=f"What to write, with commas: {','.join(OUTPUTS)}."),
    ] = None,
    unit: Annotated[
        str | None, typer.Option(help="metres or feet: what film, report and this console say lengths in.")
    ] = None,
    blur: Annotated[
        bool | None,
        typer.Option("--blur/--no-blur", help="Make people unrecognisable in film and report.", show_default=False),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier run's files in the folder.")
    ] = False,
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Go on with a run in the folder that was cut short, of the same film."),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the run's record as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Monitor a video: distances in metres, hazards, an annotated film and a report."""
    from standoff.cli.ground_option import GroundOption
    from standoff.config import load_settings
    from standoff.core.lengths import UNITS
    from standoff.monitor import check_resumable, open_run
    from standoff.stages.frames import local_path

    overrides = _stated(
        source=_stated(telemetry=telemetry, start_s=start, stop_s=stop, every=every, fps=fps) or None,
        zones=zones,
        detect_every=detect_every,
        outputs=None if outputs is None else tuple(filter(None, map(str.strip, outputs.split(",")))),
        show=_stated(unit=unit, blur=blur) or None,
    )
    overrides |= detector_overrides(model, detections)
    of_ground = GroundOption(ground, reference_box, camera)
    overrides |= _stated(ground=of_ground.settings or None)
    settings = load_settings(config, overrides)
    of_ground.check_units(settings.show.unit)
    if resume:
        check_resumable(local_path(source), out, settings)
    opened = open_run(source, out, settings, overwrite=overwrite or resume, resume=resume)
    _run_with_warnings(opened, UNITS[settings.show.unit].said, as_json=as_json, quiet=quiet)
    raise typer.Exit(exit_status(opened))


def _stated(**options: object) -> dict[str, Any]:
    """Return the options that were given; of the others the settings file decides."""
    return {name: value for name, value in options.items() if value is not None}


def _run_with_warnings(opened: Run, said: Callable[[str], str], *, as_json: bool, quiet: bool) -> None:
    """Go through a run and tell what came of it: what is doubtful before it, what became doubtful after it."""
    known = opened.warnings
    _warn(known, said)
    try:
        run_to_end(opened, quiet=quiet)
    except StandoffError:
        # Its own line says it all; only a machine still wants the record.
        tell(opened, as_json=as_json, quiet=True)
        raise
    _warn([warning for warning in opened.warnings if warning not in known], said)
    tell(opened, as_json=as_json, quiet=quiet)


def _warn(warnings: Iterable[str], said: Callable[[str], str]) -> None:
    for warning in warnings:
        typer.echo(f"standoff: warning: {said(warning)}", err=True)


class _StopRequest:
    """Ctrl-C or a request to terminate ends the run after the frame in hand, so that all files agree.

    A second one ends the program at once.
    """

    def __init__(self) -> None:
        self.received = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._receive)

    def _receive(self, number: int, stack: object) -> None:
        self.received = True
        signal.signal(number, signal.SIG_DFL)


def run_to_end(opened: Run, *, quiet: bool) -> None:
    """Go through a run with a progress bar; Ctrl-C ends it after the frame in hand.

    Args:
        opened: The run.
        quiet: No progress bar.
    """
    from standoff.cli.console import progress_bar
    from standoff.core.compiled import when_compiling

    stop = _StopRequest()
    results = iter(opened)
    with closing(results), progress_bar(quiet=quiet) as bar:
        if not quiet and bar.console.is_terminal:
            when_compiling(lambda: bar.console.print("compiling the geometry for this processor: half a minute, once"))
        task = bar.add_task("monitoring", total=opened.source.frame_count, rate=0.0)
        started = monotonic()
        for count, _ in enumerate(results, start=1):
            bar.update(task, completed=count, rate=count / (monotonic() - started))
            if stop.received:
                break


def tell(ended: Run, *, as_json: bool, quiet: bool) -> None:
    """Print the record, or a summary of it."""
    from standoff.cli.console import print_table, write_json
    from standoff.core.lengths import UNITS
    from standoff.core.watched_shares import percent_text

    record = ended.record
    if as_json:
        write_json(record.to_dict(), Path("-"))
    elif not quiet:
        counts, rows = record.counts, record.counts.rows
        table = [
            ("frames", f"{rows['frames']}"),
            ("frames with a ground map", f"{rows['frames_with_map']}"),
            ("ground watched", percent_text(counts.watched.share)),
            ("tracks", f"{rows['tracks']}"),
            ("distances measured", f"{rows['measured_distances']} of {rows['distances']}"),
            ("hazards", _listed(counts.hazards) or "none"),
            *((f"in {zone}", _listed(found)) for zone, found in counts.zones.items()),
            ("frames a second", f"{record.frames_per_s}"),
        ]
        said = UNITS[record.about["settings"]["show"]["unit"]].said
        table += [(f"no map: {said(reason)}", f"{number}") for reason, number in counts.no_map.items()]
        table += [(f"output {name} failed", message) for name, message in record.sink_errors.items()]
        print_table(f"{record.status}: {record.folder}", ("", ""), table, record.message, texts=2)


def _listed(hazards: Mapping[Severity, int]) -> str:
    return ", ".join(f"{number} {severity}" for severity, number in hazards.items())


def exit_status(ended: Run) -> int:
    """Return 1 for a run that was interrupted, did not measure much that it saw, or lost an output."""
    from standoff.core.unfollowed import are_many

    record, rows = ended.record, ended.record.counts.rows
    if record.status == "interrupted":
        typer.echo("standoff: interrupted; what was written up to then is whole, and --resume goes on.", err=True)
        return 1
    unmeasured = rows["frames_with_map"] == 0
    if unmeasured:
        typer.echo("standoff: no frame could be measured; run.json has the reasons.", err=True)
    untracked = are_many(rows["unfollowed_detections"], rows["sure_detections"])
    if untracked:
        typer.echo("standoff: many sure detections are in no track; their distances are not known.", err=True)
    return int(unmeasured or untracked or bool(ended.sink_errors))
