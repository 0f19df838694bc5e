"""How the picture of the ground moved since a keyframe: `Frame` to `CameraMotion`."""

from standoff.stages.motion.estimator import MotionEstimator
from standoff.stages.motion.params import MotionParams

__all__ = ["MotionEstimator", "MotionParams"]
