"""`standoff calibrate`: photographs of a checkerboard in, a camera file out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from standoff.cli.numbers import two_integers


def pattern_size(text: str) -> tuple[int, int]:
    """Read `COLUMNSxROWS` of inner corners.

    Raises:
        ConfigError: It is not of that form.

    >>> pattern_size("9x6")
    (9, 6)
    """
    return two_integers(text, "x", expected="a pattern of inner corners, COLUMNSxROWS", example="9x6")


def calibrate(
    pictures: Annotated[Path, typer.Argument(help="Folder of board photographs.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="Camera file to write, YAML.", show_default=False)],
    pattern: Annotated[str, typer.Option(help="Inner corners, COLUMNSxROWS.")] = "9x6",
    square_mm: Annotated[float, typer.Option(min=0.001, help="Side of one square; mm.")] = 25.0,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Also write the result as JSON; - prints it.")
    ] = None,
) -> None:
    """Find a camera's matrix and lens distortion from photographs of a checkerboard, as the sensor has them."""
    from standoff.cli.console import print_table, write_json
    from standoff.stages.ground import calibrate as calibrate_camera
    from standoff.stages.ground import save_camera

    result = calibrate_camera(pictures, pattern_size(pattern), square_mm / 1000.0)
    for warning in result.warnings:
        typer.echo(f"standoff: warning: {warning}", err=True)
    save_camera(result.camera, out, calibration=result.to_dict())
    if json_file is not None:
        write_json(result.to_dict(), json_file)
    if str(json_file) == "-":
        return
    rows = [(name, f"{rms:.3f}") for name, rms in zip(result.views_used, result.per_view_rms_px, strict=True)]
    rows += [(name, "no board found") for name in result.views_failed]
    rows += [(name, "another size") for name in result.views_of_other_size]
    rows += [(name, "as another one") for name in result.views_repeated]
    caption = f"{result.rms_px:.3f} px over all views; wrote {out}"
    print_table("Reprojection error", ("view", "rms px"), rows, caption)
