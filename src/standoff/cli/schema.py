"""`standoff schema`: JSON Schemas of what a run writes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def schema(
    name: Annotated[
        str | None,
        typer.Argument(help="One of those that are printed without a name.", show_default=False),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for all of them; created.", show_default=False)
    ] = None,
) -> None:
    """Print the JSON Schema of an output, or the names of all; or write all of them to a folder."""
    from standoff.cli.console import write_json
    from standoff.core.errors import ConfigError
    from standoff.files.whole import make_folder
    from standoff.schemas import SCHEMAS

    if name is not None and name not in SCHEMAS:
        raise ConfigError(expected=f"an output, {', '.join(SCHEMAS)}", found=name, fix="give one of them, or none")
    names = [*SCHEMAS] if name is None else [name]
    if out is not None:
        make_folder(out)
        for one in names:
            write_json(SCHEMAS[one](), out / f"{one}.schema.json")
        typer.echo(f"{out}: {', '.join(names)}")
    elif name is None:
        typer.echo("\n".join(names))
    else:
        write_json(SCHEMAS[name](), Path("-"))
