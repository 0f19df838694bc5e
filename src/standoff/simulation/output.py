"""A folder that appears whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from standoff.core.errors import OutputError


@contextmanager
def whole_folder(out: Path, *, overwrite: bool) -> Generator[Path, None, None]:
    """Give a folder to write to that becomes `out` when the block ends well, and vanishes otherwise.

    Killed without a chance to tidy up, it leaves `.NAME.partial` beside `out`, which nothing takes for a result;
    the next attempt removes it.

    Args:
        out: The folder to be; parents are created.
        overwrite: Replace a folder that has files in it.

    Raises:
        OutputError: `out` is a file, has files in it, or cannot be written.
    """
    if out.exists() and not out.is_dir():
        raise OutputError(expected="an output folder", found=f"the file {out}", fix="choose another folder")
    if out.is_dir() and any(out.iterdir()) and not overwrite:
        raise OutputError(
            expected="a new or empty output folder",
            found=f"files in {out}",
            fix="choose another one or pass --overwrite",
        )
    staging = out.parent / f".{out.name}.partial"
    try:
        shutil.rmtree(staging, ignore_errors=True)
        staging.mkdir(parents=True)
    except OSError as error:
        raise OutputError(
            expected="an output folder that can be written to",
            found=f"{out} ({error.strerror or error})",
            fix="choose another folder or make room and give write permission",
        ) from error
    try:
        yield staging
        if out.exists():
            shutil.rmtree(out)
        staging.replace(out)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
