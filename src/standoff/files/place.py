"""Where a file that is whole goes: into a plain file's place, or into what cannot be replaced."""

from __future__ import annotations

import os
import shutil
import stat
import sys
from contextlib import suppress
from pathlib import Path


def partial_path(path: Path) -> Path:
    """Return the name of a file that is not whole yet; beside the final name, so that a rename is atomic.

    >>> partial_path(Path("out/run.json")).name
    '.run.json.partial'
    """
    return path.with_name(f".{path.name}.partial")


class Place:
    """What a path that somebody wants a file at stands for.

    A plain file, or nothing yet, is replaced at once, at the end of the links that lead there: whoever reads it finds
    the old one or the new one. A pipe, a device and an open file of this process (`/dev/stdout`) are written into:
    putting another file under their names would take them away from everybody else.

    Args:
        out: The path.

    Attributes:
        target: The plain file, there or to be; None where the path stands for something that is written into.

    Raises:
        OSError: It cannot be looked at: links in a circle, a folder that may not be entered.
    """

    def __init__(self, out: Path) -> None:
        self._out = out
        self._open_file = _open_file_of_this_process(out)
        target = Path(os.path.realpath(out))
        self.target = target if self._open_file is None and _is_plain_or_absent(target) else None

    def take(self, whole: Path) -> None:
        """Put a file there, which is then gone from where it was; on the disk before it gets its name.

        Raises:
            OSError: It cannot be written.
        """
        if self.target is not None:
            with whole.open("rb") as file:
                os.fsync(file.fileno())
            whole.replace(self.target)
            return
        with whole.open("rb") as source, os.fdopen(self._opened(), "wb") as sink:
            shutil.copyfileobj(source, sink)
        whole.unlink()

    def _opened(self) -> int:
        if self._open_file is None:
            return os.open(self._out, os.O_WRONLY)
        # What was printed before comes first, and what follows goes on where this ends.
        with suppress(ValueError, OSError):
            sys.stdout.flush()
        return os.dup(self._open_file)


def _is_plain_or_absent(path: Path) -> bool:
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except FileNotFoundError:
        return True


def _open_file_of_this_process(out: Path) -> int | None:
    """Return which, where a path or a link on its way (`/dev/stdout`) names one."""
    step, own = Path(os.path.abspath(out)), Path(f"/proc/{os.getpid()}/fd")  # noqa: PTH100 - links are looked at singly
    for _ in range(_MOST_LINKS):
        folder = Path(os.path.realpath(step.parent))
        if folder == own and step.name.isdecimal():
            return int(step.name)
        try:
            step = folder / (folder / step.name).readlink()
        except OSError:
            return None
    return None


_MOST_LINKS = 40
"""Linux follows no more."""
