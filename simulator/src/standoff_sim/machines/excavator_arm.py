"""Boom, arm, bucket and their cylinders for one size of excavator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely

from standoff_sim.machines.digging import DiggingArm, Link
from standoff_sim.machines.excavator_body import foot_of
from standoff_sim.machines.excavator_sizes import ExcavatorSize
from standoff_sim.machines.machine_parts import Point, Ram, beam, lamp, scoop
from standoff_sim.machines.paint import BLACK, DARK_GREY
from standoff_sim.solids.loose_material import soil_heap
from standoff_sim.solids.mesh import Mesh, Surface, cylinder, join, profile, rotation, translation, tube

Outline = list[tuple[float, float]]

RamPlan = tuple[Link, Point, Link, Point, tuple[float, ...]]
"""What holds the barrel, where; what the rod moves, where; sideways offsets."""

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


def _bucket_shell(size: ExcavatorSize) -> tuple[Outline, float]:
    """Return the shell's path and the teeth's length, turned and scaled so that the tip is on x at `bucket_m`."""
    path = np.array(_SHELL)
    ahead = (path[0] - path[1]) / np.linalg.norm(path[0] - path[1])
    tooth_m = 0.0 if size.grading else _TOOTH_M
    tip = path[0] + tooth_m * ahead
    length, angle = np.hypot(*tip), np.arctan2(tip[1], tip[0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    scale = size.bucket_m / float(length)
    return [(float(x), float(z)) for x, z in path @ turn * scale], tooth_m * scale


def _bucket(size: ExcavatorSize) -> Mesh:
    path, tooth_m = _bucket_shell(size)
    k = size.bucket_m / 1.5
    teeth = 0 if size.grading else max(4, round(size.bucket_width_m / 0.27))
    shell = scoop(path, size.bucket_width_m, None, teeth=teeth, tooth_m=tooth_m, plate_m=0.045)
    around = shapely.MultiPoint([(0.0, 0.0), _EAR_XZ]).buffer(0.11).union(shapely.Point(0.45, 0.5).buffer(0.08))
    ear = [(x * k, z * k) for x, z in around.convex_hull.simplify(0.015).exterior.coords]
    ears = [profile(ear, 0.05 * k, None, Surface.STEEL).at(0.0, y_m * k, 0.0) for y_m in (-0.17, 0.17)]
    pins = [
        cylinder(0.05 * k, 0.62 * k, DARK_GREY, axis="y", sections=8).at(x * k, 0.0, z * k)
        for x, z in ((0.0, 0.0), _EAR_XZ)
    ]
    return join([shell, *ears, *pins])


def _soil(size: ExcavatorSize) -> Mesh:
    path, _ = _bucket_shell(size)
    (lip_x_m, lip_z_m), (rear_x_m, rear_z_m) = path[0], path[-1]
    length_m = float(np.hypot(lip_x_m - rear_x_m, lip_z_m - rear_z_m))
    heap = soil_heap(0.98 * length_m, 0.96 * size.bucket_width_m, 0.3 * length_m, None, seed=round(100 * size.boom_m))
    tilt = rotation("y", -float(np.rad2deg(np.arctan2(lip_z_m - rear_z_m, lip_x_m - rear_x_m))))
    middle = translation((lip_x_m + rear_x_m) / 2, 0.0, (lip_z_m + rear_z_m) / 2)
    return heap.moved(middle @ tilt @ rotation("x", 180.0))


@lru_cache(maxsize=32)
def ram_mounts(size: ExcavatorSize, limits: tuple[tuple[str, tuple[float, float]], ...]) -> tuple[RamMount, ...]:
    """Build boom, arm and bucket cylinders, each as long as the joints' limits ask for."""
    linkage = linkage_of(size)
    boom_depth_m, arm_depth_m = min(size.boom_m, 6.4), min(size.arm_m, 3.2)
    x_m, y_m, z_m = linkage.foot_m
    beside_m = size.boom_width_m / 2 + 0.1
    stout_m = 0.05 + 0.008 * boom_depth_m
    low_m = 0.105 * boom_depth_m
    plans = (
        (Link.UPPER, (x_m + low_m, y_m, z_m - low_m), Link.BOOM, (0.40 * size.boom_m, 0.0, 0.16 * boom_depth_m),
         (-beside_m, beside_m)),
        (Link.BOOM, (0.425 * size.boom_m, 0.0, 0.255 * boom_depth_m), Link.ARM,
         (-0.265 * arm_depth_m, 0.0, 0.045 * arm_depth_m), (0.0,)),
        (Link.ARM, (0.07 * arm_depth_m, 0.0, 0.205 * arm_depth_m), Link.TIE, (0.0, 0.0, 0.0), (0.0,)),
    )  # fmt: skip
    return mount_rams(linkage, plans, dict(limits), stout_m)


def mount_rams(
    linkage: DiggingArm, plans: Sequence[RamPlan], limits: Mapping[str, tuple[float, float]], radius_m: float
) -> tuple[RamMount, ...]:
    """Build a hydraulic cylinder for each plan, as long as the joints' limits ask for."""
    mounts = []
    for barrel_link, barrel_m, rod_link, rod_m, sides_m in plans:
        shortest_m, longest_m = span_range(linkage, limits, (barrel_link, barrel_m), (rod_link, rod_m))
        ram = Ram.spanning(shortest_m, longest_m, radius_m)
        mounts.append(RamMount(ram, barrel_link, barrel_m, rod_link, rod_m, sides_m))
    return tuple(mounts)


def span_range(
    linkage: DiggingArm, limits: Mapping[str, tuple[float, float]], barrel: tuple[Link, Point], rod: tuple[Link, Point]
) -> tuple[float, float]:
    """Return the shortest and longest distance of two pivots within the joints' limits."""
    spans_m = []
    for share in np.linspace(0.0, 1.0, 25):
        joints = {name: low + float(share) * (high - low) for name, (low, high) in limits.items()}
        frames = linkage.frames(joints)
        ends = [(frames[link] @ [*point_m, 1.0])[:3] for link, point_m in (barrel, rod)]
        spans_m.append(float(np.linalg.norm(ends[1] - ends[0])))
    return min(spans_m), max(spans_m)
