"""A wheel loader: two halves that fold at a joint, lift arms, a tilting bucket, four big wheels.

The local frame's origin is on the ground under the joint, half-way between the axles. Joints: steer_deg (positive
turns left; each half turns by half of it), lift_deg (elevation of the line from the lift arms' pivot to the bucket's),
bucket_deg (elevation of the bucket's floor: 0 flat, positive rolled back, negative dumping), travel_m (distance gone),
load (0 empty .. 1 heaped bucket).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff_sim.machines.digging import knee_m
from standoff_sim.machines.joints import UNBOUNDED_M, settle
from standoff_sim.machines.loader_meshes import SIZES, LoaderMeshes, LoaderSize, loader_meshes
from standoff_sim.machines.machine_parts import Ram, highest_m, ram_poses, rectangle, strut_pose
from standoff_sim.machines.paint import SOILS, Livery, Painted, draw_livery, weather
from standoff_sim.scene.scene import Batch, moved
from standoff_sim.solids.mesh import Colour, rotation, scaling, srgb, translation

LIMITS: Mapping[str, tuple[float, float]] = {
    "steer_deg": (-38.0, 38.0),
    "lift_deg": (-44.0, 44.0),
    "bucket_deg": (-48.0, 48.0),
    "travel_m": UNBOUNDED_M,
    "load": (0.0, 1.0),
}
_REST = {"lift_deg": -36.0, "bucket_deg": 8.0}


@dataclass(frozen=True, slots=True, eq=False)
class LoaderColours:
    """Tints of one machine."""

    livery: Livery
    cab: Colour
    rims: Colour
    soil: Colour


@dataclass(frozen=True, slots=True, eq=False)
class WheelLoader:
    """A wheel loader's shape and colours; implements `standoff_sim.scene.scene.Model`.

    Attributes:
        size: Its type.
        meshes: Of that type.
        colours: Its own.
        footprint_m: (4, 2) outline of the wheels when going straight, counter-clockwise.
        height_m: Highest point in rest position.
        joints: Limits of all joints.
        scale: Size against the type's.
        class_id: Of "wheel_loader".
    """

    size: LoaderSize
    meshes: LoaderMeshes
    colours: LoaderColours
    footprint_m: FloatArray
    height_m: float
    joints: Mapping[str, tuple[float, float]]
    scale: float = 1.0
    class_id: int = CLASS_BY_NAME["wheel_loader"].id

    def parts(self, joints: Mapping[str, float]) -> tuple[Batch, ...]:
        """Return all rigid parts; joints that are not given are at rest, others held within their limits."""
        settled = settle(joints, self.joints, _REST)
        batches = (*self._halves(settled), *self._linkage(settled))
        larger = scaling(self.scale, self.scale, self.scale)
        return moved(batches, larger)

    def _halves(self, joints: Mapping[str, float]) -> list[Batch]:
        meshes, colours, dust = self.meshes, self.colours, self.colours.livery.dust
        front, rear = rotation("z", joints["steer_deg"] / 2), rotation("z", -joints["steer_deg"] / 2)
        radius_m = self.size.tyre_m / 2
        half_m = (self.size.width_m - self.size.tyre_width_m) / 2
        rolled = rotation("y", float(np.rad2deg(joints["travel_m"] / self.scale / radius_m)))
        wheels = np.stack([
            half @ translation(end * self.size.wheelbase_m / 2, side * half_m, radius_m) @ rolled
            for half, end in ((rear, -1.0), (front, 1.0)) for side in (-1.0, 1.0)
        ])  # fmt: skip
        return [
            Painted(meshes.hood, colours.livery.body, dust).at(rear),
            Painted(meshes.cab, colours.cab, dust).at(rear),
            Painted(meshes.rear_frame, colours.livery.frame, dust).at(rear),
            Painted(meshes.front_frame, colours.livery.boom, dust).at(front),
            Painted(meshes.wheel, colours.rims, min(1.0, dust + 0.25)).at(wheels),
        ]

    def _linkage(self, joints: Mapping[str, float]) -> list[Batch]:
        meshes, livery, size = self.meshes, self.colours.livery, self.size
        front = rotation("z", joints["steer_deg"] / 2)
        arms, bucket = arm_and_bucket_poses(size, joints)
        crank_pivot, crank_top, crank_end, ear = crank_points_m(size, joints)
        crank = strut_pose(crank_top, crank_end)
        crank[:3, 3] = crank_pivot
        lift_ram, tilt_ram = loader_rams(size)
        lift_barrels, lift_rods = zip(*(ram_poses(*ends) for ends in lift_pivots_m(size, joints)), strict=True)
        tilt_barrel, tilt_rod = ram_poses(tilt_pivot_m(size), crank_top)
        dust = livery.dust
        batches = [
            Painted(meshes.arms, livery.boom, dust).at(front @ arms),
            Painted(meshes.crank, livery.boom, dust).at(front @ crank),
            Painted(meshes.tie, livery.boom, dust).at(front @ strut_pose(crank_end, ear)),
            Painted(meshes.bucket, livery.tool, max(dust, 0.5)).at(front @ bucket),
            Painted(lift_ram.barrel, livery.boom, dust).at(front @ np.stack(lift_barrels)),
            Painted(lift_ram.rod, livery.boom, dust).at(front @ np.stack(lift_rods)),
            Painted(tilt_ram.barrel, livery.boom, dust).at(front @ tilt_barrel),
            Painted(tilt_ram.rod, livery.boom, dust).at(front @ tilt_rod),
        ]
        if joints["load"] > 0.0:
            sunk = (1.0 - joints["load"]) * 0.4 * size.k
            soil = Painted(meshes.soil, self.colours.soil, 0.0)
            batches.append(soil.at(front @ bucket @ translation(-0.7 * sunk, 0.0, -0.7 * sunk)))
        return batches

    def tool_tip_m(self, joints: Mapping[str, float]) -> FloatArray:
        """Return (3,) middle of the bucket's cutting edge, local frame."""
        settled = settle(joints, self.joints, _REST)
        _, bucket = arm_and_bucket_poses(self.size, settled)
        tip_x_m, tip_z_m = self.size.tip_xz_m
        tip = rotation("z", settled["steer_deg"] / 2) @ bucket @ [tip_x_m, 0.0, tip_z_m, 1.0]
        scaled: FloatArray = self.scale * tip[:3]
        return scaled


