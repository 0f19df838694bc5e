"""Rollers: a single drum in front of two wheels, or two drums in tandem.

Joints: steer_deg (between the halves, left is positive) and travel_m (distance gone, turns the drums).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff_sim.machines import roller_parts
from standoff_sim.machines.joints import UNBOUNDED_M, settle
from standoff_sim.machines.machine_parts import rectangle
from standoff_sim.machines.paint import Painted, draw_livery, weather
from standoff_sim.machines.road_wheels import RoadWheels, axle_places, road_wheel
from standoff_sim.machines.roller_parts import SINGLE_DRUM, TANDEM, RollerPlan
from standoff_sim.scene.scene import Batch
from standoff_sim.solids.mesh import rotation, scaling, srgb, translation

LIMITS: Mapping[str, tuple[float, float]] = {"steer_deg": (-35.0, 35.0), "travel_m": UNBOUNDED_M}


@dataclass(frozen=True, slots=True, eq=False)
class Roller:
    """A roller whose halves turn about the middle joint by half the steering angle each.

    Attributes:
        plan: Its lengths before `scale`.
        scale: Size against the plan.
        front: Rigid parts before the joint.
        rear: Rigid parts behind it.
        drum: Rolls at `plan.front_x_m`, in a tandem roller also behind.
        wheels: Behind a single drum, or None.
        footprint_m: Its plan.
        height_m: Of the roof.
        joints: Steering and travel.
        class_id: Roller or dozer.
    """

    plan: RollerPlan
    scale: float
    front: tuple[Painted, ...]
    rear: tuple[Painted, ...]
    drum: Painted
    wheels: RoadWheels | None
    footprint_m: FloatArray
    height_m: float
    joints: Mapping[str, tuple[float, float]]
    class_id: int = CLASS_BY_NAME["roller_or_dozer"].id

    def parts(self, joints: Mapping[str, float]) -> tuple[Batch, ...]:
        """Return both halves, drums and wheels."""
        value = settle(joints, self.joints, {})
        travel_m = value["travel_m"] / self.scale
        larger = scaling(self.scale, self.scale, self.scale)
        ahead = larger @ self._about_joint(value["steer_deg"] / 2)
        behind = larger @ self._about_joint(-value["steer_deg"] / 2)
        rolled = rotation("y", np.rad2deg(travel_m / self.plan.drum_m))
        front_drum = ahead @ translation(self.plan.front_x_m, 0.0, self.plan.drum_m) @ rolled
        rear_drum = behind @ translation(self.plan.rear_x_m, 0.0, self.plan.drum_m) @ rolled
        rolling = self.wheels.batch(travel_m, pose=behind) if self.wheels else self.drum.at(rear_drum)
        return (
            *(part.at(ahead) for part in self.front),
            *(part.at(behind) for part in self.rear),
            self.drum.at(front_drum),
            rolling,
        )

    def tool_tip_m(self, joints: Mapping[str, float]) -> FloatArray | None:
        """Return None: a roller has no tool."""

    def _about_joint(self, angle_deg: float) -> FloatArray:
        x_m = self.plan.joint_x_m
        pose: FloatArray = translation(x_m, 0.0, 0.0) @ rotation("z", angle_deg) @ translation(-x_m, 0.0, 0.0)
        return pose


def make_roller(rng: np.random.Generator) -> Roller:
    """Draw a roller, single-drum or tandem, smooth or with pads."""
    single = rng.random() < 0.6
    plan = SINGLE_DRUM if single else TANDEM
    livery, scale = draw_livery(rng), float(rng.uniform(0.93, 1.06))
    open_cab = bool(rng.random() < (0.3 if single else 0.6))
    rear = roller_parts.single_rear(open_cab) if single else roller_parts.tandem_rear(open_cab)
    rear_frame = roller_parts.single_rear_frame() if single else roller_parts.drum_frame(plan, front=False)
    steel = weather(rng, srgb("#807a70"))
    wheels = None
    if single:
        radius_m = roller_parts.REAR_WHEEL_M
        tyre = Painted(road_wheel(radius_m, 0.56, 14), livery.boom, livery.dust)
        wheels = RoadWheels(tyre, radius_m, axle_places((plan.rear_x_m,), 1.5, radius_m), np.zeros(2))
    front = [Painted(roller_parts.drum_frame(plan, front=True), livery.boom, livery.dust)]
    if not single:
        front.append(Painted(roller_parts.tandem_front(), livery.body, livery.dust))
    return Roller(
        plan=plan,
        scale=scale,
        front=tuple(front),
        rear=(Painted(rear, livery.body, livery.dust), Painted(rear_frame, livery.boom, livery.dust)),
        drum=Painted(roller_parts.drum(plan, padded=bool(single and rng.random() < 0.3)), steel, 0.5 * livery.dust),
        wheels=wheels,
        footprint_m=scale * rectangle(plan.length_m, plan.width_m),
        height_m=scale * float(rear.vertices_m[:, 2].max()),
        joints=LIMITS,
    )
