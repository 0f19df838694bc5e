"""A ground stage for when nobody has said where the ground is: everything is detected, nothing measured."""

from __future__ import annotations

from standoff.core import protocols
from standoff.core.types import CameraMotion, Detections, Frame, NoCameraMotion, NoGroundMap
from standoff.stages.ground.basis import HELP


class Unmapped(protocols.Ground):
    """Say in every frame that no ground is configured."""

    def describe(self) -> dict[str, str]:
        """Return that there is nothing, and what would help."""
        return {"method": "none", "basis": "nothing: no ground is configured", "better": HELP}

    def update(self, frame: Frame, detections: Detections, motion: CameraMotion | NoCameraMotion) -> NoGroundMap:
        """Return the reason; frame, detections and motion play no part."""
        return NoGroundMap("no ground is configured")
