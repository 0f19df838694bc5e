"""A crawler dozer: tracks, hood, cab, blade on push arms, ripper.

Joints: blade_m (height of the cutting edge), ripper (0 up .. 1 down), track_m (distance gone).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff_sim.machines import dozer_parts
from standoff_sim.machines.dozer_parts import BLADE_EDGE_M, BLADE_PIVOT_M, CRAWLER, GAUGE_M
from standoff_sim.machines.joints import UNBOUNDED_M, settle
from standoff_sim.machines.machine_parts import ram_poses, rectangle
from standoff_sim.machines.paint import Painted, draw_livery
from standoff_sim.machines.running_gear import Crawlers
from standoff_sim.scene.scene import Batch, moved
from standoff_sim.solids.mesh import rotation, scaling, translation

LIMITS: Mapping[str, tuple[float, float]] = {"blade_m": (-0.35, 0.95), "ripper": (0.0, 1.0), "track_m": UNBOUNDED_M}
_RIPPER_PIVOT_M = (-1.75, 0.0, 0.85)
_RIPPER_DEG = 28.0


@dataclass(frozen=True, slots=True, eq=False)
class Dozer:
    """A dozer.

    Attributes:
        scale: Size against the modelled 18 t machine.
        body: Rigid parts on the tracks.
        tracks: Both crawlers.
        blade: Blade and push arms.
        rams: Barrel and rod that lift the blade.
        ripper: Or None.
        footprint_m: Of the crawlers.
        height_m: Of the cab.
        joints: Blade, ripper, travel.
        class_id: Roller or dozer.
    """

    scale: float
    body: tuple[Painted, ...]
    tracks: Crawlers
    blade: tuple[Painted, ...]
    rams: tuple[Painted, Painted]
    ripper: Painted | None
    footprint_m: FloatArray
    height_m: float
    joints: Mapping[str, tuple[float, float]]
    class_id: int = CLASS_BY_NAME["roller_or_dozer"].id

    def parts(self, joints: Mapping[str, float]) -> tuple[Batch, ...]:
        """Return body, tracks, blade, rams and ripper."""
        value = settle(joints, self.joints, {})
        to_blade = self._blade_pose(value["blade_m"])
        barrels, rods = [], []
        for side in (-1.0, 1.0):
            shift = np.array([0.0, side * dozer_parts.RAM_Y_M, 0.0])
            head = (to_blade @ [*dozer_parts.RAM_HEAD_M, 1.0])[:3] + shift
            barrel, rod = ram_poses(np.array(dozer_parts.RAM_FOOT_M) + shift, head)
            barrels.append(barrel)
            rods.append(rod)
        batches = [*(part.at(np.eye(4)) for part in self.body), *(part.at(to_blade) for part in self.blade)]
        batches += [self.rams[0].at(np.stack(barrels)), self.rams[1].at(np.stack(rods))]
        if self.ripper is not None:
            batches.append(self.ripper.at(_about(_RIPPER_PIVOT_M, -_RIPPER_DEG * value["ripper"])))
        batches += self.tracks.batches(value["track_m"] / self.scale)
        return moved(batches, scaling(self.scale, self.scale, self.scale))

    def tool_tip_m(self, joints: Mapping[str, float]) -> FloatArray | None:
        """Return (3,) middle of the blade's cutting edge, local frame."""
        value = settle(joints, self.joints, {})
        tip: FloatArray = self.scale * (self._blade_pose(value["blade_m"]) @ [*BLADE_EDGE_M, 1.0])[:3]
        return tip

    def _blade_pose(self, edge_height_m: float) -> FloatArray:
        """Return the (4, 4) turn about the push arms' pivot that brings the edge to a height."""
        reach = np.subtract(BLADE_EDGE_M, BLADE_PIVOT_M)
        length_m = float(np.hypot(reach[0], reach[2]))
        rest = np.arctan2(reach[2], reach[0])
        wanted = np.arcsin((edge_height_m / self.scale - BLADE_PIVOT_M[2]) / length_m)
        return _about(BLADE_PIVOT_M, -float(np.rad2deg(wanted - rest)))


def make_dozer(rng: np.random.Generator) -> Dozer:
    """Draw a dozer, with or without ripper, cab closed or open."""
    livery, scale = draw_livery(rng), float(rng.uniform(0.85, 1.0))
    body = dozer_parts.body(open_cab=bool(rng.random() < 0.2))
    shoe = Painted(dozer_parts.shoe(), livery.frame, livery.dust)
    frame = Painted(dozer_parts.track_frame(), livery.body, min(1.0, 1.3 * livery.dust))
    ram = dozer_parts.blade_ram()
    return Dozer(
        scale=scale,
        body=(Painted(body, livery.body, livery.dust), Painted(dozer_parts.belly(), livery.frame, livery.dust)),
        tracks=Crawlers(CRAWLER, GAUGE_M, shoe, frame),
        blade=(
            Painted(dozer_parts.blade(), livery.boom, min(1.0, 1.2 * livery.dust)),
            Painted(dozer_parts.push_arms(), livery.body, livery.dust),
        ),
        rams=(Painted(ram.barrel, livery.boom, livery.dust), Painted(ram.rod, livery.boom, livery.dust)),
        ripper=Painted(dozer_parts.ripper(), livery.tool, livery.dust) if rng.random() < 0.6 else None,
        footprint_m=scale * rectangle(CRAWLER.length_m + 0.1, GAUGE_M + CRAWLER.width_m),
        height_m=scale * float(body.vertices_m[:, 2].max()),
        joints=LIMITS,
    )


def _about(pivot_m: tuple[float, float, float], angle_deg: float) -> FloatArray:
    x_m, y_m, z_m = pivot_m
    pose: FloatArray = translation(x_m, y_m, z_m) @ rotation("y", angle_deg) @ translation(-x_m, -y_m, -z_m)
    return pose
