"""The meshes of a wheel loader for one size: rear half with cab and engine, front half, lift arms, bucket."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from standoff_sim.machines.machine_parts import (
    beacon,
    beam,
    cab,
    exhaust,
    grille,
    handrail,
    hull,
    ladder,
    lamp,
    mirror,
    moulded,
    scoop,
    wheel,
)
from standoff_sim.machines.paint import BLACK, DARK_GREY, RED_LAMP
from standoff_sim.solids.loose_material import soil_heap
from standoff_sim.solids.mesh import Mesh, Surface, box, cylinder, join, profile, rotation, toned, translation

_SHELL = ((1.34, -0.30), (0.47, -0.33), (0.23, -0.25), (0.10, -0.02), (0.11, 0.25), (0.24, 0.55), (0.50, 0.80))
_EAR_XZ = (-0.10, 0.42)


@dataclass(frozen=True, slots=True)
class LoaderSize:
    """Main dimensions of one type, metres.

    Attributes:
        share: How often it is met, relative.
        wheelbase_m: Axle to axle; the joint is half-way.
        tyre_m: Diameter.
        tyre_width_m: Of each tyre.
        width_m: Over the tyres.
        bucket_width_m: Over all.
        hood_m: Top of the engine hood.
        cab_m: Top of the cab.
        toothed: The bucket has teeth.
        rounded: Soft edges.
    """

    share: float
    wheelbase_m: float
    tyre_m: float
    tyre_width_m: float
    width_m: float
    bucket_width_m: float
    hood_m: float
    cab_m: float
    toothed: bool = False
    rounded: bool = False

    @property
    def k(self) -> float:
        """Return the size against an 18 t machine's."""
        return self.wheelbase_m / 3.3

    @property
    def pivot_xz_m(self) -> tuple[float, float]:
        """Return the lift arms' pivot in the front half's frame."""
        return 0.62 * self.k, 2.02 * self.k

    @property
    def arm_m(self) -> float:
        """Return the distance from the lift arms' pivot to the bucket's."""
        return 2.4 * self.k

    @property
    def arm_y_m(self) -> float:
        """Return how far each lift arm is from the middle."""
        return 0.24 * self.width_m

    @property
    def tip_xz_m(self) -> tuple[float, float]:
        """Return the cutting edge, or the teeth's tips, in the bucket's frame."""
        return (_SHELL[0][0] + (self.tooth_m / self.k if self.toothed else 0.0)) * self.k, _SHELL[0][1] * self.k

    @property
    def tooth_m(self) -> float:
        """Return the length of the teeth."""
        return 0.2 * self.k

    @property
    def crank_m(self) -> tuple[float, float]:
        """Return the lengths of the tilt crank above and below its pivot."""
        return 0.72 * self.k, 0.70 * self.k

    @property
    def tie_m(self) -> float:
        """Return the length of the bar from the crank to the bucket."""
        return 0.82 * self.k

    @property
    def ear_xz_m(self) -> tuple[float, float]:
        """Return where the tie holds the bucket, bucket's frame."""
        return _EAR_XZ[0] * self.k, _EAR_XZ[1] * self.k


SIZES: tuple[LoaderSize, ...] = (
    LoaderSize(0.6, 2.55, 1.22, 0.42, 2.15, 2.25, 1.85, 2.75, rounded=True),
    LoaderSize(1.0, 2.95, 1.42, 0.50, 2.45, 2.6, 2.1, 3.15),
    LoaderSize(1.6, 3.3, 1.6, 0.58, 2.72, 2.95, 2.35, 3.4, toothed=True),
    LoaderSize(1.2, 3.35, 1.62, 0.6, 2.78, 3.0, 2.4, 3.42, rounded=True),
    LoaderSize(0.8, 3.55, 1.75, 0.66, 2.95, 3.2, 2.6, 3.55, rounded=True, toothed=True),
    LoaderSize(0.4, 3.7, 1.82, 0.7, 3.1, 3.4, 2.7, 3.65),
)


@dataclass(frozen=True, slots=True, eq=False)
class LoaderMeshes:
    """Each in its link's frame; those of the halves stand on the ground with the joint at x = 0."""

    hood: Mesh
    cab: Mesh
    rear_frame: Mesh
    front_frame: Mesh
    wheel: Mesh
    arms: Mesh
    crank: Mesh
    tie: Mesh
    bucket: Mesh
    soil: Mesh


