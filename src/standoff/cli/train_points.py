"""`standoff train-points`: a small network that tells where the things in a detector's boxes stand."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from standoff.training.ground_point.train import PointError


def train_points(
    data: Annotated[
        Path,
        typer.Argument(
            help="Labelled pictures with ground points: what `standoff simulate dataset` writes, or a mixture file.",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="ONNX file to write.", show_default=False)],
    only: Annotated[
        list[str] | None,
        typer.Option(
            help="Class of which the network is to be asked; may be repeated. Of the others their usual place in a box "
            "counts, which may be as good. [default: all]"
        ),
    ] = None,
    weights: Annotated[
        str,
        typer.Option(help="Detector whose first layers it starts with: site, or an exported efficientnet-lite0."),
    ] = "site",
    steps: Annotated[int, typer.Option(min=1, help="Batches of 64 boxes.")] = 3000,
    seed: Annotated[int, typer.Option(min=0, help="Of everything random.")] = 0,
    workers: Annotated[int, typer.Option(min=0, help="Processes that draw boxes; 0: none beside.")] = 1,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar.")] = False,
) -> None:
    """Train a network of ground points, which then serves every detector (detect.ground_points)."""
    from standoff.training.required import require_packages

    require_packages("torch", "onnx", purpose="train ground points")
    from standoff.cli.console import print_table, progress
    from standoff.core.errors import ConfigError
    from standoff.labels import read_data
    from standoff.stages.detect import POINT_CLASSES, DetectParams, OnnxDetector, find_model
    from standoff.training.ground_point import (
        PointTraining,
        as_found,
        measure_points,
        read_eyes,
        read_patches,
        train_points,
        write_points,
    )

    unknown = sorted(set(only or ()) - set(POINT_CLASSES))
    if unknown:
        raise ConfigError(
            expected=f"--only with one of {', '.join(POINT_CLASSES)}", found=", ".join(unknown), fix="correct the name"
        )
    model = find_model(weights)
    eyes, detector = read_eyes(model), OnnxDetector(model, DetectParams(ground_points="none"))
    labelled = read_data(data)
    learn, hold = (labelled.splits[split] for split in ("train", "val"))
    with progress("reading", len(learn) + len(hold), quiet=quiet, unit="pictures") as on_picture:
        patches = read_patches(learn, labelled.classes, on_picture)
        # Its errors are to hold for what a detector finds, in the boxes in which it does.
        held = read_patches(
            (as_found(picture, labelled.classes, detector) for picture in hold), labelled.classes, on_picture
        )
    plan = PointTraining(steps=steps, seed=seed, workers=workers)
    with progress(f"training on {len(patches)} boxes", steps, quiet=quiet, unit="steps") as on_step:
        network = train_points(patches, eyes, plan, on_step)
    errors = measure_points(network, held)
    write_points(network, errors, out, {"boxes": len(patches), "steps": steps, "seed": seed}, only or ())
    title = f"Ground points of {len(held)} boxes that were not learnt from"
    caption = "Distance from the true point in longer sides of the box; how many lie in the ellipse of 95 %, and by "
    caption += "what the stated errors are multiplied in the file so that 95 of 100 do."
    print_table(title, ("class", "boxes", "median", "p95", "in 95 %", "stretched"), _rows(errors), caption)
    typer.echo(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB)")


def _rows(errors: list[PointError]) -> list[tuple[str, ...]]:
    return [
        (one.name.replace("_", " "), str(one.count), f"{one.median:.3f}", f"{one.p95:.3f}",
         f"{100 * one.inside_95:.0f}", f"{one.stretch:.2f}")
        for one in errors
    ]  # fmt: skip