def arm_and_bucket_poses(size: LoaderSize, joints: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
    """Return the (4, 4) poses of lift arms and bucket in the front half's frame."""
    pivot_x_m, pivot_z_m = size.pivot_xz_m
    arms = translation(pivot_x_m, 0.0, pivot_z_m) @ rotation("y", -joints["lift_deg"])
    held = arms @ translation(size.arm_m, 0.0, 0.0)
    return arms, held @ rotation("y", joints["lift_deg"] - joints["bucket_deg"])


def crank_points_m(
    size: LoaderSize, joints: Mapping[str, float]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the crank's pivot, its upper and lower end and the bucket's ear, (3,) each in the front half's frame."""
    k = size.k
    arms, bucket = arm_and_bucket_poses(size, joints)
    pivot = (arms @ [1.40 * k, 0.0, 0.5 * k, 1.0])[:3]
    ear = (bucket @ [size.ear_xz_m[0], 0.0, size.ear_xz_m[1], 1.0])[:3]
    # The lower end hangs below the line to the ear.
    end = knee_m(ear, pivot, size.tie_m, size.crank_m[1])
    return pivot, pivot - (end - pivot) * size.crank_m[0] / size.crank_m[1], end, ear


def tilt_pivot_m(size: LoaderSize) -> FloatArray:
    """Return (3,) where the tilt cylinder's barrel is held, front half's frame."""
    return np.array([size.pivot_xz_m[0] + 0.02, 0.0, size.pivot_xz_m[1] - 0.2])


def lift_pivots_m(size: LoaderSize, joints: Mapping[str, float]) -> list[tuple[FloatArray, FloatArray]]:
    """Return barrel and rod pivots of both lift cylinders, (3,) each in the front half's frame."""
    arms, _ = arm_and_bucket_poses(size, joints)
    pairs = []
    for side in (-1.0, 1.0):
        y_m = side * (size.arm_y_m - 0.02)
        barrel = np.array([0.42 * size.k, y_m, 0.92 * size.k])
        pairs.append((barrel, (arms @ [1.25 * size.k, y_m, 0.16 * size.k, 1.0])[:3]))
    return pairs


@lru_cache(maxsize=16)
def loader_rams(size: LoaderSize) -> tuple[Ram, Ram]:
    """Build lift and tilt cylinders, as long as the joints' limits ask for."""
    lift_m, tilt_m = [], []
    for lift_deg in np.linspace(*LIMITS["lift_deg"], 15):
        for bucket_deg in np.linspace(*LIMITS["bucket_deg"], 9):
            joints = {"lift_deg": float(lift_deg), "bucket_deg": float(bucket_deg)}
            barrel, rod = lift_pivots_m(size, joints)[0]
            lift_m.append(float(np.linalg.norm(rod - barrel)))
            tilt_m.append(float(np.linalg.norm(crank_points_m(size, joints)[1] - tilt_pivot_m(size))))
    return (
        Ram.spanning(min(lift_m), max(lift_m), 0.085 * size.k),
        Ram.spanning(min(tilt_m), max(tilt_m), 0.09 * size.k),
    )


def make_wheel_loader(rng: np.random.Generator) -> WheelLoader:
    """Draw a type, colours and wear."""
    shares = np.array([size.share for size in SIZES])
    return build_wheel_loader(SIZES[rng.choice(len(SIZES), p=shares / shares.sum())], rng)


def build_wheel_loader(size: LoaderSize, rng: np.random.Generator) -> WheelLoader:
    """Build one of a given type; colours, wear and a few per cent of scale are drawn."""
    livery, scale = draw_livery(rng), float(rng.uniform(0.96, 1.04))
    dark = weather(rng, srgb("#3a3b3c"))
    colours = LoaderColours(
        livery=livery,
        cab=(livery.body, dark)[rng.choice(2, p=(0.6, 0.4))],
        rims=(livery.body, weather(rng, srgb("#b9b6ad")), dark)[rng.choice(3, p=(0.6, 0.2, 0.2))],
        soil=weather(rng, srgb(SOILS[rng.integers(len(SOILS))])),
    )
    footprint = scale * rectangle(size.wheelbase_m + size.tyre_m, size.width_m)
    model = WheelLoader(size, loader_meshes(size), colours, footprint, 0.0, LIMITS, scale)
    return replace(model, height_m=highest_m(model.parts({})))
