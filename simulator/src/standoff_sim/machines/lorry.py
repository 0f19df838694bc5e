"""What road lorries share: cab, chassis, and the wheels under them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from standoff_sim.machines.machine_parts import beacon, cab, hull, mirror
from standoff_sim.machines.paint import BLACK, DARK_GREY, GLASS, LAMP, RED_LAMP, STEEL, Painted, weather
from standoff_sim.machines.road_wheels import RoadWheels, axle_places, road_wheel
from standoff_sim.scene.scene import Batch
from standoff_sim.solids.bars import bars
from standoff_sim.solids.mesh import Mesh, Surface, box, cylinder, join, profile, srgb

WIDTH_M = 2.5
WHEEL_RADIUS_M = 0.5
FRAME_TOP_M = 1.05
_CAB_LENGTH_M = 2.1
_CAB_PAINTS = tuple(
    srgb(code)
    for code in (
        "#d9d9d5",
        "#dcdcd8",
        "#c9cbc9",
        "#a5231c",
        "#b8401c",
        "#1f4f96",
        "#d8a020",
        "#e07018",
        "#2f6a48",
        "#8f9397",
        "#6fa0b8",
        "#26303a",
    )
)
_WHEEL_PAINTS = (srgb("#8f9090"), srgb("#5b5c5d"), srgb("#c9cac8"), srgb("#8a2a20"))


@dataclass(frozen=True, slots=True)
class LorryPlan:
    """Lengths of a lorry, metres; x counts from its front bumper backwards.

    Attributes:
        length_m: Over all.
        front_axles_m: Steered axles.
        rear_axles_m: Driven axles, with twin tyres.
    """

    length_m: float
    front_axles_m: tuple[float, ...]
    rear_axles_m: tuple[float, ...]

    @property
    def front_m(self) -> float:
        """Local x of the front bumper."""
        return self.length_m / 2

    @property
    def deck_m(self) -> tuple[float, float]:
        """Local x of the rear and front end of what lies behind the cab."""
        return -self.length_m / 2, self.front_m - _CAB_LENGTH_M - 0.35


THREE_AXLES = LorryPlan(7.9, (1.35,), (5.1, 6.45))
FOUR_AXLES = LorryPlan(8.9, (1.3, 3.1), (6.15, 7.5))
TWO_AXLES = LorryPlan(7.0, (1.3,), (5.2,))


@dataclass(frozen=True, slots=True, eq=False)
class Lorry:
    """Cab, chassis and wheels of one lorry.

    Attributes:
        plan: Its lengths.
        height_m: Of the cab, beacons and deflector included.
        cab: Painted cab.
        chassis: Frame, tanks, mudguards.
        wheels: Front and rear ones.
    """

    plan: LorryPlan
    height_m: float
    cab: Painted
    chassis: Painted
    wheels: tuple[RoadWheels, ...]

    def batches(self, travel_m: float, steer_deg: float) -> tuple[Batch, ...]:
        """Return all of it."""
        rolling = tuple(wheels.batch(travel_m, steer_deg) for wheels in self.wheels)
        return (self.cab.at(np.eye(4)), self.chassis.at(np.eye(4)), *rolling)


def make_lorry(rng: np.random.Generator, plan: LorryPlan) -> Lorry:
    """Draw a lorry's cab, colours and dirt."""
    paint = weather(rng, _CAB_PAINTS[int(rng.integers(len(_CAB_PAINTS)))], 0.7)
    dust = float(rng.uniform(0.1, 0.75))
    rims = _WHEEL_PAINTS[int(rng.integers(len(_WHEEL_PAINTS)))]
    frame = weather(rng, srgb(str(rng.choice(["#2b2c2d", "#3a3632", "#6a2a20"]))))
    single, twin = road_wheel(WHEEL_RADIUS_M, 0.32), road_wheel(WHEEL_RADIUS_M, 0.58)
    front_x = tuple(plan.front_m - x for x in plan.front_axles_m)
    rear_x = tuple(plan.front_m - x for x in plan.rear_axles_m)
    share = np.repeat([1.0, 0.7][: len(front_x)], 2)
    cab_mesh = _cab(int(rng.integers(4)), plan)
    return Lorry(
        plan,
        float(cab_mesh.vertices_m[:, 2].max()),
        Painted(cab_mesh, paint, 0.6 * dust),
        Painted(_chassis(plan), frame, dust),
        (
            RoadWheels(Painted(single, rims, dust), WHEEL_RADIUS_M, axle_places(front_x, 2.1, WHEEL_RADIUS_M), share),
            RoadWheels(
                Painted(twin, rims, dust),
                WHEEL_RADIUS_M,
                axle_places(rear_x, 1.88, WHEEL_RADIUS_M),
                np.zeros(2 * len(rear_x)),
            ),
        ),
    )


