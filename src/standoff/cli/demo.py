"""`standoff demo`: the whole monitor on a film that comes with standoff, and how far off it is."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from standoff.cli.run import detector_overrides, exit_status, run_to_end, tell
from standoff.core.errors import DataError

if TYPE_CHECKING:
    from standoff.clips import Clip


def demo(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the outputs.")] = Path("demo"),
    model: Annotated[str | None, typer.Option(help="Detector: site (ours, the default), or an ONNX file.")] = None,
    detections: Annotated[
        Path | None, typer.Option(help="Replay the detections of an earlier demo: its folder, or its table.")
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Also write the comparison as JSON; - prints only that.")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier run's files in the folder.")
    ] = False,
) -> None:
    """Monitor ten seconds of a simulated site, and compare with what really happened there and with the paper."""
    from standoff.cli.console import progress, write_json
    from standoff.cli.demo_tables import print_scores
    from standoff.config import load_settings
    from standoff.evaluation.clip_run import score_papers_method, score_run
    from standoff.monitor import open_run

    quiet = str(json_file) == "-"
    clip = _load_film()
    # As a user would: the film's own description of its reference object and camera, and defaults for all else.
    settings = load_settings(clip.settings_file, detector_overrides(model, detections))
    run = open_run(clip.video, out, settings, overwrite=overwrite, checked=lambda: _checked(out, clip))
    run_to_end(run, quiet=quiet)
    tell(run, as_json=False, quiet=quiet)
    if run.record.counts.rows["frames"] != clip.frame_count:
        typer.echo("The film was not seen to its end: no comparison with its truth.", err=True)
        raise typer.Exit(exit_status(run))
    score = score_run(out, clip)
    with progress("the paper's method", clip.frame_count, quiet=quiet) as on_frame:
        paper = score_papers_method(clip, out, on_frame)
    if json_file is not None:
        write_json(score.to_dict() | {"paper": paper.to_dict()}, json_file)
    if not quiet:
        print_scores(score, paper)
        typer.echo(f"Open {out / 'report.html'} in a browser, and {out / 'annotated.mp4'} in a player.")
    raise typer.Exit(exit_status(run))


def _checked(out: Path, clip: Clip) -> str:
    """Return what the report says of the stated errors; nothing where the run's tables are not of the whole film."""
    from standoff.evaluation.clip_run import score_run
    from standoff.evaluation.paper.pairs import AFTER
    from standoff.evaluation.reliability import reliability_section

    try:
        pairs = score_run(out, clip).pairs
    except DataError:
        return ""
    kinds = [(group.class_pair, group.scores[AFTER], group.coverage) for group in pairs]
    return reliability_section(kinds, "this simulated film")


def _load_film() -> Clip:
    """Return the film with its truth.

    Raises:
        DataError: The installation lacks part of it.
    """
    from standoff.clips import load_clip

    try:
        return load_clip(_folder())
    except DataError as error:
        raise DataError(expected=error.expected, found=error.found, fix="install standoff again") from error


def find_film() -> Path:
    """Return the video that comes with standoff."""
    from standoff.clips import VIDEO_FILE

    return _folder() / VIDEO_FILE


def _folder() -> Path:
    return Path(str(files("standoff"))) / "demo"
