"""How the picture of the ground moved from one frame to the next, read off two frames' camera motions."""

from __future__ import annotations

import numpy as np

from standoff.core import homography
from standoff.core.homography import FloatArray
from standoff.core.types import CameraMotion, NoCameraMotion


def picture_step(
    before: CameraMotion | NoCameraMotion, before_s: float, now: CameraMotion | NoCameraMotion
) -> FloatArray | None:
    """Return the homography of the ground's points from the frame before to this one.

    Either both refer to the same keyframe, or the frame before became the keyframe, which is how every change of the
    keyframe looks; anything else (a first frame, the first two frames after a loss) leaves it unknown.

    Args:
        before: The motion of the frame before, whichever it was.
        before_s: Presentation timestamp of the frame before.
        now: The motion of this frame.

    Returns:
        (3, 3) signed, pixels to pixels, in both without lens distortion where `now.camera` says so; None if unknown.

    >>> still = CameraMotion(np.eye(3), np.zeros((9, 9)), keyframe_s=0.0)
    >>> shift = np.array([[1.0, 0.0, 5.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    >>> moved = CameraMotion(shift, np.zeros((9, 9)), keyframe_s=0.0)
    >>> picture_step(moved, 0.1, CameraMotion(shift @ shift, np.zeros((9, 9)), keyframe_s=0.0)).round(6).tolist()
    [[1.0, 0.0, 5.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    >>> picture_step(NoCameraMotion("the picture was cut"), 0.1, still) is None
    True
    """
    if not isinstance(now, CameraMotion):
        return None
    if now.keyframe_s == before_s:
        return now.keyframe_to_image
    if not isinstance(before, CameraMotion) or before.keyframe_s != now.keyframe_s:
        return None
    try:
        back = homography.invert(before.keyframe_to_image)
    except np.linalg.LinAlgError:
        return None
    return now.keyframe_to_image @ back
