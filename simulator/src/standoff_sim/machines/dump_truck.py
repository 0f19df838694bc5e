"""Dump trucks: articulated haulers and road tippers with three or four axles.

Joints: steer_deg (of a tipper's wheels, or between a hauler's halves; left is positive), bed_deg (0 down),
load (0 empty .. 1 heaped), travel_m (distance gone).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff_sim.machines import hauler
from standoff_sim.machines.joints import UNBOUNDED_M, settle
from standoff_sim.machines.lorry import FOUR_AXLES, FRAME_TOP_M, THREE_AXLES, WIDTH_M, Lorry, make_lorry
from standoff_sim.machines.machine_parts import highest_m, rectangle
from standoff_sim.machines.paint import Painted, draw_livery, weather
from standoff_sim.machines.road_wheels import RoadWheels, axle_places, road_wheel
from standoff_sim.machines.tipping_bed import LOAD_VARIANTS, Bed, cargo, hauler_tub, tipper_gate, tipper_tub
from standoff_sim.scene.scene import Batch
from standoff_sim.solids.mesh import rotation, scaling, srgb, translation

LIMITS: Mapping[str, tuple[float, float]] = {
    "steer_deg": (-40.0, 40.0),
    "bed_deg": (0.0, 50.0),
    "load": (0.0, 1.0),
    "travel_m": UNBOUNDED_M,
}
_HAULER_SHARE = 0.35
_BED_PAINTS = tuple(
    srgb(code) for code in ("#8f9397", "#6f7477", "#c96a1e", "#2a5a96", "#9e2c22", "#3f7050", "#d8d6cf", "#d6a224")
)


@dataclass(frozen=True, slots=True, eq=False)
class Tipper:
    """A road lorry with a tipping bed.

    Attributes:
        lorry: What carries the bed.
        bed: Tips backwards.
        footprint_m: Its plan.
        height_m: Of the cab or the bed, whichever is higher.
        joints: As of all dump trucks.
        class_id: Dump truck.
    """

    lorry: Lorry
    bed: Bed
    footprint_m: FloatArray
    height_m: float
    joints: Mapping[str, tuple[float, float]]
    class_id: int = CLASS_BY_NAME["dump_truck"].id

    def parts(self, joints: Mapping[str, float]) -> tuple[Batch, ...]:
        """Return lorry, bed and load."""
        value = settle(joints, self.joints, {})
        bed = self.bed.batches(value["bed_deg"], value["load"], np.eye(4))
        return (*self.lorry.batches(value["travel_m"], value["steer_deg"]), *bed)

    def tool_tip_m(self, joints: Mapping[str, float]) -> FloatArray | None:
        """Return None: a truck has no tool."""


@dataclass(frozen=True, slots=True, eq=False)
class Hauler:
    """An articulated hauler; its halves turn about the hitch by half the steering angle each.

    Attributes:
        scale: Size against the modelled 28 t machine.
        front: Rigid parts before the hitch.
        front_wheels: Of the front axle.
        rear: Chassis behind the hitch.
        rear_wheels: Of the bogie.
        bed: Tips backwards.
        footprint_m: Its plan with straight halves.
        height_m: Of the cab.
        joints: As of all dump trucks.
        class_id: Dump truck.
    """

    scale: float
    front: tuple[Painted, ...]
    front_wheels: RoadWheels
    rear: Painted
    rear_wheels: RoadWheels
    bed: Bed
    footprint_m: FloatArray
    height_m: float
    joints: Mapping[str, tuple[float, float]]
    class_id: int = CLASS_BY_NAME["dump_truck"].id

    def parts(self, joints: Mapping[str, float]) -> tuple[Batch, ...]:
        """Return both halves, bed and load."""
        value = settle(joints, self.joints, {})
        travel_m = value["travel_m"] / self.scale
        larger = scaling(self.scale, self.scale, self.scale)
        ahead = larger @ _about_hitch(value["steer_deg"] / 2)
        behind = larger @ _about_hitch(-value["steer_deg"] / 2)
        return (
            *(part.at(ahead) for part in self.front),
            self.front_wheels.batch(travel_m, pose=ahead),
            self.rear.at(behind),
            self.rear_wheels.batch(travel_m, pose=behind),
            *self.bed.batches(value["bed_deg"], value["load"], behind),
        )

    def tool_tip_m(self, joints: Mapping[str, float]) -> FloatArray | None:
        """Return None: a hauler has no tool."""


def make_dump_truck(rng: np.random.Generator) -> Tipper | Hauler:
    """Draw a dump truck: an articulated hauler, or a road tipper with three or four axles."""
    return _make_hauler(rng) if rng.random() < _HAULER_SHARE else _make_tipper(rng)


def _make_tipper(rng: np.random.Generator) -> Tipper:
    plan = THREE_AXLES if rng.random() < 0.5 else FOUR_AXLES
    lorry = make_lorry(rng, plan)
    rear_m, front_m = plan.deck_m
    wall_m = float(rng.choice([0.85, 1.1, 1.4]))
    length_m, floor_m = front_m - rear_m, FRAME_TOP_M + 0.15
    paint = weather(rng, _BED_PAINTS[int(rng.integers(len(_BED_PAINTS)))])
    paint = lorry.cab.tint if rng.random() < 0.3 else paint
    dust = float(rng.uniform(0.3, 0.8))
    bed = Bed(
        mount_m=(rear_m, 0.0, floor_m),
        tub=Painted(tipper_tub(length_m, wall_m, int(rng.choice([2, 6, 8])), bool(rng.random() < 0.4)), paint, dust),
        gate=Painted(tipper_gate(wall_m), paint, dust),
        cargo=Painted(cargo(int(rng.integers(LOAD_VARIANTS)), length_m - 0.15, 2.3), (1.0, 1.0, 1.0), 0.0),
        pivot_xz_m=(0.4, -0.1),
        hinge_xz_m=(0.0, wall_m),
        floor_m=(length_m / 2, 0.0, 0.1),
        fill_m=0.75 * wall_m,
        heap_m=0.4,
        ram_m=((length_m - 0.5, 0.0, -0.4), (length_m - 0.15, 0.0, 0.1)),
        ram_sides_m=(0.0,),
    )
    height_m = max(lorry.height_m, highest_m(bed.batches(0.0, 0.0, np.eye(4))))
    footprint_m = rectangle(plan.length_m, WIDTH_M)
    return Tipper(lorry, bed, footprint_m, height_m, LIMITS)


def _make_hauler(rng: np.random.Generator) -> Hauler:
    livery = draw_livery(rng)
    scale = float(rng.uniform(0.88, 1.06))
    tyre = road_wheel(hauler.WHEEL_RADIUS_M, hauler.WHEEL_WIDTH_M, 14)
    front_places = axle_places(hauler.FRONT_AXLES_X_M, hauler.TRACK_M, hauler.WHEEL_RADIUS_M)
    rear_places = axle_places(hauler.REAR_AXLES_X_M, hauler.TRACK_M, hauler.WHEEL_RADIUS_M)
    rims = Painted(tyre, livery.boom, livery.dust)
    bed = Bed(
        mount_m=(0.0, 0.0, 0.38),
        tub=Painted(hauler_tub(), livery.boom, livery.dust),
        gate=None,
        cargo=Painted(cargo(int(rng.integers(LOAD_VARIANTS)), 5.4, 2.75), (1.0, 1.0, 1.0), 0.0),
        pivot_xz_m=(-3.7, 1.4),
        hinge_xz_m=(0.0, 0.0),
        floor_m=(-1.35, 0.0, 1.6),
        fill_m=1.0,
        heap_m=0.75,
        ram_m=((-0.2, 0.0, 0.8), (-1.3, 0.0, 1.5)),
        ram_sides_m=(-0.75, 0.75),
    )
    return Hauler(
        scale=scale,
        front=(
            Painted(hauler.front_body(), livery.body, livery.dust),
            Painted(hauler.front_frame(), livery.frame, livery.dust),
        ),
        front_wheels=RoadWheels(rims, hauler.WHEEL_RADIUS_M, front_places, np.zeros(2)),
        rear=Painted(hauler.rear_frame(), livery.frame, livery.dust),
        rear_wheels=RoadWheels(rims, hauler.WHEEL_RADIUS_M, rear_places, np.zeros(4)),
        bed=bed,
        footprint_m=rectangle(hauler.LENGTH_M * scale, hauler.WIDTH_M * scale),
        height_m=scale * float(hauler.front_body().vertices_m[:, 2].max()),
        joints=LIMITS,
    )


def _about_hitch(angle_deg: float) -> FloatArray:
    pose: FloatArray = (
        translation(hauler.HITCH_X_M, 0, 0) @ rotation("z", angle_deg) @ translation(-hauler.HITCH_X_M, 0, 0)
    )
    return pose
