"""How long the parts of a body are.

Ratios to stature after Drillis and Contini, "Body segment parameters" (New York University, 1966), as in Winter,
"Biomechanics and Motor Control of Human Movement", figure 4.1. Hip joints stand closer than the hips are wide and
shoulder joints closer than the shoulders: both are set so that the flesh around them gives the published breadths
(hips 0.191, shoulders 0.259 of the stature).
"""

from __future__ import annotations

from dataclasses import dataclass

THIGH = 0.245
SHANK = 0.246
ANKLE_HEIGHT = 0.039
UPPER_ARM = 0.186
FOREARM = 0.146
HIP_HEIGHT = 0.530
WAIST_HEIGHT = 0.600
SHOULDER_HEIGHT = 0.818
HEAD_PIVOT_HEIGHT = 0.880
HIP_JOINT_Y = 0.050
SHOULDER_JOINT_Y = 0.100
REFERENCE_STATURE_M = 1.75
"""All body meshes are modelled at this stature and scaled by the pose."""

MEAN_STATURE_M = 1.75
"""Of the workers of a site, barefoot, unless somebody wants others."""


@dataclass(frozen=True, slots=True)
class Body:
    """One person's size.

    Attributes:
        stature_m: Barefoot, without a hat.
        girth: Thickness of limbs and trunk relative to an average build.
        leg_share: Leg length relative to the average for this stature; the trunk makes up for it.
    """

    stature_m: float
    girth: float = 1.0
    leg_share: float = 1.0

    @property
    def scale(self) -> float:
        """Return the factor from the modelled stature to this one."""
        return self.stature_m / REFERENCE_STATURE_M

    @property
    def thigh_m(self) -> float:
        """Return the distance from hip to knee."""
        return THIGH * self.leg_share * self.stature_m

    @property
    def shank_m(self) -> float:
        """Return the distance from knee to ankle."""
        return SHANK * self.leg_share * self.stature_m

    @property
    def upper_arm_m(self) -> float:
        """Return the distance from shoulder to elbow."""
        return UPPER_ARM * self.stature_m

    @property
    def forearm_m(self) -> float:
        """Return the distance from elbow to wrist."""
        return FOREARM * self.stature_m

    @property
    def trunk_share(self) -> float:
        """Return the trunk's and head's length relative to the average for this stature.

        >>> round(Body(1.75, leg_share=1.02).trunk_share, 4)
        0.9791
        """
        return (1.0 - ANKLE_HEIGHT - (THIGH + SHANK) * self.leg_share) / (1.0 - HIP_HEIGHT)