@lru_cache(maxsize=16)
def loader_meshes(size: LoaderSize) -> LoaderMeshes:
    """Build all of a size."""
    k = size.k
    return LoaderMeshes(
        hood=join([*_hood(size), *_fenders(size, -1.0)]),
        cab=_cab(size),
        rear_frame=_rear_frame(size),
        front_frame=_front_frame(size),
        wheel=wheel(size.tyre_m / 2, size.tyre_width_m, None, lugs=16, sections=18, rim=0.5),
        arms=_arms(size),
        crank=profile([(-size.crank_m[0], -0.09), (-size.crank_m[0], 0.09), (0.0, 0.2 * k), (size.crank_m[1], 0.09),
                       (size.crank_m[1], -0.09), (0.0, -0.14 * k)], 0.16, None),
        tie=beam((0.0, 0.0, 0.0), (size.tie_m, 0.0, 0.0), (0.2, 0.12), None),
        bucket=_bucket(size),
        soil=_soil(size),
    )  # fmt: skip


def _hood(size: LoaderSize) -> list[Mesh]:
    k, top_m, base_m = size.k, size.hood_m, 0.62 * size.tyre_m
    rear_m, front_m, half_m = -0.5 * size.wheelbase_m - 1.55 * k, -1.42 * k, 0.32 * size.width_m
    chamfer_m = 0.2 if size.rounded else 0.07
    outline = [(front_m, half_m), (front_m, -half_m), (rear_m + 0.25, -half_m), (rear_m, -0.75 * half_m)]
    outline += [(rear_m, 0.75 * half_m), (rear_m + 0.25, half_m)]
    drop_m = 0.28 if size.rounded else 0.1
    body = moulded(outline, base_m, top_m - drop_m, chamfer_m, None)
    crest = hull(
        [(x, y, z) for x, z in ((front_m, top_m), (front_m, base_m + 0.2), (rear_m + 0.2, top_m - drop_m),
                                (rear_m + 0.2, base_m + 0.2)) for y in (-0.8 * half_m, 0.8 * half_m)],
        None,
    )  # fmt: skip
    length_m = front_m - rear_m
    vents = []
    for side, turn_deg in ((1.0, 0.0), (-1.0, 180.0)):
        vent = grille(0.45 * length_m, 0.4 * (top_m - base_m)).moved(rotation("z", turn_deg))
        vents.append(vent.at(rear_m + 0.45 * length_m, side * half_m, base_m + 0.55 * (top_m - base_m)))
    radiator = grille(1.3 * half_m, 0.6 * (top_m - base_m)).moved(rotation("z", 90.0))
    vents.append(radiator.at(rear_m, 0.0, base_m + 0.5 * (top_m - base_m)))
    louvre = box((0.3 * length_m, half_m, 0.03), DARK_GREY).at(rear_m + 0.35 * length_m, 0.0, top_m - 0.62 * drop_m)
    pipe = exhaust(0.55).at(front_m - 0.35 * length_m, 0.4 * half_m, top_m - 0.15)
    intake = cylinder(0.1, 0.3, BLACK, Surface.PLASTIC, sections=10).at(front_m - 0.25 * length_m, -0.4 * half_m, top_m)
    rails = [
        handrail([(front_m - 0.05, y_m, top_m + 0.35), (rear_m + 0.45 * length_m, y_m, top_m + 0.3)], BLACK,
                 floor_m=top_m - drop_m)
        for y_m in (-half_m + 0.05, half_m - 0.05)
    ]  # fmt: skip
    return [body, toned(crest, 0.97), *vents, louvre, pipe, intake, *rails]


def _fenders(size: LoaderSize, end: float) -> list[Mesh]:
    x_m, radius_m = end * size.wheelbase_m / 2, size.tyre_m / 2
    y_m = (size.width_m - size.tyre_width_m) / 2
    angles = np.deg2rad(np.linspace(35.0, 150.0, 7) if end < 0 else np.linspace(60.0, 165.0, 7))
    arc = [(x_m + (radius_m + 0.1) * np.cos(a), radius_m + (radius_m + 0.1) * np.sin(a)) for a in angles]
    arc += [(x_m + (radius_m + 0.06) * np.cos(a), radius_m + (radius_m + 0.06) * np.sin(a)) for a in angles[::-1]]
    fender = profile([(float(x), float(z)) for x, z in arc], size.tyre_width_m + 0.02, None)
    return [fender.at(0.0, side * y_m, 0.0) for side in (-1.0, 1.0)]


