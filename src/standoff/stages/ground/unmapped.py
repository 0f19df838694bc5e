"""A ground stage for when nobody has said where the ground is: everything is detected, nothing measured."""

from __future__ import annotations

from standoff.core.types import Detections, Frame, NoGroundMap


class Unmapped:
    """Say in every frame that no ground is configured."""

    def __init__(self) -> None:
        self.description = {"method": "none"}

    def update(self, frame: Frame, detections: Detections) -> NoGroundMap:
        """Return the reason; frame and detections play no part."""
        return NoGroundMap("no ground is configured")
