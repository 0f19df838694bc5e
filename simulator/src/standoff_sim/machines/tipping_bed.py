"""Beds that tip: of road tippers with a tailgate, of articulated haulers with a chute; with what they carry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.machines.machine_parts import strut_pose
from standoff_sim.machines.paint import CHROME, Painted
from standoff_sim.scene.scene import Batch
from standoff_sim.solids.bars import bars
from standoff_sim.solids.loose_material import heap
from standoff_sim.solids.mesh import Mesh, Surface, box, cylinder, join, profile, rotation, scaling, srgb, translation

_LOADS = (
    ("#8d7658", "#7d6648", "#9c8767"),
    ("#6e5b45", "#5a4a38", "#7d6a52"),
    ("#b9a274", "#a8936a", "#c4b084"),
    ("#8f8a80", "#a39b8c", "#77736a"),
    ("#9b6b48", "#86593c", "#a87d5a"),
    ("#a39b8c", "#7d5b48", "#c9c4b8"),
)
LOAD_VARIANTS = len(_LOADS)
_EMPTY = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Bed:
    """A bed in a frame of its own, fixed to the chassis that carries it.

    Attributes:
        mount_m: Where that frame's origin is on the chassis.
        tub: Floor and walls, as they stand when lowered.
        gate: Tailgate that hangs from its hinge, or None.
        cargo: A heap on z = 0 with a height of one metre.
        pivot_xz_m: Axis that the bed turns about.
        hinge_xz_m: Axis that the tailgate hangs from.
        floor_m: (3,) middle of the floor under the cargo.
        fill_m: Depth of a full load below the heap.
        heap_m: Height of the heap on a full load.
        ram_m: (2, 3) foot on the chassis and head on the lowered bed.
        ram_sides_m: y of each ram.
    """

    mount_m: tuple[float, float, float]
    tub: Painted
    gate: Painted | None
    cargo: Painted
    pivot_xz_m: tuple[float, float]
    hinge_xz_m: tuple[float, float]
    floor_m: tuple[float, float, float]
    fill_m: float
    heap_m: float
    ram_m: tuple[tuple[float, float, float], tuple[float, float, float]]
    ram_sides_m: tuple[float, ...]

    def batches(self, bed_deg: float, load: float, pose: FloatArray) -> tuple[Batch, ...]:
        """Return the bed, its load and its rams on a chassis at the (4, 4) `pose`."""
        pose = pose @ translation(*self.mount_m)
        lift = pose @ _about(self.pivot_xz_m, -bed_deg)
        parts = [self.tub.at(lift)]
        if self.gate is not None:
            x_m, z_m = self.hinge_xz_m
            parts.append(self.gate.at(lift @ translation(x_m, 0.0, z_m) @ rotation("y", bed_deg)))
        if load > _EMPTY:
            x_m, y_m, z_m = self.floor_m
            level = translation(x_m, y_m, z_m + self.fill_m * load**0.7) @ scaling(1.0, 1.0, self.heap_m * load)
            parts.append(self.cargo.at(lift @ level))
        foot, head = (np.array([*point, 1.0]) for point in self.ram_m)
        head = _about(self.pivot_xz_m, -bed_deg) @ head
        sides = np.stack([translation(0.0, y_m, 0.0) for y_m in self.ram_sides_m])
        stretched = strut_pose(foot[:3], head[:3]) @ scaling(float(np.linalg.norm(head - foot)), 1.0, 1.0)
        return (*parts, Painted(_telescope(), CHROME, 0.3).at(pose @ sides @ stretched))


def _about(axis_xz_m: tuple[float, float], angle_deg: float) -> FloatArray:
    x_m, z_m = axis_xz_m
    pose: FloatArray = translation(x_m, 0.0, z_m) @ rotation("y", angle_deg) @ translation(-x_m, 0.0, -z_m)
    return pose


@lru_cache(maxsize=1)
def _telescope() -> Mesh:
    stages = [
        cylinder(r, 0.35, None, axis="x", sections=8).at(x, 0.0, 0.0)
        for r, x in ((0.1, 0.18), (0.08, 0.5), (0.06, 0.82))
    ]
    return join(stages)


@lru_cache(maxsize=16)
def cargo(variant: int, length_m: float, width_m: float) -> Mesh:
    """Return a heap of one of `LOAD_VARIANTS` materials, one metre high."""
    rng = np.random.default_rng([41, variant])
    colours = [srgb(code) for code in _LOADS[variant]]
    return heap(rng, (length_m, width_m, 1.0), colours, lumps=10 if variant == LOAD_VARIANTS - 1 else 0)


@lru_cache(maxsize=16)
def tipper_tub(length_m: float, wall_m: float, ribs: int, hood: bool) -> Mesh:
    """Return a tipper's box without tailgate: floor on z = 0, rear end at x = 0, 2.46 m wide."""
    width_m, plate_m = 2.46, 0.07
    half_m = width_m / 2
    inside = srgb("#5c5852")
    side = [(0.0, 0.0), (length_m, 0.0), (length_m, wall_m), (0.0, wall_m)]
    walls = [profile(side, plate_m, None).at(0.0, s * (half_m - plate_m / 2), 0.0) for s in (-1, 1)]
    worn = [
        profile(side, 0.01, inside, Surface.STEEL).moved(
            translation(0.1, s * (half_m - plate_m - 0.006), 0.04) @ scaling((length_m - 0.2) / length_m, 1, 0.9)
        )
        for s in (-1, 1)
    ]
    front = box((plate_m, width_m, wall_m + 0.25), None).at(length_m - plate_m / 2, 0.0, 0.0)
    floor = box((length_m, width_m - 0.1, 0.1), inside, Surface.STEEL).at(length_m / 2, 0.0, 0.0)
    rims = [((0, s * (half_m - 0.03), wall_m), (length_m, s * (half_m - 0.03), wall_m)) for s in (-1, 1)]
    posts_x = np.linspace(0.15, length_m - 0.15, ribs)
    posts = [((x, s * (half_m + 0.01), 0.0), (x, s * (half_m + 0.01), wall_m)) for x in posts_x for s in (-1, 1)]
    beams = [((0.0, s * 0.5, -0.08), (length_m, s * 0.5, -0.08)) for s in (-1, 1)]
    parts = [*walls, *worn, front, floor, bars(np.array([*rims, *posts]), 0.11, None, Surface.PAINT)]
    parts.append(bars(np.array(beams), 0.14, None, Surface.PAINT))
    if hood:
        parts.append(box((0.75, width_m - 0.3, 0.06), None).at(length_m + 0.3, 0.0, wall_m + 0.22))
    return join(parts)


