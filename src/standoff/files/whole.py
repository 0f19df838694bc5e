"""A file or a folder that appears whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from standoff.core.errors import OutputError
from standoff.files.in_use import in_use
from standoff.files.place import Place, partial_path


@contextmanager
def partial_file(out: Path) -> Generator[Path, None, None]:
    """Give a path to write to; the file takes its place as `out` when all went well, and leaves no trace otherwise.

    The path is `partial_path` of a plain file, so that whoever owns the folder knows what a killed process left. Links,
    pipes and devices: see `Place`.

    Raises:
        OSError: The file cannot be written.
    """
    place = Place(out)
    if place.target is None:
        with TemporaryDirectory() as folder:
            yield Path(folder) / out.name
            place.take(Path(folder) / out.name)
        return
    partial = partial_path(place.target)
    try:
        yield partial
        place.take(partial)
    except BaseException:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


@contextmanager
def whole_file(out: Path) -> Generator[Path, None, None]:
    """Give a path to write to, of the same name, in a folder of its own; otherwise as `partial_file`.

    Raises:
        OutputError: The file cannot be written.
    """
    try:
        place = Place(out)
        # Beside where it goes, so that it can take its place at once.
        folder_of_it = None if place.target is None else place.target.parent
        with TemporaryDirectory(dir=folder_of_it, prefix=".writing-") as folder:
            half_written = Path(folder) / out.name
            yield half_written
            place.take(half_written)
    except OSError as error:
        raise OutputError(
            expected=f"a place to write {out}",
            found=error.strerror or type(error).__name__,
            fix="make room, or choose a file in an existing folder that you may write to",
        ) from error


@contextmanager
def whole_folder(out: Path, *, overwrite: bool, own: Collection[str]) -> Generator[Path, None, None]:
    """Give a folder to write to that becomes `out` when the block ends well, and vanishes otherwise.

    Killed without a chance to tidy up, it leaves `.NAME.partial` beside `out`, which nothing takes for a result;
    the next attempt removes it.

    Args:
        out: The folder to be; parents are created. A link is followed.
        overwrite: Replace a folder that holds an earlier result.
        own: Names of what a result may hold at its top. A folder with anything else is never replaced.

    Raises:
        OutputError: `out` is a file, has files in it, is the current folder, is just being written, or cannot be.
    """
    out = out.resolve()
    if out.exists() and not out.is_dir():
        raise OutputError(expected="an output folder", found=f"the file {out}", fix="choose another folder")
    held = sorted(path.name for path in out.iterdir()) if out.is_dir() else []
    foreign = [name for name in held if name not in own]
    if foreign or (held and not overwrite):
        raise OutputError(
            expected="a new or empty output folder",
            found=f"{', '.join((foreign or held)[:3])} in {out}",
            fix="choose another one" if foreign else "choose another one or pass --overwrite",
        )
    if out == Path.cwd():
        raise OutputError(
            expected="an output folder that can be put in place as a whole",
            found=f"the current folder, {out}",
            fix="name a folder in it",
        )
    staging, older = (out.parent / f".{out.name}.{end}" for end in ("partial", "older"))
    try:
        if staging.exists():
            with in_use(staging):
                shutil.rmtree(staging, ignore_errors=True)
        staging.mkdir(parents=True)
    except OSError as error:
        raise _not_writable(out, error) from error
    try:
        with in_use(staging):
            yield staging
        if out.exists():
            shutil.rmtree(older, ignore_errors=True)
            out.replace(older)
        staging.replace(out)
        shutil.rmtree(older, ignore_errors=True)
    except OSError as error:
        raise _not_writable(out, error) from error
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def make_folder(path: Path) -> None:
    """Make a folder and those above it, unless they are there.

    Raises:
        OutputError: That is not possible.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _not_writable(path, error) from error


def _not_writable(out: Path, error: OSError) -> OutputError:
    return OutputError(
        expected="an output folder that can be written to",
        found=f"{out} ({error.strerror or error})",
        fix="choose another folder or make room and give write permission",
    )
