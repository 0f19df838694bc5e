"""`standoff marker`: a target to print, as PDF of exact size."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, cast

import typer


def marker(
    size_m: Annotated[
        float,
        typer.Option(help="Side of the black square, outer edge to outer edge; m (0.1 to 3.5).", show_default=False),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="PDF to write.", show_default=False)],
    marker_id: Annotated[int, typer.Option("--id", help="Which marker of the family.")] = 0,
    family: Annotated[str, typer.Option(help="apriltag36h11, apriltag25h9 or aruco6x6_50.")] = "apriltag36h11",
    paper: Annotated[
        str, typer.Option(help="A4, A3, A2, A1, A0, letter, tabloid: sheets to glue; single: one page of full size.")
    ] = "A4",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")] = False,
) -> None:
    """Print a target that standoff finds by itself, and that says where the ground is."""
    from standoff.stages.ground import MarkerFamily
    from standoff.targets import Paper, Target, write_target

    target = Target(size_m, marker_id, cast(MarkerFamily, family))
    pages = write_target(target, out, paper=cast(Paper, paper), overwrite=overwrite)
    if paper == "single":
        side = f"{target.whole_mm / 1000.0:.3f} m"
        typer.echo(f"{out}: one page of {side} x {side}. Have it printed at 100 % on matt material.")
    else:
        typer.echo(f"{out}: {pages - 1} sheets {paper} and a page that says how to glue them. Print at 100 %.")
