"""The kinematics of a digging arm: joint angles to poses, and a place for the bucket's tip to joint angles.

Angles are elevations in the vertical plane of the boom, upwards positive: boom_deg of the line from boom foot to arm
pivot above the horizon, arm_deg of the arm against that line (0 stretched, negative folded in), bucket_deg of the line
from bucket pivot to tooth tip against the arm (negative curled in).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.machines.machine_parts import Point, strut_pose
from standoff_sim.solids.mesh import rotation, translation


def knee_m(start_m: FloatArray, end_m: FloatArray, first_m: float, second_m: float) -> FloatArray:
    """Return (3,) where two bars in an xz plane meet, on the left of the way from start to end (above, going along x).

    Args:
        start_m: (3,) pivot of the first bar.
        end_m: (3,) pivot of the second bar, same y.
        first_m: Length of the first bar.
        second_m: Length of the second bar.
    """
    span_m = float(np.linalg.norm(end_m - start_m))
    ahead = (end_m - start_m) / span_m
    along_m = (span_m**2 + first_m**2 - second_m**2) / (2.0 * span_m)
    beside_m = np.sqrt(max(first_m**2 - along_m**2, 0.0))
    knee: FloatArray = start_m + along_m * ahead + beside_m * np.array([-ahead[2], 0.0, ahead[0]])
    return knee


class Link(Enum):
    """The rigid links of an excavator, each with its frame."""

    UNDERCARRIAGE = "undercarriage"
    """The model's local frame."""
    UPPER = "upper"
    """Turns about the swing axis; origin on the ground under it."""
    BOOM = "boom"
    """Origin at the boom foot, x to the arm's pivot."""
    ARM = "arm"
    """Origin at the arm's pivot, x to the bucket's pivot."""
    BUCKET = "bucket"
    """Origin at the bucket's pivot, x to the tooth tips."""
    ROCKER = "rocker"
    """Origin at its pivot on the arm, x to the end of the bucket cylinder's rod."""
    TIE = "tie"
    """Origin at the end of the bucket cylinder's rod, x to the bucket's ear."""


@dataclass(frozen=True, slots=True)
class DiggingArm:
    """Lengths and pivots of one machine, metres.

    Attributes:
        swing_xy_m: The swing axis in the undercarriage's frame.
        foot_m: Boom foot in the upper structure's frame.
        boom_m: Boom foot to arm pivot.
        arm_m: Arm pivot to bucket pivot.
        bucket_m: Bucket pivot to tooth tip.
        rocker_xz_m: Pivot of the rocker, arm's frame.
        rocker_m: Length of the rocker.
        tie_m: Length of the tie.
        ear_xz_m: Where the tie holds the bucket, bucket's frame.
        arm_y_m: Sideways offset of the arm against the boom.
        bucket_y_m: Sideways offset of the bucket against the arm.
    """

    swing_xy_m: tuple[float, float]
    foot_m: Point
    boom_m: float
    arm_m: float
    bucket_m: float
    rocker_xz_m: tuple[float, float]
    rocker_m: float
    tie_m: float
    ear_xz_m: tuple[float, float]
    arm_y_m: float = 0.0
    bucket_y_m: float = 0.0

    def frames(self, joints: Mapping[str, float]) -> dict[Link, FloatArray]:
        """Return the (4, 4) pose of every link in the undercarriage's frame."""
        upper = translation(*self.swing_xy_m, 0.0) @ rotation("z", joints["swing_deg"])
        boom = upper @ translation(*self.foot_m) @ rotation("y", -joints["boom_deg"])
        arm = boom @ translation(self.boom_m, self.arm_y_m, 0.0) @ rotation("y", -joints["arm_deg"])
        to_bucket = translation(self.arm_m, self.bucket_y_m, 0.0) @ rotation("y", -joints["bucket_deg"])
        pivot, joint, ear = self._bucket_linkage(to_bucket)
        return {
            Link.UNDERCARRIAGE: np.eye(4),
            Link.UPPER: upper,
            Link.BOOM: boom,
            Link.ARM: arm,
            Link.BUCKET: arm @ to_bucket,
            Link.ROCKER: arm @ strut_pose(pivot, joint),
            Link.TIE: arm @ strut_pose(joint, ear),
        }

    def _bucket_linkage(self, bucket_to_arm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return rocker pivot, rod end and ear, (3,) each in the arm's frame."""
        y_m = self.bucket_y_m
        pivot = np.array([self.rocker_xz_m[0], y_m, self.rocker_xz_m[1]])
        ear = (bucket_to_arm @ [self.ear_xz_m[0], 0.0, self.ear_xz_m[1], 1.0])[:3]
        joint = knee_m(pivot, ear, self.rocker_m, self.tie_m)
        return pivot, joint, ear

    def tip_m(self, joints: Mapping[str, float]) -> FloatArray:
        """Return (3,) of the tooth tips' middle in the undercarriage's frame."""
        tip: FloatArray = (self.frames(joints)[Link.BUCKET] @ [self.bucket_m, 0.0, 0.0, 1.0])[:3]
        return tip

    def solve(self, radius_m: float, height_m: float, attitude_deg: float) -> dict[str, float]:
        """Return boom_deg, arm_deg and bucket_deg that bring the tip to a place in the boom's plane, elbow up.

        Args:
            radius_m: From the swing axis, along the boom's direction.
            height_m: Above the ground the machine stands on.
            attitude_deg: Elevation of the line from bucket pivot to tip: -90 straight down, -180 towards the machine.

        Raises:
            ValueError: The place is too far or too near for the arm's lengths.
        """
        attitude = np.deg2rad(attitude_deg)
        x_m = radius_m - self.bucket_m * np.cos(attitude) - self.foot_m[0]
        z_m = height_m - self.bucket_m * np.sin(attitude) - self.foot_m[2]
        span_m = float(np.hypot(x_m, z_m))
        if not abs(self.boom_m - self.arm_m) < span_m < self.boom_m + self.arm_m:
            raise ValueError(f"radius {radius_m:.2f} m, height {height_m:.2f} m is out of the arm's reach")
        at_foot = (span_m**2 + self.boom_m**2 - self.arm_m**2) / (2.0 * span_m * self.boom_m)
        at_elbow = (self.boom_m**2 + self.arm_m**2 - span_m**2) / (2.0 * self.boom_m * self.arm_m)
        boom_deg = float(np.rad2deg(np.arctan2(z_m, x_m) + np.arccos(at_foot)))
        arm_deg = float(np.rad2deg(np.arccos(at_elbow))) - 180.0
        bucket_deg = (attitude_deg - boom_deg - arm_deg + 180.0) % 360.0 - 180.0
        return {"boom_deg": boom_deg, "arm_deg": arm_deg, "bucket_deg": bucket_deg}
