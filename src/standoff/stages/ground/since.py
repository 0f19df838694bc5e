"""Motion counted from a frame of one's own choice, not only from a keyframe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from standoff.core.types import CameraMotion, NoCameraMotion


class MotionSince:
    """Tells how the picture moved since a frame within the life of a keyframe.

    `PoseFilter` carries a belief only from the time that the motion counts from. A belief about a frame in between
    would have to wait for the next keyframe.
    """

    def __init__(self) -> None:
        self._begun: CameraMotion | None = None
        self._begun_s = 0.0

    def begin(self, time_s: float, motion: CameraMotion | NoCameraMotion) -> None:
        """Count from this frame, whose own motion is given."""
        self._begun = motion if isinstance(motion, CameraMotion) else None
        self._begun_s = time_s

    def since(self, motion: CameraMotion) -> CameraMotion:
        """Return the motion since that frame, or the motion as it is once there is a newer keyframe."""
        begun = self._begun
        if begun is None or motion.keyframe_s != begun.keyframe_s:
            return motion
        back = np.linalg.inv(begun.keyframe_to_image)
        moved = motion.keyframe_to_image @ back
        by_now, by_begun = np.kron(np.eye(3), back.T), np.kron(moved, back.T)
        covariance = by_now @ motion.covariance @ by_now.T + by_begun @ begun.covariance @ by_begun.T
        size = float(np.linalg.norm(moved))
        return replace(
            motion, keyframe_to_image=moved / size, covariance=covariance / size**2, keyframe_s=self._begun_s
        )
