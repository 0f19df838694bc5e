"""How the picture of the ground moved since a keyframe, or why that is not known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.camera import Camera, RadialDistortion
from standoff.core.homography import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class NoCameraMotion:
    """How the picture moved is not known for this frame, and why. Falsy.

    Attributes:
        reason: A short clause, the same words for the same cause.
        broken: Whether the picture is another one than before (a cut, a zoom, another size, an earlier time), not
            only one in which too little could be followed.
    """

    reason: str
    broken: bool = False

    def __bool__(self) -> bool:
        return False


@dataclass(frozen=True, slots=True, eq=False)
class CameraMotion:
    """How the picture of the ground moved since a keyframe. Truthy.

    A frame's motion always refers to the keyframe that was in force when it came; where a frame becomes the new
    keyframe, the motion of the next frame is the first to refer to it. So a keyframe is always a frame before.

    Attributes:
        keyframe_to_image: (3, 3) signed homography of the ground's points from pixels of the keyframe to pixels of
            this frame; in both without the lens distortion where `camera` says so.
        covariance: (9, 9) of its entries, row by row, for the matrix as scaled here.
        keyframe_s: Presentation timestamp of the keyframe.
        camera: The lens whose distortion was removed from the points first; None: points as seen in the picture.
        repeated: True where this frame shows the same picture as the one before.
        distortion: Of the lens, by everything that was seen of the stream so far; None: it is known, or nothing tells.
    """

    keyframe_to_image: FloatArray
    covariance: FloatArray
    keyframe_s: float
    camera: Camera | None = None
    repeated: bool = False
    distortion: RadialDistortion | None = None

    def __post_init__(self) -> None:
        for name, shape in {"keyframe_to_image": (3, 3), "covariance": (9, 9)}.items():
            array = np.array(getattr(self, name), dtype=np.float64).reshape(shape)
            if not np.isfinite(array).all():
                raise ValueError(f"CameraMotion.{name} must be finite")
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __bool__(self) -> bool:
        return True
