"""Boom, arm, bucket and their cylinders for one size of excavator."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from standoff.simulation.machines.digging import DiggingArm, Link
from standoff.simulation.machines.excavator_body import foot_of
from standoff.simulation.machines.excavator_sizes import ExcavatorSize
from standoff.simulation.machines.machine_parts import Point, Ram, beam, lamp, scoop, soil_heap
from standoff.simulation.machines.paint import BLACK, DARK_GREY
from standoff.simulation.mesh import Mesh, Surface, box, cylinder, join, profile, rotation, scaling, translation, tube

Outline = list[tuple[float, float]]

_BOOM_OUTLINE = (
    (-0.030, 0.000), (-0.022, 0.024), (0.0, 0.036), (0.20, 0.140), (0.33, 0.204), (0.39, 0.222), (0.45, 0.220),
    (0.55, 0.190), (0.78, 0.112), (0.94, 0.056), (0.94, -0.036), (0.78, 0.000), (0.62, 0.052), (0.48, 0.094),
    (0.42, 0.102), (0.36, 0.094), (0.24, 0.048), (0.02, -0.036), (-0.02, -0.024),
)  # fmt: skip
_ARM_OUTLINE = (
    (-0.285, 0.020), (-0.270, 0.075), (-0.200, 0.105), (0.0, 0.150), (0.06, 0.158), (0.5, 0.105), (1.0, 0.042),
    (1.02, 0.0), (1.0, -0.042), (0.5, -0.062), (0.08, -0.075), (0.0, -0.070), (-0.06, -0.040), (-0.26, -0.005),
)  # fmt: skip
_SHELL = ((1.25, 0.12), (1.12, 0.42), (0.92, 0.63), (0.66, 0.72), (0.40, 0.68), (0.18, 0.50), (0.05, 0.27))
_TOOTH_M = 0.22
_EAR_XZ = (-0.11, 0.42)


@dataclass(frozen=True, slots=True, eq=False)
class ArmMeshes:
    """Each in the frame of its link; `soil` is a full bucket's."""

    boom: Mesh
    arm: Mesh
    bucket: Mesh
    soil: Mesh
    rocker: Mesh
    tie: Mesh


@dataclass(frozen=True, slots=True, eq=False)
class RamMount:
    """Equal hydraulic cylinders side by side.

    Attributes:
        ram: Barrel and rod.
        barrel_link: What holds the barrel.
        barrel_m: Its pivot there.
        rod_link: What the rod moves.
        rod_m: Its pivot there.
        sides_m: Sideways offset of each cylinder from the pivots.
    """

    ram: Ram
    barrel_link: Link
    barrel_m: Point
    rod_link: Link
    rod_m: Point
    sides_m: tuple[float, ...] = (0.0,)


def linkage_of(size: ExcavatorSize) -> DiggingArm:
    """Return the kinematics of a size."""
    k = size.bucket_m / 1.5
    return DiggingArm(
        swing_xy_m=(0.0, 0.0),
        foot_m=foot_of(size),
        boom_m=size.boom_m,
        arm_m=size.arm_m,
        bucket_m=size.bucket_m,
        rocker_xz_m=(size.arm_m - 0.42 * k, 0.02 * k),
        rocker_m=0.60 * k,
        tie_m=0.55 * k,
        ear_xz_m=(_EAR_XZ[0] * k, _EAR_XZ[1] * k),
    )


@lru_cache(maxsize=32)
def arm_meshes(size: ExcavatorSize) -> ArmMeshes:
    """Build the moving parts of a size."""
    k = size.bucket_m / 1.5
    bar = (0.09 * k, 0.12 * k)
    return ArmMeshes(
        boom=_boom(size),
        arm=_arm(size),
        bucket=_bucket(size),
        soil=_soil(size),
        rocker=join([beam((0.0, y_m * k, 0.0), (0.60 * k, y_m * k, 0.0), bar, None) for y_m in (-0.26, 0.26)]),
        tie=beam((0.0, 0.0, 0.0), (0.55 * k, 0.0, 0.0), (0.26 * k, 0.13 * k), None),
    )


