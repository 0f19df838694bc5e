"""Bodies of cars, vans and pickups: a lofted lower body, a glass house on it, lamps, mirrors, bumpers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.machines.machine_parts import beam, hull
from standoff_sim.machines.paint import BLACK, GLASS, LAMP, RED_LAMP, STEEL
from standoff_sim.solids.bars import grid
from standoff_sim.solids.mesh import Mesh, Surface, ball, box, cylinder, join, srgb


@dataclass(frozen=True, slots=True)
class CarPlan:
    """Shape of one type of car, metres, x from the middle.

    Attributes:
        length_m: Over all.
        width_m: Without mirrors.
        height_m: Over all.
        axles_m: x of front and rear axle.
        wheel_m: Radius of the tyres.
        hood_m: Height of bonnet over the front axle and of the waist behind it.
        tail_m: Height of the boot lid or the bed's side.
        waist_x_m: x of the foot of the windscreen and of the rear window.
        roof_x_m: x of the front and rear edge of the roof.
        roof_share: Width of the roof as a share of the car's.
        side_glass: Whether windows run on behind the front doors.
    """

    length_m: float
    width_m: float
    height_m: float
    axles_m: tuple[float, float]
    wheel_m: float
    hood_m: float
    tail_m: float
    waist_x_m: tuple[float, float]
    roof_x_m: tuple[float, float]
    roof_share: float = 0.72
    side_glass: bool = True


SEDAN = CarPlan(4.7, 1.82, 1.46, (1.4, -1.35), 0.33, 0.88, 0.98, (0.95, -1.75), (0.25, -1.05))
HATCHBACK = CarPlan(4.15, 1.76, 1.48, (1.28, -1.27), 0.32, 0.9, 0.96, (0.85, -2.0), (0.2, -1.5))
ESTATE = CarPlan(4.75, 1.82, 1.5, (1.42, -1.35), 0.33, 0.9, 0.98, (0.95, -2.3), (0.25, -1.95))
SUV = CarPlan(4.6, 1.88, 1.74, (1.38, -1.32), 0.37, 1.06, 1.1, (0.9, -2.2), (0.3, -1.85), 0.76)
VAN = CarPlan(5.5, 2.0, 2.28, (1.85, -1.7), 0.36, 1.12, 1.2, (1.85, -2.72), (1.05, -2.68), 0.9, False)
SMALL_VAN = CarPlan(4.5, 1.85, 1.85, (1.38, -1.4), 0.33, 1.02, 1.1, (1.15, -2.2), (0.55, -2.15), 0.86, False)
MINIBUS = CarPlan(5.3, 1.98, 1.98, (1.75, -1.5), 0.35, 1.1, 1.12, (1.8, -2.6), (1.0, -2.5), 0.86)
PICKUP = CarPlan(5.3, 1.88, 1.8, (1.62, -1.55), 0.39, 1.08, 1.08, (1.0, -0.85), (0.45, -0.65), 0.76)


@lru_cache(maxsize=16)
def car_body(plan: CarPlan, extras: int = 0) -> Mesh:
    """Return a body in the tint's colour on z = 0, without wheels; `extras` 1: roof rack or ladder, 2: light bar."""
    parts = [_lower_body(plan), *_glass_house(plan), *_arches(plan), *_details(plan)]
    if plan is PICKUP:
        parts += _load_bed(plan)
    front, rear = plan.roof_x_m
    if extras == 1:
        rails = [
            beam((front - 0.2, y, plan.height_m + 0.08), (rear + 0.1, y, plan.height_m + 0.08), (0.05, 0.05), STEEL)
            for y in (-0.5, -0.1, 0.5)
        ]
        cross = [
            box((0.05, 1.25, 0.07), BLACK).at(x, 0.0, plan.height_m) for x in np.linspace(front - 0.3, rear + 0.2, 4)
        ]
        parts += [*rails, *cross]
    if extras == 2:
        parts.append(box((0.25, 1.1, 0.1), srgb("#e07a10"), Surface.PLASTIC).at(front - 0.4, 0.0, plan.height_m))
    return join(parts)


def _lower_body(plan: CarPlan) -> Mesh:
    half_x, half_y = plan.length_m / 2, plan.width_m / 2
    waist_x, back_x = plan.waist_x_m
    x_m = np.array(
        [
            half_x,
            half_x - 0.03,
            half_x - 0.2,
            plan.axles_m[0] + 0.1,
            waist_x + 0.05,
            waist_x - 0.6,
            back_x + 0.2,
            -half_x + 0.2,
            -half_x + 0.03,
            -half_x,
        ]
    )
    x_m = np.minimum.accumulate(x_m)
    top_m = np.array(
        [
            0.45,
            0.8 * plan.hood_m,
            plan.hood_m - 0.1,
            plan.hood_m,
            plan.hood_m + 0.07,
            plan.tail_m,
            plan.tail_m,
            plan.tail_m - 0.03,
            plan.tail_m - 0.15,
            0.5,
        ]
    )
    wide = np.array([0.02, 0.84, 0.93, 0.99, 1.0, 1.0, 1.0, 0.95, 0.88, 0.02])
    low_m = np.array([0.42, 0.26, 0.22, 0.22, 0.22, 0.22, 0.22, 0.24, 0.28, 0.46])
    half = np.array([(0.9, 0.0), (0.985, 0.3), (1.0, 0.6), (0.97, 0.86), (0.9, 0.96), (0.6, 1.0), (0.0, 1.015)])
    contour = np.concatenate([half * [-1, 1], half[-2::-1]])
    y_m = contour[:, None, 0] * (half_y * wide)[None]
    z_m = low_m[None] + contour[:, None, 1] * (top_m - low_m)[None]
    points = np.stack([np.broadcast_to(x_m, y_m.shape), y_m, z_m], axis=-1)[:, ::-1]
    return grid(points, None, Surface.PAINT)


