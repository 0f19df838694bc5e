"""`standoff export`: Darknet cfg and weights in, one ONNX file out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from standoff.cli.numbers import two_integers


def export(
    cfg: Annotated[Path, typer.Option(help="Darknet .cfg.", show_default=False)],
    weights: Annotated[Path, typer.Option(help="Darknet .weights.", show_default=False)],
    names: Annotated[Path, typer.Option(help="Class names, one a line.", show_default=False)],
    out: Annotated[Path, typer.Option(help="ONNX file to write.", show_default=False)],
    size: Annotated[str | None, typer.Option(help="Input size, WxH. Absent: the cfg's.")] = None,
    half: Annotated[bool, typer.Option("--half", help="Store the weights in half precision: half the file.")] = False,
) -> None:
    """Turn a Darknet network (YOLOv3 and its family) into one self-describing ONNX file."""
    from standoff.training import export_darknet

    export_darknet(cfg, weights, names, _size(size), out, half=half)
    typer.echo(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB)")


def _size(text: str | None) -> tuple[int, int] | None:
    return None if text is None else two_integers(text, "x", expected="--size WxH", example="--size 768x576")