def _scaled(outline: tuple[tuple[float, float], ...], length_m: float, depth_m: float) -> Outline:
    return [(x * length_m, z * depth_m) for x, z in outline]


def _boom(size: ExcavatorSize) -> Mesh:
    length_m, width_m = size.boom_m, size.boom_width_m
    # A long boom is slender: its depth does not grow with its length.
    depth_m = min(length_m, 6.4)
    body = profile(_scaled(_BOOM_OUTLINE, length_m, depth_m), width_m, None)
    cheek = _scaled(((0.86, 0.08), (0.95, 0.062), (1.015, 0.03), (1.03, 0.0), (1.01, -0.03), (0.86, -0.02)), length_m,
                    depth_m)  # fmt: skip
    cheeks = [profile(cheek, 0.06, None).at(0.0, side * (width_m / 2 - 0.01), 0.0) for side in (-1, 1)]
    pin = cylinder(0.017 * depth_m, width_m + 0.16, DARK_GREY, axis="y", sections=10)
    pins = [pin.at(x * length_m, 0.0, z * depth_m) for x, z in ((1.0, 0.0), (0.40, 0.16))]
    bracket = _scaled(((0.37, 0.2), (0.46, 0.2), (0.44, 0.272), (0.41, 0.272)), length_m, depth_m)
    ears = [profile(bracket, 0.05, None).at(0.0, y_m, 0.0) for y_m in (-0.13, 0.13)]
    hose = [(x * length_m, z * depth_m + 0.06) for x, z in ((0.05, 0.06), (0.33, 0.204), (0.45, 0.22), (0.94, 0.056))]
    hoses = [
        tube([(x, side * 0.36 * width_m, z) for x, z in hose], 0.028, BLACK, Surface.RUBBER, sections=5)
        for side in (-1, 1)
    ]
    board = _scaled(((0.56, 0.09), (0.80, 0.012), (0.80, 0.068), (0.56, 0.15)), length_m, depth_m)
    boards = profile(board, width_m + 0.012, DARK_GREY)
    light = lamp(0.13).at(0.30 * length_m, width_m / 2 + 0.1, 0.16 * depth_m)
    return join([body, *cheeks, *pins, *ears, *hoses, boards, light])


def _arm(size: ExcavatorSize) -> Mesh:
    length_m, width_m = size.arm_m, 0.68 * size.boom_width_m
    depth_m = min(length_m, 3.2)
    outline = [(x * (depth_m if x < 0.0 else length_m), z * depth_m) for x, z in _ARM_OUTLINE]
    pins = [cylinder(0.03 * depth_m, width_m + 0.14, DARK_GREY, axis="y", sections=10).at(x_m, 0.0, 0.0)
            for x_m in (0.0, length_m)]  # fmt: skip
    bracket = [(0.02 * depth_m, 0.13 * depth_m), (0.14 * depth_m, 0.13 * depth_m), (0.09 * depth_m, 0.225 * depth_m)]
    bracket.append((0.05 * depth_m, 0.225 * depth_m))
    ears = [profile(bracket, 0.04, None).at(0.0, y_m, 0.0) for y_m in (-0.11, 0.11)]
    path = [(-0.1 * depth_m, 0.3 * width_m, 0.16 * depth_m), (0.1 * depth_m, 0.3 * width_m, 0.17 * depth_m)]
    path.append((0.8 * length_m, 0.3 * width_m, 0.09 * depth_m))
    hose = tube(path, 0.025, BLACK, Surface.RUBBER, sections=5)
    return join([profile(outline, width_m, None), *pins, *ears, hose])


def _bucket_turn(size: ExcavatorSize) -> tuple[float, np.ndarray]:
    raise NotImplementedError
