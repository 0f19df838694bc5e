"""Detectors that take their time, and one that kills the process it is in, once."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from cli.test_cli import Approach

from standoff.core.types import Detections, Frame

_KILLED_AT = 8
"""The frame: some results are on the disk by then."""


class Slow(Approach):
    """Take so long for each frame that a test can see a film being watched; leave word of which process does it.

    Args:
        words: Folder: a file in it for each film, with the ids of the process and of its parent.
        frame_s: For each frame.
    """

    def __init__(self, words: str, frame_s: float) -> None:
        self.words, self.frame_s = Path(words), frame_s
        # Asked later, an orphan would name the process that adopted it.
        self._ids = f"{os.getpid()} {os.getppid()}"

    def detect(self, frame: Frame) -> Detections:
        self.words.mkdir(exist_ok=True)
        (self.words / frame.stream_id).write_text(self._ids)
        time.sleep(self.frame_s)
        return super().detect(frame)


class KilledOnce(Approach):
    """Kill the process in the middle of one film, the first time that it comes there.

    Args:
        film: Name of its stream.
        mark: File that says that it was done.
    """

    def __init__(self, film: str, mark: str) -> None:
        self.film, self.mark = film, Path(mark)

    def detect(self, frame: Frame) -> Detections:
        if frame.stream_id == self.film and frame.index == _KILLED_AT and not self.mark.exists():
            self.mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().detect(frame)
