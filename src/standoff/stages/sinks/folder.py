"""The output folder: whether it can be used."""

from __future__ import annotations

import errno
import shutil
import tempfile
from pathlib import Path

from standoff.core.errors import OutputError
from standoff.core.outputs import LOOKS_FOLDER, RUN_FILES
from standoff.files.in_use import in_use
from standoff.files.place import partial_path


def parts_folder(path: Path) -> Path:
    """Return where the parts of a table are kept while the run goes on, or after it was killed.

    >>> parts_folder(Path("out/tracks.parquet")).name
    'tracks.parts'
    """
    return path.with_suffix(".parts")


def _traces(folder: Path, looks: str) -> list[Path]:
    finals = [folder / name for name in RUN_FILES]
    unfinished = [parts_folder(path) for path in finals if path.suffix == ".parquet"]
    unfinished += [partial_path(path) for path in finals]
    kept = folder / LOOKS_FOLDER
    unfinished += [one for one in kept.iterdir() if one.name != looks] if looks and kept.is_dir() else [kept]
    return [path for path in finals + unfinished if path.exists() or path.is_symlink()]


def prepare_output(path: Path | str, *, overwrite: bool = False, looks: str = "") -> Path:
    """Create the output folder and make sure that a run can be written to it.

    Args:
        path: The folder; parents are created.
        overwrite: Remove the files of an earlier run first; files that are not ours are left alone.
        looks: Name of what the detector saw in the same run so far, which stays; empty: there is no such.

    Returns:
        The folder.

    Raises:
        OutputError: It is a file, cannot be created or written to, already holds a run, or one is going on in it.
    """
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise OutputError(expected="an output folder", found=f"the file {folder}", fix="choose another folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, prefix=".writable-"):
            pass
    except OSError as error:
        raise OutputError(
            expected="an output folder that can be written to",
            found=f"{folder} ({error.strerror or error})",
            fix="choose another folder or make room and give write permission",
        ) from error
    earlier = _traces(folder, looks)
    if earlier and not overwrite:
        raise OutputError(
            expected="an output folder without a run in it",
            found=f"{', '.join(trace.name for trace in earlier)} in {folder}",
            fix="choose another folder, or pass --overwrite, or --resume to go on with a run that was cut short",
        )
    with in_use(folder):
        for trace in earlier:
            _remove(trace)
    return folder


def _remove(trace: Path) -> None:
    try:
        if trace.is_dir() and not trace.is_symlink():
            shutil.rmtree(trace)
        elif trace.is_file() or trace.is_symlink():
            trace.unlink()
        else:
            raise OSError(errno.EINVAL, "a pipe or device")
    except OSError as error:
        raise OutputError(
            expected="an earlier run that can be removed",
            found=f"{trace} ({error.strerror or error})",
            fix="choose another folder",
        ) from error
