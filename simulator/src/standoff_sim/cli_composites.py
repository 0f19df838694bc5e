"""`standoff simulate composites`: rendered machines and people on photographs of real ground."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from standoff_sim.clip.presets import MAX_SEED


def composites(
    backgrounds: Annotated[
        list[str],
        typer.Option(
            help="Folder of photographs, DIR, DIR:nadir or DIR:oblique, or a YAML file; may be repeated.",
            show_default=False,
        ),
    ],
    images: Annotated[int, typer.Option(min=1, help="How many in all.", show_default=False)],
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder for the files; appears when all is done.", show_default=False)
    ],
    size: Annotated[str, typer.Option(help="Of the pictures, WIDTHxHEIGHT px.")] = "1280x720",
    held_out: Annotated[float, typer.Option(min=0, max=0.4, help="Share of flights for each of val and test.")] = 0.1,
    seed: Annotated[int, typer.Option(help=f"Of everything random, 0 to {MAX_SEED}.")] = 0,
    excavator_mesh: Annotated[
        Path | None, typer.Option(help="Folder of COLLADA or glTF parts for a third of the excavators.")
    ] = None,
    machines: Annotated[int, typer.Option(min=0, max=30, help="Most machines in a picture.")] = 4,
    processes: Annotated[int, typer.Option(min=1, help="Side by side; the result does not depend on it.")] = 2,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the folder if it exists.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar.")] = False,
) -> None:
    """Lay rendered machines, people and clutter over photographs of real ground, for training; split by flight."""
    from standoff.cli.console import progress
    from standoff.cli.numbers import two_integers
    from standoff_sim.composites.composite_set import CompositePlan, record_composites

    width_px, height_px = two_integers(size, "x", expected="a size as WIDTHxHEIGHT", example="1920x1080")
    plan = CompositePlan(
        backgrounds=tuple(backgrounds), images=images, width_px=width_px, height_px=height_px, held_out=held_out,
        seed=seed, excavator_mesh=excavator_mesh, most_machines=machines,
    )  # fmt: skip
    with progress("compositing", images, quiet=quiet, unit="pictures") as step:
        record_composites(plan, out, overwrite=overwrite, processes=processes, on_picture=step)
    typer.echo(f"{images} pictures in {out}")
