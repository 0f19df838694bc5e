"""An excavator on crawlers or wheels: undercarriage, upper structure that swings, boom, arm, bucket and their rams.

Joints: swing_deg (0: boom along local x, counter-clockwise from above), boom_deg, arm_deg, bucket_deg (see
`standoff.simulation.machines.digging`), track_m (distance gone), load (0 empty .. 1 heaped bucket).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.simulation.machines.digging import DiggingArm, Link
from standoff.simulation.machines.excavator_arm import arm_meshes, linkage_of, ram_mounts
from standoff.simulation.machines.excavator_body import body_meshes, running_gear
from standoff.simulation.machines.excavator_sizes import SIZES, WEIGHTS
from standoff.simulation.machines.joints import UNBOUNDED_DEG, UNBOUNDED_M, settle
from standoff.simulation.machines.machine_parts import Point, Ram, ram_poses, scaled_poses
from standoff.simulation.machines.paint import Livery, Painted, draw_livery, weather
from standoff.simulation.machines.running_gear import RunningGear
from standoff.simulation.mesh import rotation, scaling, srgb, translation
from standoff.simulation.scene import Batch

LIMITS: Mapping[str, tuple[float, float]] = {
    "swing_deg": UNBOUNDED_DEG,
    "boom_deg": (-48.0, 62.0),
    "arm_deg": (-152.0, -28.0),
    "bucket_deg": (-138.0, 25.0),
    "track_m": UNBOUNDED_M,
    "load": (0.0, 1.0),
}


@dataclass(frozen=True, slots=True, eq=False)
class RamMount:
    """One or more equal hydraulic cylinders side by side.

    Attributes:
        ram: Barrel and rod.
        barrel_link: What holds the barrel.
        barrel_m: Its pivot there, y ignored.
        rod_link: What the rod moves.
        rod_m: Its pivot there, y ignored.
        sides_m: y of each cylinder in both frames.
    """

    barrel: Painted
    rod: Painted
    barrel_link: Link
    barrel_m: Point
    rod_link: Link
    rod_m: Point
    sides_m: tuple[float, ...] = (0.0,)