def _glass_house(plan: CarPlan) -> list[Mesh]:
    (front, back), (roof_front, roof_back) = plan.waist_x_m, plan.roof_x_m
    waist_m, eaves_m = plan.hood_m - 0.02, plan.height_m - 0.06
    half_low, half_high = 0.455 * plan.width_m, plan.roof_share * plan.width_m / 2
    low = [(x, s * half_low, waist_m) for x in (front, back) for s in (-1, 1)]
    high = [(x, s * half_high, eaves_m) for x in (roof_front, roof_back) for s in (-1, 1)]
    parts = [hull([*low, *high], GLASS, Surface.GLASS)]
    crown = [(0.96 * x, 0.88 * y, plan.height_m) for x, y, _ in high]
    parts.append(hull([*((x, 1.015 * y, z - 0.02) for x, y, z in high), *crown], None))
    pillars = [(low[k], high[k], 0.07) for k in range(4)]
    door_x = front - 0.4 * (front - back) if plan.side_glass else front - 1.05
    for sign in (-1.0, 1.0):
        top_x = min(door_x, roof_front - 0.1)
        pillars.append(((door_x, sign * half_low, waist_m), (top_x, sign * half_high, eaves_m), 0.08))
    parts += [beam(foot, head, (0.05, size), None) for foot, head, size in pillars]
    if not plan.side_glass:
        panel_x = front - 1.05
        panel = [(x, 1.02 * y, z) for x, y, z in low if x == back] + [
            (x, 1.02 * y, z) for x, y, z in high if x == roof_back
        ]
        panel += [(panel_x, s * 1.02 * half_low, waist_m) for s in (-1, 1)]
        panel += [(min(panel_x, roof_front), s * 1.02 * half_high, eaves_m) for s in (-1, 1)]
        parts.append(hull([(x - 0.01 if x < panel_x - 0.1 else x, y, z) for x, y, z in panel], None))
    return parts


def _arches(plan: CarPlan) -> list[Mesh]:
    dark = srgb("#121212")
    arch = cylinder(plan.wheel_m + 0.05, 0.3, dark, Surface.PLASTIC, axis="y", sections=14)
    reach_m = plan.width_m / 2 - 0.154
    return [arch.at(x, s * reach_m, plan.wheel_m + 0.06) for x in plan.axles_m for s in (-1.0, 1.0)]


def _details(plan: CarPlan) -> list[Mesh]:
    half_x, half_y = plan.length_m / 2, plan.width_m / 2
    lamp = ball((0.12, 0.17, 0.07), LAMP, Surface.GLASS, detail=1)
    tail = box((0.08, 0.3, 0.16), RED_LAMP, Surface.PLASTIC)
    parts = [lamp.at(half_x - 0.1, s * 0.7 * half_y, 0.74 * plan.hood_m) for s in (-1, 1)]
    parts += [tail.at(-half_x + 0.04, s * 0.72 * half_y, plan.tail_m - 0.35) for s in (-1, 1)]
    mirror = box((0.12, 0.2, 0.14), None)
    parts += [mirror.at(plan.waist_x_m[0] - 0.35, s * (half_y + 0.08), plan.hood_m) for s in (-1, 1)]
    parts.append(box((0.1, 1.0, 0.22), BLACK, Surface.PLASTIC).at(half_x - 0.06, 0.0, 0.34))
    parts.append(box((0.06, 1.1, 0.16), BLACK, Surface.PLASTIC).at(-half_x + 0.02, 0.0, 0.34))
    parts += [box((0.03, 0.5, 0.11), (0.62, 0.62, 0.6)).at(sign * (half_x + 0.0), 0.0, 0.5) for sign in (-1, 1)]
    return parts


def _load_bed(plan: CarPlan) -> list[Mesh]:
    rear, front = -plan.length_m / 2 + 0.08, plan.waist_x_m[1] - 0.05
    middle, length = (rear + front) / 2, front - rear
    walls = [box((length, 0.07, 0.06), None).at(middle, s * 0.84, plan.tail_m) for s in (-1, 1)]
    return [
        box((length - 0.1, 1.5, 0.02), srgb("#1d1d1d"), Surface.PLASTIC).at(middle, 0.0, plan.tail_m + 0.012),
        box((0.08, 1.6, 0.06), None).at(rear, 0.0, plan.tail_m),
        *walls,
        box((0.05, 1.4, 0.45), BLACK, Surface.STEEL).at(front - 0.05, 0.0, plan.tail_m),
    ]


def wheel_places(plan: CarPlan) -> FloatArray:
    """Return (4, 3) wheel centres, front right first."""
    y_m = plan.width_m / 2 - 0.06
    return np.array([[x, s * y_m, plan.wheel_m] for x in plan.axles_m for s in (-1.0, 1.0)])
