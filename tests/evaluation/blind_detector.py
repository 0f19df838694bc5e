from __future__ import annotations

from standoff.core.types import Detections, Frame


class BlindDetector:
    """Sees nothing, needs no model."""

    def detect(self, frame: Frame) -> Detections:
        return Detections.empty()
