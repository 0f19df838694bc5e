"""A detector that looks at each frame by itself and leaves word of every look; it can kill its process, once."""

from __future__ import annotations

import os
import signal
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cli.test_replay import Unsure

from standoff.core.protocols import EACH_ALONE
from standoff.core.types import Detections, Frame


class Noted(Unsure):
    """Leave word of every look.

    Args:
        words: File to which the index of each frame is added.
        dies_at: Frames at which it kills its process the first time that it comes there.
    """

    def __init__(self, words: str, dies_at: Sequence[int] = ()) -> None:
        self.words, self.dies_at = Path(words), dies_at

    def describe(self) -> Mapping[str, Any]:
        return {**super().describe(), EACH_ALONE: True}

    def detect(self, frame: Frame) -> Detections:
        if frame.index in self.dies_at and frame.index not in looks(self.words):
            self._note(frame)
            os.kill(os.getpid(), signal.SIGKILL)
        self._note(frame)
        return super().detect(frame)

    def _note(self, frame: Frame) -> None:
        with self.words.open("a", encoding="utf-8") as words:
            words.write(f"{frame.index}\n")


def looks(words: Path) -> list[int]:
    """Return the index of each frame that was looked at, in the order of the looks."""
    return [int(line) for line in words.read_text().split()] if words.exists() else []
