"""`standoff run`: a video in, distances, hazards, a film and a report out."""

from __future__ import annotations

import signal
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any

import typer

from standoff.core.errors import ConfigError, StandoffError

if TYPE_CHECKING:
    from standoff.core.types import FrameResult
    from standoff.monitor import Run


_SHAPES = {"square": "SIDE", "rectangle": "LENGTH,WIDTH", "regular": "SIDES,LENGTH", "polygon": "X,Y,X,Y,X,Y,..."}
"""How `--ground` names the shapes of reference objects, and what has to follow."""


def _numbers(text: str, count: int, option: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count:
        raise ConfigError(
            expected=f"{count} number{'s with commas' * (count > 1)} for {option}",
            found=repr(text),
            fix=f"write for example {','.join(['10', '20', '30', '40'][:count])}",
        )
    return numbers


def _shape_overrides(ground: str) -> dict[str, Any] | None:
    """Translate a reference object's shape, with `,height=H` or without, into settings; None if it is none."""
    kind, _, rest = ground.partition(":")
    if kind not in _SHAPES:
        return None
    lengths, _, height = rest.partition(",height=")
    option = f"--ground {kind}:{_SHAPES[kind]}"
    # The file's reference may have another shape; its box and method go on.
    shape: dict[str, Any] = dict.fromkeys(
        ("square_m", "rectangle_m", "regular_m", "sides_m", "diagonal_m", "corners_m", "height_m")
    )
    if kind == "polygon":
        pairs = max((lengths.count(",") + 2) // 2, 3)
        numbers = _numbers(lengths, 2 * pairs, option)
        shape["corners_m"] = tuple(zip(numbers[::2], numbers[1::2], strict=True))
    elif kind == "square":
        shape["square_m"] = _numbers(lengths, 1, option)[0]
    else:
        shape[f"{kind}_m"] = _numbers(lengths, 2, option)
    if height:
        shape["height_m"] = _numbers(height, 1, f"{option},height=H")[0]
    return shape


def _marker_override(text: str) -> dict[str, Any]:
    """Read `marker:SIZE` or `marker:SIZE,id=ID` into settings of the only marker, which defines the site frame."""
    size, *words = text.removeprefix("marker:").split(",")
    size_m = _numbers(size, 1, "--ground marker:SIZE")[0]
    marker: dict[str, Any] = {"size_m": size_m}
    for word in words:
        name, _, value = word.strip().partition("=")
        if name != "id" or not value.isdecimal() or len(words) > 1:
            raise ConfigError(
                expected="--ground marker:SIZE or marker:SIZE,id=ID",
                found=repr(text),
                fix="write for example marker:1.2,id=3",
            )
        marker["id"] = int(value)
    return {"markers": [marker], "survey": None, "reference": None}


def _ground_overrides(ground: str | None, box: str | None, camera: Path | None) -> dict[str, Any]:
    """Translate `--ground`, `--reference-box` and `--camera` into settings."""
    overrides: dict[str, Any] = {}
    if ground is not None and ground.startswith("marker:"):
        overrides |= _marker_override(ground)
        overrides["auto"] = True
    elif ground in ("auto", "none"):
        overrides |= {"survey": None, "reference": None, "auto": ground == "auto"}
    elif ground is not None:
        shape = _shape_overrides(ground)
        overrides |= {"survey": None if shape else ground, "reference": shape}
    if ground not in (None, "auto"):
        # What the command line names is the ground; the file's markers may lie in another frame.
        overrides.setdefault("markers", [])
        overrides["more_references"] = []
    if box is not None:
        overrides.setdefault("reference", {})
        if overrides["reference"] is None:
            raise ConfigError(
                expected="--reference-box together with a reference object",
                found=f"--ground {ground}",
                fix="use --ground square:SIDE, or describe the reference in the settings file",
            )
        overrides["reference"]["box_px"] = _numbers(box, 4, "--reference-box")
    if camera is not None:
        overrides["camera"] = str(camera)
    return overrides


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
            "polygon:X,Y,X,Y,X,Y,... (corners in order): a reference object, m; ,height=H where its top is so high "
            "above the ground. Or marker:SIZE[,id=ID] (a printed marker, black square in m), survey.yaml (surveyed "
            "points), auto (the default: markers of the settings, the drone's telemetry, sizes of people), or none."
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
        typer.Option(help="What to write, with commas: tracks,proximity,frames,detections,hazards,video,report."),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier run's files in the folder.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the run's record as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Monitor a video: distances in metres, hazards, an annotated film and a report."""
    from standoff.config import load_settings
    from standoff.monitor import open_run

    plain = {
        "telemetry": telemetry,
        "zones": zones,
        "start_s": start,
        "stop_s": stop,
        "every": every,
        "fps": fps,
        "detect_every": detect_every,
        "outputs": tuple(filter(None, map(str.strip, outputs.split(",")))) if outputs is not None else None,
    }
    overrides: dict[str, Any] = {name: value for name, value in plain.items() if value is not None}
    overrides |= detector_overrides(model, detections)
    if ground_overrides := _ground_overrides(ground, reference_box, camera):
        overrides["ground"] = ground_overrides
    opened = open_run(source, out, load_settings(config, overrides), overwrite=overwrite)
    known = opened.warnings
    for warning in known:
        typer.echo(f"standoff: warning: {warning}", err=True)
    try:
        watch(opened, quiet=quiet)
    except StandoffError:
        # Its own line says it all; only a machine still wants the record.
        tell(opened, as_json=as_json, quiet=True)
        raise
    for warning in opened.warnings:
        if warning not in known:
            typer.echo(f"standoff: warning: {warning}", err=True)
    tell(opened, as_json=as_json, quiet=quiet)
    raise typer.Exit(exit_status(opened))


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


def watch(opened: Run, *, quiet: bool, on_result: Callable[[FrameResult], None] | None = None) -> None:
    """Go through a run with a progress bar; Ctrl-C ends it after the frame in hand.

    Args:
        opened: The run.
        quiet: No progress bar.
        on_result: Called with each frame's result.
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
        for count, result in enumerate(results, start=1):
            if on_result is not None:
                on_result(result)
            bar.update(task, completed=count, rate=count / (monotonic() - started))
            if stop.received:
                break


def tell(ended: Run, *, as_json: bool, quiet: bool) -> None:
    """Print the record, or a summary of it."""
    from standoff.cli.console import print_table, write_json
    from standoff.stages.sinks import percent_text

    record = ended.record
    if as_json:
        write_json(record, Path("-"))
    elif not quiet:
        counts, hazards = record["counts"], record["counts"]["hazards"]
        rows = [
            ("frames", f"{counts['frames']}"),
            ("frames with a ground map", f"{counts['frames_with_map']}"),
            ("ground watched", percent_text(record["watched_ground"]["share"])),
            ("tracks", f"{counts['tracks']}"),
            ("distances measured", f"{counts['measured_distances']} of {counts['distances']}"),
            ("hazards", ", ".join(f"{number} {name}" for name, number in hazards.items()) or "none"),
            *(
                (f"in {zone}", ", ".join(f"{number} {name}" for name, number in found.items()))
                for zone, found in counts.get("zones", {}).items()
            ),
            ("frames a second", f"{record['frames_per_s']}"),
        ]
        rows += [(f"no map: {reason}", f"{number}") for reason, number in counts["no_ground_map"].items()]
        rows += [(f"output {name} failed", message) for name, message in record["sink_errors"].items()]
        print_table(f"{record['status']}: {ended.folder}", ("", ""), rows, record["message"], texts=2)


def exit_status(ended: Run) -> int:
    """Return 1 for a run that was interrupted, did not measure much that it saw, or lost an output."""
    from standoff.core.unfollowed import are_many

    record, lost = ended.record, ended.pipeline.sink_errors
    if record["status"] == "interrupted":
        typer.echo("standoff: interrupted; what was written up to then is whole.", err=True)
        return 1
    unmeasured = record["counts"]["frames_with_map"] == 0
    if unmeasured:
        typer.echo("standoff: no frame could be measured; run.json has the reasons.", err=True)
    counts = record["counts"]
    untracked = are_many(counts["unfollowed_detections"], counts["sure_detections"])
    if untracked:
        typer.echo("standoff: many sure detections are in no track; their distances are not known.", err=True)
    return int(unmeasured or untracked or bool(lost))
