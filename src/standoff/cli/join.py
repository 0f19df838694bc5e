"""`standoff join`: several detectors in one file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def join(
    parts: Annotated[
        list[str],
        typer.Argument(help="FILE.onnx, or FILE.onnx=CLASS,... for those classes alone.", show_default=False),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="ONNX file to write.", show_default=False)],
) -> None:
    """Put several detectors into one file, each answering for the classes that it knows best."""
    from standoff.training.required import require_packages

    require_packages("onnx", purpose="join models")
    from standoff.training.join import join_models

    join_models([_part(text) for text in parts], out)
    typer.echo(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB)")


def _part(text: str) -> tuple[Path, tuple[str, ...]]:
    name, _, classes = text.partition("=")
    return Path(name), tuple(part.strip() for part in classes.split(",") if part.strip())
