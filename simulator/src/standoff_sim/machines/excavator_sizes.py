"""The excavators that sites have: 8 t to 40 t, short and long tails, a long reach, two on wheels."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ExcavatorSize:
    """Main dimensions of one type, metres; of the sort makers print in brochures.

    Attributes:
        share: How often it is met, relative.
        boom_m: Boom foot to arm pivot.
        arm_m: Arm pivot to bucket pivot.
        bucket_m: Bucket pivot to tooth tip.
        bucket_width_m: Over the side plates.
        base_m: Length of the crawlers, or of the wheels' outline.
        gear_m: Height of the crawlers, or diameter of the wheels.
        shoe_m: Width of a crawler or of a pair of tyres.
        width_m: Over crawlers or tyres.
        tail_m: Swing radius of the counterweight.
        half_m: Half the width of the upper structure.
        deck_m: Underside of the upper structure above the ground.
        hood_m: Top of the engine hood above the ground.
        cab_m: Top of the cab above the ground.
        rounded: Soft edges and a counterweight that follows the swing circle.
        railed: Guard rails on the hood.
        wheeled: On four pairs of tyres.
        bladed: A dozer blade in front.
        grading: A wide bucket without teeth.
    """

    share: float
    boom_m: float
    arm_m: float
    bucket_m: float
    bucket_width_m: float
    base_m: float
    gear_m: float
    shoe_m: float
    width_m: float
    tail_m: float
    half_m: float
    deck_m: float
    hood_m: float
    cab_m: float
    rounded: bool = False
    railed: bool = False
    wheeled: bool = False
    bladed: bool = False
    grading: bool = False

    @property
    def cab_front_m(self) -> float:
        """Return x of the windscreen's foot."""
        return 0.32 * self.base_m

    @property
    def cab_length_m(self) -> float:
        """Return the cab's length."""
        return min(1.75, 0.5 * self.base_m)

    @property
    def boom_width_m(self) -> float:
        """Return the width of the boom's box section."""
        return 0.19 + 0.065 * min(self.boom_m, 6.5)


SIZES: tuple[ExcavatorSize, ...] = (
    # 8 t, short tail, blade
    ExcavatorSize(0.8, 3.7, 1.8, 1.15, 0.8, 2.9, 0.68, 0.45, 2.3, 1.5, 1.1, 0.78, 1.62, 2.6, rounded=True, bladed=True),
    # 13 t, short tail
    ExcavatorSize(1.0, 4.6, 2.4, 1.3, 1.0, 3.6, 0.8, 0.5, 2.5, 1.65, 1.23, 0.9, 1.9, 2.82, rounded=True),
    # 15 t
    ExcavatorSize(1.0, 4.7, 2.5, 1.35, 1.0, 3.75, 0.85, 0.5, 2.55, 2.2, 1.24, 0.95, 1.9, 2.85),
    # 21 t
    ExcavatorSize(2.0, 5.7, 2.9, 1.5, 1.2, 4.45, 0.95, 0.6, 2.8, 2.75, 1.35, 1.05, 2.1, 2.95),
    # 22 t with rails
    ExcavatorSize(1.8, 5.7, 2.9, 1.5, 1.3, 4.3, 0.95, 0.6, 3.0, 2.8, 1.36, 1.06, 2.15, 3.0, rounded=True, railed=True),
    # 23 t, short tail, grading bucket
    ExcavatorSize(
        0.7, 5.6, 2.9, 1.25, 1.9, 4.4, 0.95, 0.6, 3.0, 1.95, 1.42, 1.06, 2.2, 3.05, rounded=True, grading=True
    ),
    # 30 t
    ExcavatorSize(1.0, 6.2, 3.0, 1.65, 1.5, 4.9, 1.05, 0.6, 3.2, 3.05, 1.45, 1.17, 2.35, 3.12, railed=True),
    # 36 t
    ExcavatorSize(0.7, 6.45, 3.1, 1.72, 1.6, 5.0, 1.1, 0.6, 3.3, 3.3, 1.5, 1.2, 2.5, 3.2, rounded=True, railed=True),
    # 40 t
    ExcavatorSize(0.4, 6.5, 2.9, 1.8, 1.8, 5.1, 1.15, 0.65, 3.45, 3.5, 1.6, 1.25, 2.6, 3.3, railed=True),
    # 23 t, long reach
    ExcavatorSize(0.3, 7.6, 5.4, 1.15, 0.9, 4.65, 0.98, 0.7, 3.1, 2.9, 1.36, 1.08, 2.15, 3.0, rounded=True),
    # 15 t on wheels
    ExcavatorSize(0.6, 4.6, 2.3, 1.3, 1.0, 3.65, 0.98, 0.5, 2.5, 1.95, 1.23, 1.2, 2.15, 3.1,
                  rounded=True, wheeled=True, bladed=True),
    # 18 t on wheels
    ExcavatorSize(0.6, 5.2, 2.5, 1.4, 1.1, 3.85, 1.06, 0.55, 2.55, 2.35, 1.25, 1.25, 2.25, 3.18,
                  wheeled=True, railed=True),
)  # fmt: skip
