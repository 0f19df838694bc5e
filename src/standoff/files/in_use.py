"""Whether somebody is just writing to a folder."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from standoff.core.errors import OutputError

# Windows, which has none, refuses by itself to remove files that are open.
_LOCKS = import_module("fcntl") if find_spec("fcntl") else None


class FolderInUse:
    """A mark on a folder that this process writes to it, gone with the process however that ends.

    Args:
        folder: An existing folder. Where its file system has no locks, the mark is none.

    Raises:
        OutputError: Another process, or another part of this one, is writing to it.
    """

    def __init__(self, folder: Path) -> None:
        self._descriptor: int | None = None
        if _LOCKS is None:
            return
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            _LOCKS.flock(descriptor, _LOCKS.LOCK_EX | _LOCKS.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            raise OutputError(
                expected="a folder that nobody is writing to",
                found=f"{folder}, where a run is still going on",
                fix="wait for its end, stop it, or choose another folder",
            ) from None
        except OSError:
            os.close(descriptor)
            return
        self._descriptor = descriptor

    def release(self) -> None:
        """Take the mark away; more than once does no harm."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def __del__(self) -> None:
        self.release()


@contextmanager
def in_use(folder: Path) -> Generator[None, None, None]:
    """Mark an existing folder while the block runs.

    Raises:
        OutputError: Another process, or another part of this one, is writing to it.
    """
    mark = FolderInUse(folder)
    try:
        yield
    finally:
        mark.release()
