"""One network for many streams: its weights once in memory, its time shared."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

from standoff.core.protocols import Detector
from standoff.core.types import Detections, Frame


class SharedDetector(Detector):
    """A detector that several threads may ask, one after another in the order in which they came.

    Fair, because a stream that asks again at once would otherwise hold up all others: each caller takes a number.

    Args:
        detector: Keeps nothing of one frame for the next.
    """

    def __init__(self, detector: Detector) -> None:
        self._detector = detector
        self._turn = threading.Condition()
        self._next = self._served = 0

    def describe(self) -> Mapping[str, Any]:
        """Return the detector's own."""
        return self._detector.describe()

    def detect(self, frame: Frame) -> Detections:
        """Return what is seen, once it is this caller's turn."""
        with self._turn:
            number, self._next = self._next, self._next + 1
            self._turn.wait_for(lambda: self._served == number)
        try:
            return self._detector.detect(frame)
        finally:
            with self._turn:
                self._served += 1
                self._turn.notify_all()

    def rests(self, frame: Frame) -> bool:
        """Return what the detector says."""
        return self._detector.rests(frame)
