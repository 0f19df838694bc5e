"""A detector that is asked only about frames in which nobody has looked yet."""

from __future__ import annotations

from typing import Any

from standoff.clips import KeptLooks
from standoff.core import protocols
from standoff.core.types import Detections, Frame


class RememberingDetector(protocols.Detector):
    """Detector that gives back what was seen in a frame where that is kept, and looks itself elsewhere.

    Args:
        detector: Sees in each frame what depends on that frame alone.
        kept: What it saw earlier, or elsewhere.
    """

    def __init__(self, detector: protocols.Detector, kept: KeptLooks) -> None:
        self._detector, self._kept = detector, kept
        self._remembered = 0

    def describe(self) -> dict[str, Any]:
        """Return the detector's own facts, and in how many frames it had looked already, where there are such."""
        remembered = {"remembered_frames": self._remembered} if self._remembered else {}
        return {**self._detector.describe(), **remembered}

    def prepare(self, size_px: tuple[int, int]) -> None:
        """Let the detector look at the size of the pictures."""
        self._detector.prepare(size_px)

    def reset(self) -> None:
        """Let the detector forget; what is kept stays."""
        self._detector.reset()

    def rests(self, frame: Frame) -> bool:
        """Return what the detector says."""
        return self._detector.rests(frame)

    def detect(self, frame: Frame) -> Detections:
        """Return what was seen in a frame, then or now."""
        kept = self._kept.of(frame)
        if kept is None:
            return self._detector.detect(frame)
        self._remembered += 1
        return kept
