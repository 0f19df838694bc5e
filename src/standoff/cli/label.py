"""`standoff label`: frames worth labelling, with the detector's own boxes as a start."""

from __future__ import annotations

from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from standoff.training.frame_selection import LabelReport

_LONGEST_REASON = 60
"""Of a comment as much as there is room for on the sheet."""


def label(
    source: Annotated[Path, typer.Argument(help="Video file, or a folder of pictures.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for pictures and boxes.", show_default=False)],
    model: Annotated[str, typer.Option(help="Detector: site (ours), or ONNX.")] = "site",
    frames: Annotated[int, typer.Option(min=1, help="How many to choose, at most.")] = 100,
    every: Annotated[
        float | None, typer.Option(min=0, help="Look each so many seconds. Absent: at ten times as many as chosen.")
    ] = None,
    gap: Annotated[float, typer.Option(min=0, help="Least time between two chosen frames; s.")] = 0.5,
    review: Annotated[
        Path | None, typer.Option(help="Folder of a run of this film: begin with what `standoff open` called false.")
    ] = None,
    threshold: Annotated[float, typer.Option(help="Score from which a box is proposed, between 0 and 1.")] = 0.3,
    fps: Annotated[float | None, typer.Option(help="Frames a second of a picture folder.")] = None,
    layout: Annotated[
        Literal["coco", "label-studio", "both"], typer.Option("--format", help="Of the boxes: CVAT reads COCO.")
    ] = "both",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the folder if it exists.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")] = False,
) -> None:
    """Choose frames on which the detector is unsure, no two alike, and write them for CVAT or Label Studio."""
    from functools import partial

    from standoff.cli.console import progress
    from standoff.files.whole import whole_folder
    from standoff.stages.detect import DetectParams, OnnxDetector, find_model
    from standoff.training.frame_selection import LABEL_FILES, LabelPlan, SelectionParams, label_frames
    from standoff.training.frame_selection.doubt import LEAST_SCORE

    selection = SelectionParams(frames=frames, threshold=_part(threshold), least_gap_s=gap)
    plan = LabelPlan(source, selection, every_s=every, fps=fps, format=layout, wanted=_false_alarms(review))
    with whole_folder(out, overwrite=overwrite, own=LABEL_FILES) as folder:
        params = DetectParams(score_threshold=min(threshold, LEAST_SCORE), ground_points="none")
        detector = OnnxDetector(find_model(model), params)
        report = label_frames(plan, detector, folder, partial(progress, quiet=quiet))
    if not quiet:
        _tell(report, out)


def _false_alarms(run: Path | None) -> dict[float, str]:
    """Return when in its film a run's hazards were at their worst that somebody called false, and what was said."""
    from standoff.clips.reviews import read_reviews
    from standoff.core.errors import DataError

    if run is None:
        return {}
    said = [one for one in read_reviews(run).values() if one.verdict == "false_alarm"]
    if not said:
        raise DataError(
            expected=f"hazards in {run} that somebody called false alarms",
            found="none",
            fix=f"say so in `standoff open {run}`, or leave --review out",
        )
    return {one.time_s: shorten(f"false alarm: {one.comment}", _LONGEST_REASON).removesuffix(":") for one in said}


def _part(threshold: float) -> float:
    from standoff.core.errors import ConfigError

    if not 0 < threshold < 1:
        raise ConfigError(expected="--threshold between 0 and 1", found=f"{threshold:g}", fix="write for example 0.3")
    return threshold


def _tell(report: LabelReport, out: Path) -> None:
    from standoff.cli.console import print_table

    rows = [
        (f"{choice.candidate.index}", f"{choice.candidate.time_s:.2f}", f"{choice.candidate.doubt:.1f}", choice.reason)
        for choice in report.choices
    ]
    caption = f"{report.boxes} boxes proposed"
    if not report.anything_seen:
        caption = "The detector saw nothing in any frame; these were chosen for being unlike each other."
    title = f"{len(report.choices)} of {report.looked_at} frames are worth labelling"
    print_table(title, ("frame", "s", "doubt", "why"), rows, caption, texts=0)
    typer.echo(f"open {out / 'contact_sheet.png'}")
