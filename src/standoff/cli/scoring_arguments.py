"""What the verbs take that compare runs with the truth of their clips."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from standoff.core.errors import ConfigError

RunsAndClips = Annotated[
    list[Path],
    typer.Argument(
        metavar="RUN CLIP",
        help="Folder of a run with its tables, and of the clip of `standoff simulate` that it is of; several pairs "
        "of them are pooled.",
        show_default=False,
    ),
]
JsonFile = Annotated[Path | None, typer.Option("--json", help="Also write the result as JSON; - prints only that.")]


def pairs_of_folders(folders: Sequence[Path]) -> list[tuple[Path, Path]]:
    """Return each run's folder with that of its clip.

    Raises:
        ConfigError: One has no other.
    """
    if len(folders) % 2:
        raise ConfigError(
            expected="pairs of folders, RUN CLIP RUN CLIP ...",
            found=f"{len(folders)} folder{'s' * (len(folders) > 1)}",
            fix="name the clip after each run",
        )
    return list(zip(folders[::2], folders[1::2], strict=True))
