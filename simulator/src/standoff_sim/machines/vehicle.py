"""Road vehicles: cars, vans, pickups, flatbed lorries and concrete mixers.

Joints: steer_deg (front wheels, left is positive), travel_m (distance gone), and drum_deg of a mixer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff_sim.machines import car_body
from standoff_sim.machines.car_body import CarPlan, wheel_places
from standoff_sim.machines.joints import UNBOUNDED_DEG, UNBOUNDED_M, settle
from standoff_sim.machines.lorry import FOUR_AXLES, TWO_AXLES, WIDTH_M, Lorry, make_lorry
from standoff_sim.machines.lorry_bodies import MIXER_AXIS, flatbed, mixer_drum, mixer_frame
from standoff_sim.machines.machine_parts import highest_m, rectangle
from standoff_sim.machines.paint import Painted, weather
from standoff_sim.machines.road_wheels import RoadWheels, road_wheel
from standoff_sim.scene.scene import Batch
from standoff_sim.solids.mesh import Colour, rotation, scaling, srgb

LIMITS: Mapping[str, tuple[float, float]] = {"steer_deg": (-38.0, 38.0), "travel_m": UNBOUNDED_M}
_PAINTS: tuple[tuple[str, float], ...] = (
    ("#dfe0de", 0.27),
    ("#16181a", 0.14),
    ("#3d4144", 0.13),
    ("#8e9294", 0.13),
    ("#b4b7b8", 0.1),
    ("#20364f", 0.06),
    ("#2b527f", 0.05),
    ("#7d1c1c", 0.05),
    ("#6a5f50", 0.02),
    ("#35433a", 0.02),
    ("#b8b09a", 0.02),
    ("#c79a1e", 0.01),
)
_CARS: tuple[tuple[CarPlan, float], ...] = (
    (car_body.SEDAN, 0.16),
    (car_body.HATCHBACK, 0.15),
    (car_body.ESTATE, 0.09),
    (car_body.SUV, 0.16),
    (car_body.VAN, 0.14),
    (car_body.SMALL_VAN, 0.09),
    (car_body.MINIBUS, 0.06),
    (car_body.PICKUP, 0.15),
)
_BODIES = ("#d8d8d4", "#8f9397", "#b33a22", "#2a5a96", "#d8a020", "#4c7a50")
_LORRY_SHARE = 0.14
_WORKING = (car_body.VAN, car_body.SMALL_VAN, car_body.PICKUP)


@dataclass(frozen=True, slots=True, eq=False)
class Car:
    """A car, van or pickup.

    Attributes:
        scale: Size against its plan.
        body: All but the wheels.
        wheels: Four.
        footprint_m: Its plan.
        height_m: Of the roof.
        joints: Steering and travel.
        class_id: Vehicle.
    """

    scale: float
    body: Painted
    wheels: RoadWheels
    footprint_m: FloatArray
    height_m: float
    joints: Mapping[str, tuple[float, float]]
    class_id: int = CLASS_BY_NAME["vehicle"].id

    def parts(self, joints: Mapping[str, float]) -> tuple[Batch, ...]:
        """Return body and wheels."""
        value = settle(joints, self.joints, {})
        larger = scaling(self.scale, self.scale, self.scale)
        return self.body.at(larger), self.wheels.batch(value["travel_m"] / self.scale, value["steer_deg"], larger)

    def tool_tip_m(self, joints: Mapping[str, float]) -> FloatArray | None:
        """Return None: a car has no tool."""


@dataclass(frozen=True, slots=True, eq=False)
class Truck:
    """A lorry with a body that does not tip: a flatbed, or a mixer with its drum.

    Attributes:
        lorry: Cab, chassis, wheels.
        body: What is fixed on the chassis.
        drum: Turns about the mixer's axis, or None.
        footprint_m: Its plan.
        height_m: Over all.
        joints: Steering, travel, the drum's turn.
        class_id: Vehicle.
    """

    lorry: Lorry
    body: Painted
    drum: Painted | None
    footprint_m: FloatArray
    height_m: float
    joints: Mapping[str, tuple[float, float]]
    class_id: int = CLASS_BY_NAME["vehicle"].id

    def parts(self, joints: Mapping[str, float]) -> tuple[Batch, ...]:
        """Return lorry, body and drum."""
        value = settle(joints, self.joints, {})
        batches = (*self.lorry.batches(value["travel_m"], value["steer_deg"]), self.body.at(np.eye(4)))
        if self.drum is None:
            return batches
        return (*batches, self.drum.at(MIXER_AXIS @ rotation("x", value["drum_deg"])))

    def tool_tip_m(self, joints: Mapping[str, float]) -> FloatArray | None:
        """Return None: a lorry has no tool."""


def make_vehicle(rng: np.random.Generator) -> Car | Truck:
    """Draw a road vehicle: mostly cars, vans and pickups, now and then a flatbed lorry or a concrete mixer."""
    return make_truck(rng) if rng.random() < _LORRY_SHARE else make_car(rng)


def make_car(rng: np.random.Generator) -> Car:
    """Draw a car, van or pickup."""
    shares = np.array([share for _, share in _CARS])
    plan = _CARS[int(rng.choice(len(_CARS), p=shares / shares.sum()))][0]
    working = plan in _WORKING
    extras = int(rng.choice([0, 0, 0, 1, 2])) if working else 0
    scale, dust = float(rng.uniform(0.95, 1.05)), float(rng.uniform(0.0, 0.45 if working else 0.25))
    tyre = Painted(road_wheel(plan.wheel_m, 0.2), weather(rng, srgb("#9a9c9e")), dust)
    body = car_body.car_body(plan, extras)
    return Car(
        scale=scale,
        body=Painted(body, _paint(rng, working), dust),
        wheels=RoadWheels(tyre, plan.wheel_m, wheel_places(plan), np.array([1.0, 1.0, 0.0, 0.0])),
        footprint_m=scale * rectangle(plan.length_m, plan.width_m),
        height_m=scale * float(body.vertices_m[:, 2].max()),
        joints=LIMITS,
    )


def make_truck(rng: np.random.Generator) -> Truck:
    """Draw a flatbed lorry or a concrete mixer."""
    mixer = rng.random() < 0.5
    plan = FOUR_AXLES if mixer else TWO_AXLES
    lorry, dust = make_lorry(rng, plan), float(rng.uniform(0.15, 0.6))
    tint = weather(rng, srgb(_BODIES[int(rng.integers(len(_BODIES)))]))
    frame = weather(rng, srgb("#3a3b3c")) if mixer else tint
    body = Painted(mixer_frame() if mixer else flatbed(int(rng.integers(3))), frame, dust)
    drum = Painted(mixer_drum(int(rng.integers(3))), tint, dust) if mixer else None
    standing = (body.at(np.eye(4)), *(() if drum is None else (drum.at(MIXER_AXIS),)))
    return Truck(
        lorry=lorry,
        body=body,
        drum=drum,
        footprint_m=rectangle(plan.length_m, WIDTH_M),
        height_m=max(lorry.height_m, highest_m(standing)),
        joints={**LIMITS, "drum_deg": UNBOUNDED_DEG} if mixer else LIMITS,
    )


def _paint(rng: np.random.Generator, working: bool) -> Colour:
    shares = np.array([share for _, share in _PAINTS])
    if working and rng.random() < 0.55:
        return weather(rng, srgb("#dcdcd8"), 0.5)
    code, _ = _PAINTS[int(rng.choice(len(_PAINTS), p=shares / shares.sum()))]
    return weather(rng, srgb(code), 0.4)