@lru_cache(maxsize=16)
def _cab(variant: int, plan: LorryPlan) -> Mesh:
    height_m = (1.95, 1.95, 2.2, 2.35)[variant]
    middle_m, low_m = plan.front_m - _CAB_LENGTH_M / 2 - 0.05, 0.95
    length_m, width_m = _CAB_LENGTH_M - 0.1, WIDTH_M - 0.08
    front_m = middle_m + length_m / 2
    parts = [
        cab(length_m, width_m, height_m, slant_m=0.28, sill=0.46).at(middle_m, 0.0, low_m),
        box((0.55, width_m - 0.04, 0.45), None).at(front_m - 0.27, 0.0, 0.52),
        box((0.2, width_m - 0.3, 0.45), BLACK, Surface.PLASTIC).at(front_m - length_m + 0.1, 0.0, 0.55),
        box((1.3, 1.5, 0.4), BLACK, Surface.STEEL).at(middle_m, 0.0, 0.6),
        box((0.35, WIDTH_M, 0.42), (0.5, 0.5, 0.5) if variant % 2 else None).at(front_m, 0.0, 0.35),
        box((0.06, 1.5, 0.55), BLACK, Surface.PLASTIC).at(front_m, 0.0, 0.95),
        box((0.6, width_m - 0.01, 0.53 * height_m - 0.1), None).at(
            middle_m - length_m / 2 + 0.3, 0.0, low_m + 0.46 * height_m
        ),
        *_lights(front_m),
        *_mirrors(front_m - 0.25, low_m + 0.72 * height_m),
    ]
    if variant == 1:
        wedge = [(-0.8, -1.0, 0.0), (-0.8, 1.0, 0.0), (0.5, -0.95, 0.0), (0.5, 0.95, 0.0), (-0.8, -0.9, 0.65)]
        parts.append(hull([*wedge, (-0.8, 0.9, 0.65)], None).at(middle_m, 0.0, low_m + height_m - 0.02))
    else:
        horns = cylinder(0.05, 0.5, STEEL, axis="x", sections=6)
        parts += [beacon().at(middle_m - 0.2, y, low_m + height_m) for y in (-0.8, 0.8)]
        parts.append(horns.at(middle_m + 0.1, 0.4, low_m + height_m + 0.06))
    visor = box((0.28, width_m - 0.3, 0.05), GLASS, Surface.GLASS)
    parts.append(visor.at(front_m - 0.1, 0.0, low_m + height_m - 0.2))
    return join(parts)


def _lights(front_m: float) -> list[Mesh]:
    lights = [box((0.06, 0.42, 0.16), LAMP, Surface.GLASS).at(front_m + 0.16, y, 0.48) for y in (-0.95, 0.95)]
    plate = box((0.02, 0.52, 0.11), (0.6, 0.6, 0.58)).at(front_m + 0.18, 0.0, 0.42)
    return [*lights, plate]


def _mirrors(x_m: float, z_m: float) -> list[Mesh]:
    return [mirror(0.32, left=side > 0).at(x_m, side * (WIDTH_M / 2 - 0.06), z_m) for side in (-1.0, 1.0)]


@lru_cache(maxsize=4)
def _chassis(plan: LorryPlan) -> Mesh:
    rear_m, front_m = -plan.front_m, plan.front_m - 0.3
    rails = [((rear_m, side * 0.42, 0.86), (front_m, side * 0.42, 0.86)) for side in (-1, 1)]
    cross = [((x, -0.42, 0.86), (x, 0.42, 0.86)) for x in np.arange(rear_m + 0.2, front_m, 1.1)]
    axles = [plan.front_m - x for x in (*plan.front_axles_m, *plan.rear_axles_m)]
    tank_m = (min(plan.front_m - x for x in plan.front_axles_m) + max(plan.front_m - x for x in plan.rear_axles_m)) / 2
    guard = profile([(-0.6, 0.0), (0.6, 0.0), (0.45, 0.12), (-0.45, 0.12)], 0.6, BLACK, Surface.PLASTIC)
    guards = [guard.at(plan.front_m - x, side * 0.95, 1.0) for x in plan.rear_axles_m for side in (-1, 1)]
    beams = [cylinder(0.09, 1.9, DARK_GREY, axis="y", sections=8).at(x, 0.0, WHEEL_RADIUS_M) for x in axles]
    rear = [box((0.06, 0.35, 0.12), RED_LAMP, Surface.PLASTIC).at(rear_m, side * 0.95, 0.75) for side in (-1, 1)]
    return join(
        [
            bars(np.array(rails), 0.1, None, Surface.PAINT, depth_m=0.26),
            bars(np.array(cross), 0.12, None),
            box((0.9, 0.55, 0.55), STEEL, Surface.STEEL).at(tank_m, 0.85, 0.45),
            cylinder(0.28, 1.0, STEEL, axis="x", sections=10).at(tank_m, -0.85, 0.72),
            box((0.08, 2.3, 0.15), None).at(rear_m, 0.0, 0.55),
            *guards,
            *beams,
            *rear,
        ]
    )
