"""`standoff evaluate watched`: whether workers are found where the ground is called watched."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from standoff.cli.scoring_arguments import JsonFile, RunsAndClips, pairs_of_folders

if TYPE_CHECKING:
    from standoff.cli.console import Table
    from standoff.evaluation.watched import Missed, WatchedResult


def watched(
    folders: RunsAndClips,
    json_file: JsonFile = None,
    write_finding: Annotated[
        Path | None,
        typer.Option(help="Write into this model's file, which all runs must have used, how small a worker it finds."),
    ] = None,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print the tables in Markdown.")] = False,
) -> None:
    """Compare the ground that a run called watched with where workers truly were, and whether they were found."""
    from standoff import __version__
    from standoff.cli.console import print_tables, progress, write_json
    from standoff.evaluation.watched import evaluate_watched

    runs = pairs_of_folders(folders)
    with progress("reading", len(runs), unit="runs", quiet=len(runs) == 1) as on_run:
        result = evaluate_watched(runs, on_run)
    if str(json_file) != "-":
        print_tables([_table(result), _finding_table(result)], as_markdown=markdown)
    if write_finding is not None:
        from standoff.training.quantization.onnx_file import tell_finding

        tell_finding(write_finding, result.finding)
    if json_file is not None:
        write_json({"standoff": __version__, **result.to_dict()}, json_file)


def _table(result: WatchedResult) -> Table:
    from standoff.cli.console import Table

    rows: list[tuple[str, ...]] = [
        ("on watched ground", *_cells(result.on_watched)),
        ("  hidden by something", *_cells(result.on_watched_hidden)),
        *((reason, *_cells(missed)) for reason, missed in result.on_unwatched.items()),
    ]
    caption = (
        f"Workers in frames, whose feet are in the picture; hidden: a tenth of them and more, or cut off. "
        f"{100 * result.watched_share:.0f} % of the ground in the pictures is called watched; of {result.findable} "
        f"workers of heights of which nine of ten are found, {_percent(result.watched_of_findable)} stand on it. "
        f"Of {result.breaches} in a breach, {result.breaches_called_clear} stand on watched ground and are called "
        f"clear: {_percent(result.called_clear_share)}."
    )
    clips = len(result.clips)
    title = f"Workers and watched ground: {clips} clip{'s' * (clips > 1)}, {result.frames} frames"
    return Table(title, ("a worker stands", "workers", "missed", "%"), rows, caption)


def _finding_table(result: WatchedResult) -> Table:
    from standoff.cli.console import Table

    finding = result.finding
    pairs = zip(finding.height_px, finding.share, strict=True) if finding.measured else ()
    rows: list[tuple[str, ...]] = [(f"{height_px:.0f} px", f"{100 * share:.0f} %") for height_px, share in pairs]
    least_px = finding.least_height_px(0.9) if finding.measured else float("inf")
    caption = f"Pixels of the detector's input. Nine of ten are noticed from {least_px:.0f} px."
    title = "Workers in a track, or where somebody may stand, by how tall they are; nothing of them hidden"
    return Table(title, ("height", "noticed"), rows, caption)


def _cells(missed: Missed) -> tuple[str, str, str]:
    return str(missed.workers), str(missed.missed), _percent(missed.missed_share).removesuffix(" %")


def _percent(share: float) -> str:
    return "none" if share != share else f"{100 * share:.1f} %"
