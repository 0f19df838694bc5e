"""`standoff blend`: one network between several of one architecture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from standoff.core.errors import ConfigError


def blend(
    parts: Annotated[
        list[str], typer.Argument(help="FILE.weights=SHARE each; the shares add up to 1.", show_default=False)
    ],
    cfg: Annotated[Path, typer.Option(help="Darknet .cfg that all of them belong to.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="Darknet weights to write.", show_default=False)],
    layers: Annotated[
        int | None, typer.Option(min=1, help="Only the first so many layers, as darknet53.conv.74. Absent: all.")
    ] = None,
) -> None:
    """Mix Darknet weights, such as a run's start.weights=0.3 and best.weights=0.7, to keep what the start knew.

    One file with a share of 1 is copied; with --layers, cut for others to start from.
    """
    from standoff.training.required import require_packages

    require_packages("torch", purpose="blend weights")
    from standoff.training.start.blend import blend_weights

    blend_weights(cfg, [_part(text) for text in parts], out, layers)
    if layers is not None:
        typer.echo(f"wrote {out}; start from it with: standoff train --weights {out}")
        return
    command = f"standoff export --cfg {cfg} --weights {out} --names ... --out ..."
    typer.echo(f"wrote {out}; make a model of it with: {command}")


def _part(text: str) -> tuple[Path, float]:
    name, _, share = text.rpartition("=")
    try:
        return Path(name), float(share)
    except ValueError:
        raise ConfigError(
            expected="FILE.weights=SHARE", found=f"'{text}'", fix="write for example best.weights=0.7"
        ) from None
