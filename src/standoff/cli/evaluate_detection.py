"""`standoff evaluate detection`: detectors side by side on pictures with known truth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from standoff.cli.numbers import frame_range, two_integers
from standoff.core.errors import ConfigError

if TYPE_CHECKING:
    from standoff.evaluation.detection.comparison import Comparison
    from standoff.evaluation.detection.detector_trial import DetectorSetup
    from standoff.evaluation.detection.grouping import Grouping
    from standoff.evaluation.detection.material import Material

Split = Literal["train", "val", "test", "all"]


def detection(
    data: Annotated[
        Path,
        typer.Option(
            help="Labelled pictures (YOLO, COCO, VOC, a mixture), a simulated clip, or a CSV of boxes.",
            show_default=False,
        ),
    ],
    model: Annotated[
        list[str],
        typer.Option(help="Detector: site (ours) or ONNX; may be repeated.", show_default=False),
    ],
    split: Annotated[
        Split | None,
        typer.Option(help="Of labelled pictures. [default: test, or all where nothing says what is held out]"),
    ] = None,
    slices: Annotated[
        list[str] | None, typer.Option(help="Slices, COLUMNSxROWS: one for all models or one for each. [default: 1x1]")
    ] = None,
    merge_machines: Annotated[
        bool, typer.Option("--merge-machines", help="Score all machines as one class beside the worker.")
    ] = False,
    without: Annotated[list[str] | None, typer.Option(help="Class that is not scored; may be repeated.")] = None,
    video: Annotated[Path | None, typer.Option(help="That a CSV of boxes (frame,id,x,y,w,h,conf,X,Y) is of.")] = None,
    frames: Annotated[str | None, typer.Option(help="Of a CSV of boxes, score these frames only, FIRST-LAST.")] = None,
    at: Annotated[
        list[float] | None, typer.Option(min=0.005, max=1, help="Also say precision and recall at this score.")
    ] = None,
    iou: Annotated[
        float, typer.Option(min=0.05, max=1, help="Least overlap of a right detection; COCO's figures have their own.")
    ] = 0.5,
    limit: Annotated[int | None, typer.Option(min=1, help="So many pictures only, evenly spread.")] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Also write the result as JSON; - prints only that.")
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="Also draw precision-recall and accuracy-time to here.")] = None,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print the tables in Markdown.")] = False,
) -> None:
    """Compare detectors: mAP, average IoU, localisation error, COCO's figures, milliseconds."""
    from standoff.cli.console import progress, write_json
    from standoff.cli.detection_tables import print_comparison
    from standoff.evaluation.detection.coco import require_pycocotools
    from standoff.evaluation.detection.figures import write_figures
    from standoff.evaluation.detection.grouping import site_grouping
    from standoff.evaluation.detection.material import open_material
    from standoff.labels.problems import problem_lines
    from standoff.stages.detect import find_model

    require_pycocotools()
    grouping = site_grouping(merge_machines=merge_machines, without=without or ())
    candidates = _candidates([find_model(name) for name in model], slices or ["1x1"])
    with progress("reading", None, unit="pictures") as on_picture:
        material = open_material(
            data, split=split, video=video, frames=frame_range(frames), limit=limit, on_picture=on_picture
        )
    if split is None and material.is_whole:
        typer.echo(
            "nothing says what is held out: all pictures are scored, also those that `standoff train` learns from "
            "(it holds out --split val)",
            err=True,
        )
    for line in problem_lines(material.problems):
        typer.echo(line, err=True)
    comparison = _compare(candidates, material, grouping, iou, at or [])
    # First what cannot fail: a mistyped path must not cost an hour of inference.
    if str(json_file) != "-":
        print_comparison(comparison, as_markdown=markdown)
    if json_file is not None:
        write_json(comparison.to_dict(), json_file)
    if figure is not None:
        write_figures(comparison, figure)


def _candidates(models: Sequence[Path], slices: Sequence[str]) -> list[DetectorSetup]:
    from standoff.evaluation.detection.detector_trial import DetectorSetup

    expected, example = "--slices COLUMNSxROWS", "--slices 2x1"
    if len(slices) not in (1, len(models)):
        found = f"{len(slices)} for {len(models)} models"
        raise ConfigError(expected="--slices once, or once for each --model", found=found, fix="repeat it as often")
    grids = [two_integers(text, "x", expected=expected, example=example) for text in slices]
    if min(min(grid) for grid in grids) < 1:
        raise ConfigError(expected=expected, found="0 slices", fix=f"write for example {example}")
    grids = grids * len(models) if len(grids) == 1 else grids
    names = _names(models)
    labels = [
        name + ("" if grid == (1, 1) else f" {grid[0]}x{grid[1]}") for name, grid in zip(names, grids, strict=True)
    ]
    doubled = sorted(label for label, count in Counter(labels).items() if count > 1)
    if doubled:
        raise ConfigError(
            expected="each --model once with the same --slices",
            found=f"{doubled[0]} {labels.count(doubled[0])} times",
            fix="leave the others out",
        )
    return [DetectorSetup(label, path, grid) for label, path, grid in zip(labels, models, grids, strict=True)]


def _names(models: Sequence[Path]) -> list[str]:
    """Return the stem of each model, with as many folders before it as tell it from the other files."""
    parts = [path.resolve().with_suffix("").parts for path in models]
    different = set(parts)
    names = []
    for own in parts:
        others = different - {own}
        length = next(n for n in range(1, len(own) + 1) if all(other[-n:] != own[-n:] for other in others))
        names.append("/".join(own[-length:]))
    return names


def _compare(
    candidates: Sequence[DetectorSetup], material: Material, grouping: Grouping, iou: float, thresholds: Sequence[float]
) -> Comparison:
    from standoff.cli.console import progress
    from standoff.evaluation.detection.comparison import compare
    from standoff.evaluation.detection.detector_trial import require_truth, try_candidate

    require_truth(material, grouping)
    # What is no detector is to be known before the first hour of another one.
    detectors = [candidate.open(tells_points=material.knows_points) for candidate in candidates]
    results = []
    for candidate, detector in zip(candidates, detectors, strict=True):
        with progress(candidate.label, len(material.truth), unit="pictures") as on_frame:
            results.append(try_candidate(candidate, detector, material, grouping, iou, on_frame))
    return compare(material, results, thresholds)
