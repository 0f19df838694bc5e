"""`standoff demo`: the whole monitor on a film that comes with standoff, and how far off it is."""

from __future__ import annotations

import math
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from standoff.cli.run import detector_overrides, exit_status, tell, watch
from standoff.core.errors import DataError

if TYPE_CHECKING:
    from standoff.evaluation.clip_run import ClipScore, Encounter
    from standoff.evaluation.paper import Clip

_BOX_MARGIN = 0.06
"""The one departure from the paper: a detector's box may cut a corner of the footing."""


def demo(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the outputs.")] = Path("demo"),
    model: Annotated[
        str | None, typer.Option(help="Detector: site (the default) or site-int8 (ours), or an ONNX file.")
    ] = None,
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
    """Monitor ten seconds of a simulated site, and compare with what really happened there."""
    from standoff.cli.console import write_json
    from standoff.config import load_settings
    from standoff.evaluation.clip_run import ClipWitness
    from standoff.monitor import RECORD, open_run

    quiet = str(json_file) == "-"
    clip = _load_film()
    # The film's own description of its reference object and camera, measured as the paper does.
    paper = {
        "ground": {"reference": {"params": {"method": "paper", "box_margin": _BOX_MARGIN}}},
        "locate": {"anchor": "box_centre"},
    }
    settings = load_settings(clip.folder / "reference.yaml", {**detector_overrides(model, detections), **paper})
    run = open_run(clip.video, out, settings, overwrite=overwrite)
    witness = ClipWitness(clip, settings, run.source.size_px)
    watch(run, quiet=quiet, on_result=witness.take)
    tell(out / RECORD, as_json=False, quiet=quiet)
    if not witness.has_seen_all:
        typer.echo("The film was not seen to its end: no comparison with its truth.", err=True)
        raise typer.Exit(exit_status(out / RECORD))
    score = witness.score()
    if json_file is not None:
        write_json(score.to_dict(), json_file)
    if not quiet:
        _print_score(score)
        typer.echo(f"Open {out / 'report.html'} in a browser, and {out / 'annotated.mp4'} in a player.")
    raise typer.Exit(exit_status(out / RECORD))


def _load_film() -> Clip:
    """Return the film with its truth.

    Raises:
        DataError: The installation lacks part of it.
    """
    from standoff.evaluation.paper import load_clip

    try:
        return load_clip(Path(str(files("standoff"))) / "demo")
    except DataError as error:
        raise DataError(expected=error.expected, found=error.found, fix="install standoff again") from error


def _print_score(score: ClipScore) -> None:
    from standoff.cli.console import print_table
    from standoff.evaluation.paper.pairs import AFTER

    found = [
        (one.class_name, f"{one.detected} of {one.visible}", _number(100 * one.detected / one.visible, "%", 0),
         _number(one.ale_m, "m"), _number(one.position_median_m, "m"))
        for one in score.classes
    ]  # fmt: skip
    columns = ("class", "boxes found", "recall", "ALE", "median position error")
    print_table("Against the film's truth: detection", columns, found)
    measured = [
        (group.class_pair, f"{(one := group.scores[AFTER]).measured} of {one.frames}", _number(one.made_m, "m"),
         _number(one.mape_percent, "%", 1), _number(one.median_m, "m"))
        for group in score.pairs
    ]  # fmt: skip
    columns = ("pair", "distances measured", "MADE", "MAPE", "median residual")
    print_table(
        "Distances", columns, measured, "MADE and MAPE: the paper's mean absolute error, in metres and percent."
    )
    met = [_encounter_row(one) for one in score.encounters]
    recognised = sum(one.recognised for one in score.encounters)
    false = ", ".join(score.false_hazards) or "none"
    caption = f"{recognised} of {len(met)} recognised. False warnings and dangers: {false}."
    print_table("Hazards", ("really", "between", "seconds", "least gap", "said", "at"), met, caption, texts=2)


def _encounter_row(one: Encounter) -> tuple[str, ...]:
    said = (one.said, f"{one.said_s:.1f} s") if one.said else ("nothing", "")
    return one.kind, ", ".join(one.names), f"{one.start_s:.1f}-{one.end_s:.1f}", f"{one.least_gap_m:.2f} m", *said


def _number(value: float, unit: str, digits: int = 2) -> str:
    return "" if math.isnan(value) else f"{value:.{digits}f} {unit}"