def _cab(size: LoaderSize) -> Mesh:
    k, floor_m = size.k, 0.62 * size.tyre_m + 0.2
    length_m, width_m = 1.35 * max(k, 0.9), 1.4 * max(k, 0.92)
    x_m = -0.05 * k - length_m / 2
    shell = cab(length_m, width_m, size.cab_m - floor_m, slant_m=0.18, sill=0.25).at(x_m, 0.0, floor_m)
    parts = [shell, beacon().at(x_m - 0.4, 0.35, size.cab_m - 0.01)]
    parts += [lamp().at(x_m + length_m / 2 - 0.18, y_m, size.cab_m + 0.04) for y_m in (-0.5, -0.3, 0.3, 0.5)]
    for left, side in ((True, 1.0), (False, -1.0)):
        parts.append(mirror(0.3, left=left).at(x_m + length_m / 2 - 0.1, side * width_m / 2, size.cab_m - 0.5))
    return join(parts)


def _rear_frame(size: LoaderSize) -> Mesh:
    k, axle_m = size.k, size.tyre_m / 2
    rear_m, half_m = -0.5 * size.wheelbase_m - 1.6 * k, 0.36 * size.width_m
    chassis = box((-rear_m - 0.25, 0.32 * size.width_m, 0.55 * k), None).at((rear_m - 0.15) / 2, 0.0, 0.55 * axle_m)
    weight = moulded([(rear_m + 0.5 * k, -half_m), (rear_m + 0.5 * k, half_m), (rear_m + 0.12, half_m),
                      (rear_m - 0.02, 0.7 * half_m), (rear_m - 0.02, -0.7 * half_m), (rear_m + 0.12, -half_m)],
                     0.55 * axle_m + 0.12, 1.35 * axle_m + 0.1, 0.06, None)  # fmt: skip
    axle = cylinder(0.2 * k, size.width_m - size.tyre_width_m, None, axis="y", sections=10)
    deck = box((1.5 * k, size.width_m - 0.3, 0.1), None).at(-0.85 * k, 0.0, 1.3 * axle_m)
    parts = [chassis, weight, axle.at(-size.wheelbase_m / 2, 0.0, axle_m), deck]
    for side in (-1.0, 1.0):
        y_m = side * (size.width_m / 2 - 0.2)
        parts.append(box((0.9 * k, 0.36, 0.5 * k), None).at(-0.45 * k, side * (size.width_m / 2 - 0.42), 0.75 * axle_m))
        parts.append(ladder((-0.45 * k, y_m, 0.45), 1.3 * axle_m - 0.4, 0.45, BLACK, steps=3))
        for x_m in (-0.12 * k, -0.78 * k):
            parts.append(handrail([(x_m, y_m, 1.3 * axle_m), (x_m, y_m, 1.3 * axle_m + 0.9)], BLACK))
        parts.append(
            box((0.04, 0.25, 0.12), RED_LAMP, Surface.GLASS).at(rear_m + 0.08, side * 0.8 * half_m, 1.15 * axle_m)
        )
    return join(parts)


def _front_frame(size: LoaderSize) -> Mesh:
    k, axle_m = size.k, size.tyre_m / 2
    pivot_x_m, pivot_z_m = size.pivot_xz_m
    front_m = size.wheelbase_m / 2 + 0.35 * k
    chassis = box((front_m, 0.3 * size.width_m, 0.6 * k), None).at(front_m / 2 + 0.05, 0.0, 0.55 * axle_m)
    axle = cylinder(0.2 * k, size.width_m - size.tyre_width_m, None, axis="y", sections=10)
    tower = [(0.12 * k, 0.9 * axle_m), (1.75 * k, 0.9 * axle_m), (1.6 * k, 1.35 * axle_m), (1.0 * k, 1.6 * axle_m)]
    tower += [(pivot_x_m + 0.2 * k, pivot_z_m + 0.08), (pivot_x_m, pivot_z_m + 0.17 * k)]
    tower += [(pivot_x_m - 0.17 * k, pivot_z_m)]
    inner_m = size.arm_y_m - 0.12
    plates = [profile(tower, 0.07, None).at(0.0, side * inner_m, 0.0) for side in (-1.0, 1.0)]
    cross = box((0.3 * k, 2 * inner_m, 0.25), None).at(pivot_x_m, 0.0, pivot_z_m - 0.35)
    pin = cylinder(0.1 * k, 2 * size.arm_y_m + 0.3, DARK_GREY, axis="y", sections=10).at(pivot_x_m, 0.0, pivot_z_m)
    lights = []
    for side in (-1.0, 1.0):
        y_m = side * (0.5 * size.width_m - 0.3)
        stem = beam((1.0 * k, side * inner_m, 1.5 * axle_m), (1.05 * k, y_m, size.tyre_m + 0.25), (0.06, 0.06), None)
        lights += [stem, lamp(0.2).at(1.1 * k, y_m, size.tyre_m + 0.33)]
    return join([chassis, axle.at(size.wheelbase_m / 2, 0.0, axle_m), *plates, cross, pin, *lights,
                 *_fenders(size, 1.0)])  # fmt: skip


