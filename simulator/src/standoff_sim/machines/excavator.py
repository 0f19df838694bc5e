"""An excavator on crawlers or wheels: undercarriage, upper structure that swings, boom, arm, bucket and their rams.

Joints: swing_deg (0: boom along local x, counter-clockwise from above), boom_deg, arm_deg, bucket_deg (see
`standoff_sim.machines.digging`), track_m (distance gone), load (0 empty .. 1 heaped bucket).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff_sim.machines.digging import DiggingArm, Link
from standoff_sim.machines.excavator_arm import RamMount, arm_meshes, linkage_of, ram_mounts
from standoff_sim.machines.excavator_body import (
    body_meshes,
    crawler_meshes,
    crawler_of,
    undercarriage_mesh,
    wheel_mesh,
    wheel_places,
)
from standoff_sim.machines.excavator_sizes import SIZES, ExcavatorSize
from standoff_sim.machines.joints import UNBOUNDED_DEG, UNBOUNDED_M, settle
from standoff_sim.machines.machine_parts import highest_m, ram_poses, rectangle
from standoff_sim.machines.paint import SOILS, Livery, Painted, draw_livery, weather
from standoff_sim.machines.running_gear import Axles, Crawlers, RunningGear
from standoff_sim.scene.scene import Batch, moved
from standoff_sim.solids.mesh import Colour, scaling, srgb, translation

LIMITS: Mapping[str, tuple[float, float]] = {
    "swing_deg": UNBOUNDED_DEG,
    "boom_deg": (-48.0, 62.0),
    "arm_deg": (-152.0, -28.0),
    "bucket_deg": (-138.0, 25.0),
    "track_m": UNBOUNDED_M,
    "load": (0.0, 1.0),
}


@dataclass(frozen=True, slots=True, eq=False)
class Excavator:
    """An excavator's shape and colours; implements `standoff_sim.scene.scene.Model`.

    Attributes:
        linkage: Its kinematics, before `scale`.
        skins: What is rigid with each link.
        soil: A full bucket's load, in the bucket's frame, its surface towards -z.
        rams: Hydraulic cylinders.
        ram_tint: Their colour.
        gear: Crawlers or wheels, before `scale`.
        footprint_m: (4, 2) outline of the undercarriage, counter-clockwise.
        height_m: Highest point in rest position.
        joints: Limits of all joints.
        rest: Values of joints that are not given: the bucket rests on the ground.
        scale: Size against the linkage and meshes.
        class_id: Of "excavator".
    """

    linkage: DiggingArm
    skins: Mapping[Link, tuple[Painted, ...]]
    soil: Painted
    rams: tuple[RamMount, ...]
    ram_tint: Colour
    gear: RunningGear | None
    footprint_m: FloatArray
    height_m: float
    joints: Mapping[str, tuple[float, float]]
    rest: Mapping[str, float]
    scale: float = 1.0
    class_id: int = CLASS_BY_NAME["excavator"].id

    def parts(self, joints: Mapping[str, float]) -> tuple[Batch, ...]:
        """Return all rigid parts; joints that are not given are at rest, others held within their limits."""
        settled = settle(joints, self.joints, self.rest)
        frames = self.linkage.frames(settled)
        batches = [skin.at(frames[link]) for link, skins in self.skins.items() for skin in skins]
        for mount in self.rams:
            batches += self._ram_batches(mount, frames)
        if self.gear is not None:
            batches += self.gear.batches(settled["track_m"] / self.scale)
        if settled["load"] > 0.0:
            sunk = translation(0.0, 0.0, (1.0 - settled["load"]) * 0.4 * self.linkage.bucket_m)
            batches.append(self.soil.at(frames[Link.BUCKET] @ sunk))
        larger = scaling(self.scale, self.scale, self.scale)
        return moved(batches, larger)

    def _ram_batches(self, mount: RamMount, frames: Mapping[Link, FloatArray]) -> tuple[Batch, Batch]:
        pairs = []
        for side_m in mount.sides_m:
            shift = (0.0, side_m, 0.0)
            barrel_m = frames[mount.barrel_link] @ [*np.add(mount.barrel_m, shift), 1.0]
            rod_m = frames[mount.rod_link] @ [*np.add(mount.rod_m, shift), 1.0]
            # In the plane of the boom, so that a cylinder does not roll when it passes the vertical.
            to_upper = np.linalg.inv(frames[Link.UPPER])
            barrel, rod = ram_poses((to_upper @ barrel_m)[:3], (to_upper @ rod_m)[:3])
            pairs.append((frames[Link.UPPER] @ barrel, frames[Link.UPPER] @ rod))
        barrels, rods = (np.stack(poses) for poses in zip(*pairs, strict=True))
        dust = self.soil.dust
        return (
            Painted(mount.ram.barrel, self.ram_tint, dust).at(barrels),
            Painted(mount.ram.rod, self.ram_tint, dust).at(rods),
        )

    def tool_tip_m(self, joints: Mapping[str, float]) -> FloatArray:
        """Return (3,) middle of the bucket's cutting edge, local frame."""
        tip: FloatArray = self.scale * self.linkage.tip_m(settle(joints, self.joints, self.rest))
        return tip


