"""Dump trucks: articulated haulers and road tippers with three or four axles.

Joints: steer_deg (wheels of a tipper, the joint between the halves of a hauler; left is positive), bed_deg (0 down),
load (0 empty .. 1 heaped), travel_m (distance gone).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.simulation.machines.hauler import HITCH_X_M, hauler_bed, hauler_halves, hauler_wheels
from standoff.simulation.machines.joints import UNBOUNDED_M, settle
from standoff.simulation.machines.lorry import FOUR_AXLES, FRAME_TOP_M, THREE_AXLES, WIDTH_M, Lorry, make_lorry
from standoff.simulation.machines.machine_parts import strut_pose
from standoff.simulation.machines.paint import CHROME, Painted, draw_livery, weather
from standoff.simulation.machines.road_wheels import RoadWheels, rectangle
from standoff.simulation.machines.tipper_bed import Bed, tipper_bed
from standoff.simulation.mesh import cylinder, rotation, scaling, srgb, translation
from standoff.simulation.scene import Batch, Model

LIMITS: Mapping[str, tuple[float, float]] = {
    "steer_deg": (-40.0, 40.0),
    "bed_deg": (0.0, 50.0),
    "load": (0.0, 1.0),
    "travel_m": UNBOUNDED_M,
}
