"""Meshes of rollers, in the frame of the straight machine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from standoff_sim.machines.machine_parts import beacon, cab, exhaust, grille, handrail, hull, ladder, lamp
from standoff_sim.machines.paint import BLACK, DARK_GREY, STEEL
from standoff_sim.solids.bars import bars
from standoff_sim.solids.mesh import Mesh, Surface, box, cylinder, join, profile, rotation, srgb, translation


@dataclass(frozen=True, slots=True)
class RollerPlan:
    """Lengths of a roller, metres.

    Attributes:
        length_m: Over all.
        width_m: Over all.
        drum_m: Radius of the drums.
        drum_width_m: Their length along the axle.
        front_x_m: x of the front drum's axle.
        rear_x_m: x of the rear axle.
        joint_x_m: x of the joint between the halves.
    """

    length_m: float
    width_m: float
    drum_m: float
    drum_width_m: float
    front_x_m: float
    rear_x_m: float
    joint_x_m: float


SINGLE_DRUM = RollerPlan(5.8, 2.28, 0.77, 2.1, 1.95, -1.15, 0.55)
TANDEM = RollerPlan(4.5, 1.9, 0.62, 1.7, 1.6, -1.6, 0.0)
REAR_WHEEL_M = 0.72
_SEAT = srgb("#20201f")


@lru_cache(maxsize=4)
def drum(plan: RollerPlan, *, padded: bool) -> Mesh:
    """Return a drum that rolls about y, centred at the origin; recessed ends with bolts show how it turns."""
    radius_m, width_m = plan.drum_m, plan.drum_width_m
    core_m = 0.92 * radius_m if padded else radius_m
    shell = cylinder(core_m, width_m, None, Surface.STEEL, axis="y", sections=32)
    ends = cylinder(0.82 * core_m, width_m + 0.01, DARK_GREY, Surface.PAINT, axis="y", sections=20)
    hub = cylinder(0.28 * radius_m, width_m + 0.06, STEEL, axis="y", sections=12)
    bolt = cylinder(0.05, width_m + 0.05, BLACK, axis="y", sections=6)
    bolts = [bolt.moved(rotation("y", 60.0 * k) @ translation(0.6 * radius_m, 0.0, 0.0)) for k in range(6)]
    return join([shell, ends, hub, *bolts, *(_pads(plan) if padded else [])])


def _pads(plan: RollerPlan) -> list[Mesh]:
    pad = box((0.14, 0.16, 0.1 * plan.drum_m), None, Surface.STEEL)
    rows = np.linspace(-0.44, 0.44, 9) * plan.drum_width_m
    return [
        pad.moved(rotation("y", 30.0 * k + 15.0 * (row % 2)) @ translation(0.0, y_m, 0.9 * plan.drum_m))
        for row, y_m in enumerate(rows)
        for k in range(12)
    ]


@lru_cache(maxsize=4)
def drum_frame(plan: RollerPlan, *, front: bool) -> Mesh:
    """Return the yoke that holds a drum, from the joint around it, with scrapers."""
    sign = 1.0 if front else -1.0
    axle_x, end_x = (plan.front_x_m if front else plan.rear_x_m), sign * plan.length_m / 2
    half_y = plan.width_m / 2 - 0.06
    level_m = plan.drum_m + 0.02
    near_x = axle_x - sign * (plan.drum_m + 0.12)
    cheeks = [((near_x, s * half_y, level_m), (end_x, s * half_y, level_m)) for s in (-1, 1)]
    cross = [((x, -half_y, level_m), (x, half_y, level_m)) for x in (near_x, end_x - sign * 0.07)]
    holders = [box((0.5, 0.1, 0.45), None).at(axle_x, s * (half_y - 0.02), plan.drum_m - 0.3) for s in (-1, 1)]
    neck_m = abs(near_x - plan.joint_x_m)
    neck = box((neck_m + 0.1, 0.8, 0.5), None).at((near_x + plan.joint_x_m) / 2, 0.0, plan.drum_m - 0.25)
    scraper = box((0.05, 2 * half_y - 0.1, 0.25), DARK_GREY, Surface.STEEL)
    return join(
        [
            bars(np.array(cheeks), 0.12, None, Surface.PAINT, depth_m=0.3),
            bars(np.array(cross), 0.14, None, Surface.PAINT, depth_m=0.28),
            *holders,
            neck,
            scraper.at(end_x - sign * 0.2, 0.0, plan.drum_m - 0.1),
            *(
                lamp(0.12).moved(translation(end_x, y, level_m + 0.2) @ rotation("z", 0.0 if front else 180.0))
                for y in (-0.7, 0.7)
            ),
        ]
    )


@lru_cache(maxsize=2)
def single_rear(open_cab: bool) -> Mesh:
    """Return the rear body of a single-drum roller: hood over the engine, platform, cab or roof on posts."""
    hood = hull(
        [
            (x, s * half, z)
            for x, half, z in ((-0.75, 0.62, 1.85), (-0.75, 0.66, 0.9), (-2.75, 0.5, 1.5), (-2.85, 0.58, 0.85))
            for s in (-1, 1)
        ],
        None,
    )
    guards = [
        profile(
            [(-1.75, 1.2), (-1.5, 1.55), (-0.75, 1.55), (-0.45, 1.15), (-0.5, 1.1), (-0.8, 1.47), (-1.45, 1.47)],
            0.6,
            None,
        ).at(0.0, s * 0.78, 0.0)
        for s in (-1, 1)
    ]
    return join(
        [
            hood,
            *guards,
            box((1.4, 1.7, 0.12), DARK_GREY, Surface.STEEL).at(-0.1, 0.0, 1.15),
            *_driver(-0.05, 1.27, 1.55, 1.55, open_cab),
            grille(0.8, 0.4).moved(rotation("z", 90.0)).at(-2.84, 0.0, 1.2),
            exhaust(0.7).at(-1.4, 0.42, 1.7),
            ladder((0.1, 0.95, 0.5), 0.7, 0.4, BLACK),
            handrail([(0.55, 0.82, 2.05), (-0.7, 0.82, 2.05)], BLACK, floor_m=1.27),
        ]
    )


@lru_cache(maxsize=1)
def single_rear_frame() -> Mesh:
    """Return the chassis under the rear body."""
    return join(
        [
            box((2.6, 0.85, 0.45), None).at(-1.05, 0.0, 0.62),
            box((0.9, 0.5, 0.4), None).at(0.5, 0.0, 0.65),
            cylinder(0.16, 1.3, STEEL, axis="y", sections=10).at(SINGLE_DRUM.rear_x_m, 0.0, REAR_WHEEL_M),
            box((0.25, 1.5, 0.35), None).at(-2.75, 0.0, 0.55),
        ]
    )


@lru_cache(maxsize=1)
def tandem_front() -> Mesh:
    """Return the front body of a tandem roller: water tank over the drum and engine hood."""
    tank = hull(
        [
            (x, s * half, z)
            for x, half, z in ((0.35, 0.72, 1.6), (0.35, 0.75, 0.95), (2.1, 0.6, 1.35), (2.2, 0.68, 0.95))
            for s in (-1, 1)
        ],
        None,
    )
    cap = cylinder(0.09, 0.06, BLACK, sections=8).at(1.7, 0.3, 1.47)
    return join([tank, cap, grille(0.8, 0.25).moved(rotation("z", -90.0)).at(2.18, 0.0, 1.15)])


@lru_cache(maxsize=2)
def tandem_rear(open_cab: bool) -> Mesh:
    """Return the rear body of a tandem roller: platform, seat, cab or folding roof, tank behind."""
    tank = hull(
        [
            (x, s * half, z)
            for x, half, z in ((-1.1, 0.72, 1.45), (-1.1, 0.74, 0.95), (-2.1, 0.62, 1.35), (-2.2, 0.68, 0.95))
            for s in (-1, 1)
        ],
        None,
    )
    deck = box((1.4, 1.6, 0.15), DARK_GREY, Surface.STEEL).at(-0.5, 0.0, 0.9)
    rails = [handrail([(0.1, s * 0.75, 1.75), (-1.05, s * 0.75, 1.75)], BLACK, floor_m=1.05) for s in (-1, 1)]
    return join([tank, deck, *rails, *_driver(-0.5, 1.05, 1.35, 1.5, open_cab)])


def _driver(x_m: float, floor_m: float, length_m: float, width_m: float, open_cab: bool) -> list[Mesh]:
    if not open_cab:
        cabin = cab(length_m, width_m, 1.65, slant_m=0.08, sill=0.25).at(x_m, 0.0, floor_m)
        return [cabin, beacon().at(x_m - 0.4, 0.5, floor_m + 1.65)]
    half_x, half_y, top_m = length_m / 2 - 0.1, width_m / 2 - 0.08, floor_m + 1.75
    posts = [
        ((x_m + sx * half_x, sy * half_y, floor_m), (x_m + 0.9 * sx * half_x, sy * half_y, top_m))
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    return [
        bars(np.array(posts), 0.08, None, Surface.PAINT),
        box((length_m + 0.2, width_m + 0.05, 0.09), None).at(x_m, 0.0, top_m),
        box((0.5, 0.5, 0.3), _SEAT, Surface.PLASTIC).at(x_m - 0.25, 0.0, floor_m + 0.2),
        box((0.15, 0.5, 0.6), _SEAT, Surface.PLASTIC).at(x_m - 0.5, 0.0, floor_m + 0.45),
        box((0.3, 0.5, 0.75), BLACK, Surface.PLASTIC).at(x_m + 0.45, 0.0, floor_m),
        cylinder(0.2, 0.03, BLACK, Surface.PLASTIC, sections=12).moved(
            translation(x_m + 0.25, 0.0, floor_m + 0.85) @ rotation("y", -35.0)
        ),
        beacon().at(x_m, 0.4, top_m + 0.09),
    ]