@lru_cache(maxsize=8)
def tipper_gate(wall_m: float) -> Mesh:
    """Return a tailgate that hangs from y's axis at the origin."""
    outer = box((0.06, 2.4, wall_m), None).at(-0.04, 0.0, -wall_m)
    posts = [((-0.09, y, -wall_m), (-0.09, y, 0.05)) for y in (-1.1, -0.37, 0.37, 1.1)]
    return join([outer, bars(np.array(posts), 0.09, None, Surface.PAINT)])


@lru_cache(maxsize=1)
def hauler_tub() -> Mesh:
    """Return a hauler's bed with its chute, in the machine's frame: flared walls, open behind."""
    side = [(1.45, 1.75), (1.3, 1.5), (-2.6, 1.45), (-5.1, 2.2), (-5.15, 2.5), (-4.0, 2.75), (1.5, 2.85)]
    flare_m, half_m, plate_m = 0.24, 1.2, 0.09
    shear = np.eye(4)
    walls = []
    for sign in (-1.0, 1.0):
        shear[1, 2], shear[1, 3] = sign * flare_m / 1.2, sign * (half_m - 1.45 * flare_m / 1.2)
        walls.append(profile(side, plate_m, None).moved(shear))
        inside = profile(
            [(0.97 * x, z if z > 2.3 else z + 0.02) for x, z in side], 0.02, srgb("#5f5a52"), Surface.STEEL
        )
        inward = shear.copy()
        inward[1, 3] -= sign * 0.05
        inward[2, 3] -= 0.04
        walls.append(inside.moved(inward))
    floor_outline = [(1.4, 1.62), (1.3, 1.5), (-2.6, 1.45), (-5.12, 2.22), (-5.1, 2.32), (-2.55, 1.57)]
    floor = profile(floor_outline, 2 * half_m + 0.1, srgb("#5f5a52"), Surface.STEEL)
    front = profile([(1.3, 1.5), (1.42, 1.5), (1.62, 3.05), (1.52, 3.05)], 2 * half_m + 0.35, None)
    spill = profile([(1.5, 3.0), (2.0, 3.2), (2.0, 3.24), (1.5, 3.08)], 2.3, None)
    rims = [((1.5, s * 1.49, 2.86), (-4.0, s * 1.47, 2.76)) for s in (-1, 1)]
    rims += [((-4.0, s * 1.47, 2.76), (-5.15, s * 1.42, 2.5)) for s in (-1, 1)]
    ribs = [((x, s * 1.26, 1.5), (x, s * 1.5, 2.75)) for x in (0.9, -0.3, -1.5, -2.7) for s in (-1, 1)]
    return join([*walls, floor, front, spill, bars(np.array([*rims, *ribs]), 0.13, None, Surface.PAINT)])