def reach(model: Excavator, radius_m: float, height_m: float, attitude_deg: float) -> dict[str, float]:
    """Return boom_deg, arm_deg and bucket_deg that bring the bucket's tip to a place in the boom's plane.

    Args:
        model: Any excavator.
        radius_m: Horizontal distance from the swing axis, along the boom's direction.
        height_m: Above the ground that the machine stands on; negative when digging.
        attitude_deg: Elevation of the line from bucket pivot to tip: -90 straight down, -180 towards the machine.

    Raises:
        ValueError: Out of reach, or beyond a joint's limit.
    """
    joints = model.linkage.solve(radius_m / model.scale, height_m / model.scale, attitude_deg)
    for name, value in joints.items():
        low, high = model.joints[name]
        if not low - 1e-6 <= value <= high + 1e-6:
            raise ValueError(f"{name} would be {value:.1f}, limits are {low:.1f} to {high:.1f}")
    return joints


def make_excavator(rng: np.random.Generator) -> Excavator:
    """Draw a type, a size within it, colours and wear."""
    shares = np.array([size.share for size in SIZES])
    size = SIZES[rng.choice(len(SIZES), p=shares / shares.sum())]
    return build_excavator(size, rng)


def build_excavator(size: ExcavatorSize, rng: np.random.Generator) -> Excavator:
    """Build one of a given type; colours, wear and a few per cent of scale are drawn."""
    livery, scale = draw_livery(rng), float(rng.uniform(0.96, 1.04))
    linkage = linkage_of(size)
    model = Excavator(
        linkage=linkage,
        skins=_paint(size, livery, rng),
        soil=Painted(arm_meshes(size).soil, weather(rng, srgb(SOILS[rng.integers(len(SOILS))])), 0.0),
        rams=ram_mounts(size, tuple(sorted(LIMITS.items()))),
        ram_tint=livery.boom if rng.random() < 0.6 else weather(rng, srgb("#3f4143")),
        gear=_gear(size, livery, rng),
        footprint_m=scale * rectangle(size.base_m, size.width_m),
        height_m=0.0,
        joints=LIMITS,
        rest=rest_of(linkage),
        scale=scale,
    )
    return finished(model)


def finished(model: Excavator) -> Excavator:
    """Return the model with its height measured at rest."""
    return replace(model, height_m=highest_m(model.parts({})))


def rest_of(linkage: DiggingArm) -> dict[str, float]:
    """Return the joints of a parked machine: its teeth on the ground some way ahead."""
    attitude_deg, height_m = -112.0, 0.02
    down_m = linkage.foot_m[2] - height_m + linkage.bucket_m * np.sin(np.deg2rad(attitude_deg))
    ahead_m = np.sqrt((0.96 * (linkage.boom_m + linkage.arm_m)) ** 2 - down_m**2)
    radius_m = linkage.foot_m[0] + ahead_m + linkage.bucket_m * np.cos(np.deg2rad(attitude_deg))
    return linkage.solve(float(radius_m), height_m, attitude_deg)


def _paint(size: ExcavatorSize, livery: Livery, rng: np.random.Generator) -> dict[Link, tuple[Painted, ...]]:
    body, arm = body_meshes(size), arm_meshes(size)
    dust = livery.dust
    cab_tint = (livery.body, weather(rng, srgb("#3a3b3c")), weather(rng, srgb("#d9d7d0")))[
        rng.choice(3, p=(0.6, 0.3, 0.1))
    ]
    return {
        Link.UNDERCARRIAGE: (Painted(undercarriage_mesh(size), livery.frame, dust),),
        Link.UPPER: (
            Painted(body.panels, livery.body, dust),
            Painted(body.counterweight, livery.accent, dust),
            Painted(body.cab, cab_tint, dust),
            Painted(body.deck, weather(rng, livery.frame), dust),
        ),
        Link.BOOM: (Painted(arm.boom, livery.boom, dust),),
        Link.ARM: (Painted(arm.arm, weather(rng, livery.boom, 0.3), dust),),
        Link.BUCKET: (Painted(arm.bucket, livery.tool, max(dust, 0.5)),),
        Link.ROCKER: (Painted(arm.rocker, livery.boom, dust),),
        Link.TIE: (Painted(arm.tie, livery.boom, dust),),
    }


def _gear(size: ExcavatorSize, livery: Livery, rng: np.random.Generator) -> RunningGear:
    dust = min(1.0, livery.dust + 0.25)
    if size.wheeled:
        wheels = Painted(wheel_mesh(size), livery.body if rng.random() < 0.6 else livery.frame, dust)
        return Axles(wheels, size.gear_m / 2, np.array(wheel_places(size)))
    shoe, frame = crawler_meshes(size)
    worn = weather(rng, srgb("#5b5148"))
    return Crawlers(
        crawler_of(size), size.width_m - size.shoe_m, Painted(shoe, worn, dust), Painted(frame, livery.frame, dust)
    )
