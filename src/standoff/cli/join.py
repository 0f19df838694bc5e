"""`standoff join`: several detectors in one file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from standoff.core.errors import ConfigError


def join(
    parts: Annotated[
        list[str],
        typer.Argument(
            help="FILE.onnx, or FILE.onnx=CLASS[:FACTOR],... for these classes; all: the rest.", show_default=False
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="ONNX file to write.", show_default=False)],
) -> None:
    """Put several detectors into one file, each answering for the classes that it knows best."""
    from standoff.training.required import require_packages

    require_packages("onnx", purpose="join models")
    from standoff.training.join import join_models

    join_models([_part(text) for text in parts], out)
    typer.echo(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB)")


def _part(text: str) -> tuple[Path, dict[str, float]]:
    file, _, classes = text.partition("=")
    return Path(file), dict(_class(part.strip()) for part in classes.split(",") if part.strip())


def _class(text: str) -> tuple[str, float]:
    name, _, factor = text.partition(":")
    try:
        return name, float(factor or 1)
    except ValueError:
        raise ConfigError(expected="CLASS or CLASS:FACTOR", found=f"'{text}'", fix="write worker:0.5") from None
