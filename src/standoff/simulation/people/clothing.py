"""Meshes of a body in workwear, modelled at the reference stature; each frame's origin is the upper joint."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from standoff.core.homography import FloatArray
from standoff.simulation.mesh import Mesh, Surface, join, rotation, srgb
from standoff.simulation.people.gait import Sole
from standoff.simulation.people.loft import Ring, even_columns, keep, loft

_TAPE = srgb("#b9bcba")
_LEATHER = srgb("#3a2f26")
BUILDS = ("slim", "average", "heavy")

_CHEST: dict[str, tuple[Ring, ...]] = {
    "slim": (
        (-0.10, 0.000, 0.118, 0.172), (-0.02, 0.000, 0.108, 0.158), (0.10, 0.000, 0.106, 0.156),
        (0.22, 0.008, 0.118, 0.172), (0.31, 0.004, 0.112, 0.186), (0.365, -0.004, 0.090, 0.180),
        (0.400, -0.008, 0.072, 0.128), (0.430, -0.006, 0.058, 0.070),
    ),
    "average": (
        (-0.10, 0.000, 0.128, 0.176), (-0.02, 0.006, 0.124, 0.168), (0.10, 0.008, 0.122, 0.168),
        (0.22, 0.010, 0.128, 0.180), (0.31, 0.004, 0.120, 0.192), (0.365, -0.004, 0.094, 0.184),
        (0.400, -0.008, 0.076, 0.132), (0.430, -0.006, 0.060, 0.074),
    ),
    "heavy": (
        (-0.10, 0.018, 0.142, 0.182), (-0.02, 0.034, 0.156, 0.184), (0.10, 0.030, 0.150, 0.182),
        (0.22, 0.016, 0.138, 0.186), (0.31, 0.006, 0.126, 0.194), (0.365, -0.004, 0.098, 0.186),
        (0.400, -0.008, 0.080, 0.136), (0.430, -0.006, 0.064, 0.078),
    ),
}  # fmt: skip
_PELVIS: tuple[Ring, ...] = (
    (-0.115, -0.005, 0.050, 0.075), (-0.07, -0.008, 0.100, 0.150), (0.00, -0.010, 0.118, 0.172),
    (0.07, -0.004, 0.114, 0.164), (0.13, 0.002, 0.112, 0.156), (0.16, 0.002, 0.085, 0.120),
)  # fmt: skip
_THIGH: tuple[Ring, ...] = (
    (-0.455, 0.005, 0.035, 0.033), (-0.425, 0.004, 0.062, 0.060), (-0.300, 0.004, 0.072, 0.070),
    (-0.120, 0.002, 0.088, 0.084), (0.000, -0.004, 0.092, 0.084), (0.060, -0.006, 0.060, 0.055),
)  # fmt: skip
_SHIN: tuple[Ring, ...] = (
    (-0.385, -0.004, 0.064, 0.060), (-0.300, -0.008, 0.062, 0.059), (-0.130, -0.012, 0.066, 0.061),
    (0.000, 0.004, 0.064, 0.060), (0.035, 0.006, 0.036, 0.034),
)  # fmt: skip
_UPPER_ARM: tuple[Ring, ...] = (
    (-0.350, 0.0, 0.026, 0.024), (-0.320, 0.0, 0.046, 0.043), (-0.200, 0.0, 0.052, 0.048),
    (-0.070, 0.0, 0.063, 0.058), (0.000, 0.0, 0.062, 0.056), (0.036, 0.0, 0.036, 0.034),
)  # fmt: skip
_FOREARM: tuple[Ring, ...] = (
    (-0.262, 0.0, 0.026, 0.024), (-0.200, 0.0, 0.034, 0.032), (-0.080, 0.0, 0.044, 0.041),
    (0.000, 0.0, 0.043, 0.040), (0.030, 0.0, 0.024, 0.022),
)  # fmt: skip
_HAND: tuple[Ring, ...] = (
    (-0.160, 0.012, 0.016, 0.014), (-0.130, 0.008, 0.036, 0.022), (-0.060, 0.004, 0.046, 0.026),
    (0.000, 0.000, 0.030, 0.024), (0.015, 0.000, 0.018, 0.016),
)  # fmt: skip
_NECK: tuple[Ring, ...] = ((-0.11, -0.018, 0.066, 0.066), (-0.02, -0.004, 0.056, 0.056), (0.05, 0.008, 0.056, 0.054))
_HEAD: tuple[Ring, ...] = (
    (-0.022, 0.050, 0.030, 0.030), (0.005, 0.032, 0.070, 0.054), (0.055, 0.016, 0.095, 0.070),
    (0.110, 0.012, 0.099, 0.077), (0.155, 0.008, 0.094, 0.074), (0.190, 0.004, 0.072, 0.056), (0.207, 0.002, 0.034, 0.028),
)  # fmt: skip
_FOOT: tuple[Ring, ...] = (
    (-0.085, 0.050, 0.028, 0.028), (-0.068, 0.046, 0.042, 0.040), (0.000, 0.032, 0.056, 0.044), (0.090, 0.050, 0.038, 0.050),
    (0.150, 0.058, 0.030, 0.050), (0.190, 0.062, 0.021, 0.038), (0.204, 0.062, 0.010, 0.018),
)  # fmt: skip
_BOOT_SHAFT: tuple[Ring, ...] = (
    (-0.060, 0.0, 0.050, 0.042), (0.000, -0.004, 0.056, 0.048), (0.090, -0.006, 0.058, 0.054), (0.130, -0.006, 0.056, 0.052)
)  # fmt: skip
_LIMB = even_columns(10)


def sole(scale: float) -> Sole:
    """Return the sole of the boot at a body scale."""
    stations = np.asarray(_FOOT)
    return Sole(np.column_stack([stations[:, 0], -stations[:, 1] - stations[:, 2]]) * scale)


def _tinted(rings: tuple[Ring, ...], columns_deg: FloatArray, surface: Surface, squareness: float = 2.0) -> Mesh:
    return Mesh.of(loft(rings, columns_deg, squareness=squareness), None, surface, crease_deg=60.0)


@lru_cache(maxsize=64)
def limb_part(name: str, bare: bool) -> Mesh:
    """Return a part of which there are two, or the pelvis or neck; bare parts are skin."""
    rings = {
        "thigh": _THIGH, "shin": _SHIN, "upper_arm": _UPPER_ARM, "forearm": _FOREARM, "hand": _HAND, "neck": _NECK,
        "pelvis": _PELVIS,
    }[name]  # fmt: skip
    columns_deg = {"pelvis": even_columns(14), "hand": even_columns(8), "neck": even_columns(8)}.get(name, _LIMB)
    return _tinted(rings, columns_deg, Surface.SKIN if bare else Surface.FABRIC, 2.3 if name == "pelvis" else 2.0)


@lru_cache(maxsize=2)
def boot(tall: bool) -> Mesh:
    """Return a work boot, origin in the ankle; tall ones are rubber."""
    foot = loft([(x, -z, half_z, half_y) for x, z, half_z, half_y in _FOOT], even_columns(8), squareness=2.8)
    foot.apply_transform(rotation("y", 90.0) @ rotation("z", 180.0))
    shaft = [(z * (2.2 if tall and z > 0 else 1.0), x, a, b) for z, x, a, b in _BOOT_SHAFT]
    surface = Surface.RUBBER if tall else Surface.FABRIC
    return join([Mesh.of(foot, None, surface, 50.0), Mesh.of(loft(shaft, even_columns(8)), None, surface, 50.0)])


@lru_cache(maxsize=8)
def shirt(build: str, bulk: float) -> Mesh:
    """Return what covers the chest from the hips to the neck; a jacket has more bulk (1 is a shirt)."""
    rings = [(z, x, a * bulk, b * bulk) for z, x, a, b in _CHEST[build]]
    return _tinted(tuple(rings), even_columns(14), Surface.FABRIC, 2.3)


@lru_cache(maxsize=2)
def head() -> Mesh:
    """Return head and ears without hair, origin at the top of the spine."""
    return _tinted(_HEAD, even_columns(12), Surface.SKIN)


@lru_cache(maxsize=16)
def vest(build: str, bands: str, open_front: bool, bulk: float = 1.0) -> Mesh:
    """Return a hi-vis vest over a shirt.

    Args:
        build: As of the shirt.
        bands: Of reflective tape: "two" around, "braces" (two around and one over each shoulder), "one", "none".
        open_front: Whether it hangs open.
        bulk: Of the shirt below.
    """
    edges_m = (-0.085, -0.045, 0.005, 0.055, 0.115, 0.165, 0.24, 0.31, 0.355, 0.392, 0.422)
    known = np.asarray(_CHEST[build])
    rings = [
        (z, float(np.interp(z, known[:, 0], known[:, 1])), *(
            float(np.interp(z, known[:, 0], known[:, k])) * bulk * (1.04 if z > 0.37 else 1.07) + 0.004 for k in (2, 3)
        ))
        for z in edges_m
    ]  # fmt: skip
    columns_deg = np.array([0, 22, 42, 64, 90, 116, 138, 158, 180, 202, 222, 244, 270, 296, 318, 338], dtype=np.float64)
    solid = loft(rings, columns_deg, squareness=2.3)
    sides = 2 * (len(edges_m) - 1) * len(columns_deg)
    index = np.arange(len(solid.faces))
    ring, column = index // (2 * len(columns_deg)), index // 2 % len(columns_deg)
    side = index < sides
    around = {"none": [], "one": [2], "two": [2, 4], "braces": [2, 4]}[bands]
    tape = np.isin(ring, around)
    if bands == "braces":
        tape |= np.isin(column, [1, 6, 9, 14]) & (ring >= 4)
    shown = side & ~(open_front & np.isin(column, [0, 15]))
    cloth = Mesh.of(keep(solid, shown & ~tape), None, Surface.FABRIC, 60.0)
    if not around:
        return cloth
    return join([cloth, Mesh.of(keep(solid, shown & tape), _TAPE, Surface.REFLECTIVE, 60.0)])


@lru_cache(maxsize=1)
def tool_belt() -> Mesh:
    """Return a leather belt with two pouches, in the pelvis frame."""
    belt = loft(((0.075, 0.0, 0.135, 0.183), (0.125, 0.0, 0.132, 0.178)), even_columns(14), squareness=2.3)
    pouch = [(-0.05, 0.0, 0.05, 0.025), (0.09, 0.0, 0.06, 0.035)]
    solids = [belt]
    for side in (1.0, -1.0):
        bag = loft(pouch, even_columns(8), squareness=4.0)
        bag.apply_translation((0.02, side * 0.20, 0.0))
        solids.append(bag)
    return join([Mesh.of(solid, _LEATHER, Surface.FABRIC, 50.0) for solid in solids])


@lru_cache(maxsize=1)
def backpack() -> Mesh:
    """Return a small rucksack, in the chest frame."""
    bag = loft(
        ((0.00, -0.20, 0.07, 0.13), (0.06, -0.21, 0.10, 0.15), (0.25, -0.20, 0.09, 0.14), (0.33, -0.18, 0.05, 0.10)),
        even_columns(10), squareness=3.0,
    )  # fmt: skip
    return Mesh.of(bag, None, Surface.FABRIC, 50.0)