def _arms(size: LoaderSize) -> Mesh:
    k, length_m = size.k, size.arm_m
    upper = [
        (-0.16, 0.0),
        (-0.1, 0.13),
        (0.5, 0.34),
        (1.15, 0.46),
        (1.5, 0.42),
        (2.1, 0.14),
        (2.45, 0.1),
        (2.52, -0.02),
    ]
    lower = [(2.4, -0.13), (2.0, -0.16), (1.45, 0.06), (1.1, 0.08), (0.5, 0.02), (0.0, -0.13)]
    outline = [(x * k, z * k) for x, z in (*upper, *lower)]
    arms = [profile(outline, 0.13 * k, None).at(0.0, side * size.arm_y_m, 0.0) for side in (-1.0, 1.0)]
    across = cylinder(0.13 * k, 2 * size.arm_y_m, None, axis="y", sections=10).at(1.35 * k, 0.0, 0.24 * k)
    cheeks = [
        profile([(1.15 * k, 0.15 * k), (1.55 * k, 0.15 * k), (1.47 * k, 0.62 * k), (1.33 * k, 0.62 * k)], 0.06, None)
        .at(0.0, y_m, 0.0) for y_m in (-0.15, 0.15)
    ]  # fmt: skip
    pin = cylinder(0.08 * k, 2 * size.arm_y_m + 0.3 * k, DARK_GREY, axis="y", sections=8)
    return join([*arms, across, *cheeks, pin.at(length_m, 0.0, 0.0)])


def _path(size: LoaderSize) -> list[tuple[float, float]]:
    return [(x * size.k, z * size.k) for x, z in _SHELL]


def _bucket(size: LoaderSize) -> Mesh:
    k = size.k
    shell = scoop(_path(size), size.bucket_width_m, None, plate_m=0.05)
    edge = box((0.22 * k, size.bucket_width_m + 0.04, 0.035), DARK_GREY, Surface.STEEL)
    parts = [shell, edge.at((_SHELL[0][0] - 0.11) * k, 0.0, _SHELL[0][1] * k - 0.0175)]
    if size.toothed:
        wedge = [(-0.12, -0.03), (-0.12, 0.06), (0.0, 0.05), (size.tooth_m, 0.0), (0.0, -0.03)]
        tooth = profile(wedge, 0.11, DARK_GREY, Surface.STEEL)
        for y_m in np.linspace(-0.5, 0.5, 8) * (size.bucket_width_m - 0.12):
            parts.append(tooth.at(_SHELL[0][0] * k, float(y_m), _SHELL[0][1] * k))
    ears = [(-0.14, -0.14), (0.2, -0.2), (0.2, 0.5), (-0.18, 0.52)]
    outline = [(x * k, z * k) for x, z in ears]
    for y_m in (-size.arm_y_m - 0.12, -0.16, 0.16, size.arm_y_m + 0.12):
        parts.append(profile(outline, 0.05, None, Surface.STEEL).at(0.0, y_m, 0.0))
    spill = _path(size)[-1]
    parts.append(box((0.06, 0.86 * size.bucket_width_m, 0.2), None, Surface.STEEL).at(spill[0], 0.0, spill[1] - 0.02))
    return join(parts)


def _soil(size: LoaderSize) -> Mesh:
    (lip_x_m, lip_z_m), (rear_x_m, rear_z_m) = _path(size)[0], _path(size)[-1]
    length_m = float(np.hypot(lip_x_m - rear_x_m, lip_z_m - rear_z_m))
    heap = soil_heap(0.98 * length_m, 0.97 * size.bucket_width_m, 0.36 * length_m, None, seed=round(100 * size.tyre_m))
    # The mouth runs from the upper rear edge down to the lip: its outer side is the heap's upper one.
    tilt = rotation("y", float(np.rad2deg(np.arctan2(rear_z_m - lip_z_m, lip_x_m - rear_x_m))))
    return heap.moved(translation((lip_x_m + rear_x_m) / 2, 0.0, (lip_z_m + rear_z_m) / 2) @ tilt)
