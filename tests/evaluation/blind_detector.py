from __future__ import annotations

from standoff.core import protocols
from standoff.core.types import Detections, Frame


class BlindDetector(protocols.Detector):
    """Sees nothing, needs no model."""

    def detect(self, frame: Frame) -> Detections:
        return Detections.empty()
