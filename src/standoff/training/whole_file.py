"""A file appears whole or not at all."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from standoff.core.errors import OutputError


@contextmanager
def whole_file(out: Path) -> Generator[Path, None, None]:
    """Give a path to write to; the file takes its place as `out` when all went well, and leaves no trace otherwise.

    Raises:
        OutputError: The file cannot be written.
    """
    try:
        with TemporaryDirectory(dir=out.parent, prefix=".writing-") as folder:
            half_written = Path(folder) / out.name
            yield half_written
            half_written.replace(out)
    except OSError as error:
        raise OutputError(
            expected=f"a place to write {out}",
            found=error.strerror or type(error).__name__,
            fix="choose a file in an existing folder that you may write to",
        ) from error
