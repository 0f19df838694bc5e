"""Meshes of a body in workwear, modelled at the reference stature; each frame's origin is the upper joint."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.people.gait import Sole
from standoff_sim.people.loft import Ring, even_columns, keep, loft
from standoff_sim.solids.mesh import Mesh, Surface, join, rotation, srgb

_TAPE = srgb("#b9bcba")
_LEATHER = srgb("#3a2f26")
BUILDS = ("slim", "average", "heavy")
JACKET_BULK = 1.09

_CHEST: dict[str, tuple[Ring, ...]] = {
    "slim": (
        (-0.075, 0.000, 0.108, 0.160), (-0.03, 0.000, 0.120, 0.174), (0.10, 0.002, 0.116, 0.170),
        (0.22, 0.008, 0.124, 0.182), (0.31, 0.004, 0.118, 0.196), (0.365, -0.004, 0.094, 0.188),
        (0.400, -0.008, 0.074, 0.132), (0.430, -0.006, 0.060, 0.072),
    ),
    "average": (
        (-0.075, 0.006, 0.122, 0.170), (-0.03, 0.008, 0.136, 0.184), (0.10, 0.010, 0.134, 0.184),
        (0.22, 0.010, 0.138, 0.194), (0.31, 0.004, 0.128, 0.204), (0.365, -0.004, 0.100, 0.194),
        (0.400, -0.008, 0.078, 0.138), (0.430, -0.006, 0.062, 0.076),
    ),
    "heavy": (
        (-0.075, 0.028, 0.150, 0.182), (-0.03, 0.036, 0.166, 0.194), (0.10, 0.032, 0.162, 0.194),
        (0.22, 0.018, 0.148, 0.198), (0.31, 0.006, 0.134, 0.204), (0.365, -0.004, 0.102, 0.194),
        (0.400, -0.008, 0.082, 0.140), (0.430, -0.006, 0.064, 0.080),
    ),
}  # fmt: skip
_PELVIS: tuple[Ring, ...] = (
    (-0.115, -0.005, 0.050, 0.075), (-0.07, -0.008, 0.100, 0.150), (0.00, -0.010, 0.118, 0.172),
    (0.07, -0.004, 0.114, 0.164), (0.13, 0.002, 0.112, 0.156), (0.16, 0.002, 0.085, 0.120),
)  # fmt: skip
_THIGH: tuple[Ring, ...] = (
    (-0.460, 0.005, 0.040, 0.038), (-0.430, 0.004, 0.070, 0.067), (-0.300, 0.004, 0.080, 0.077),
    (-0.200, 0.004, 0.086, 0.083), (-0.100, 0.002, 0.094, 0.089),
    (0.000, -0.004, 0.097, 0.086), (0.060, -0.006, 0.062, 0.056),
)  # fmt: skip
_SHIN: tuple[Ring, ...] = (
    (-0.405, -0.004, 0.074, 0.068), (-0.340, -0.006, 0.073, 0.067), (-0.240, -0.012, 0.071, 0.066),
    (-0.130, -0.012, 0.073, 0.067), (0.000, 0.004, 0.072, 0.067), (0.038, 0.006, 0.040, 0.038),
)  # fmt: skip
_UPPER_ARM: tuple[Ring, ...] = (
    (-0.352, 0.0, 0.028, 0.026), (-0.320, 0.0, 0.050, 0.046), (-0.200, 0.0, 0.057, 0.052),
    (-0.080, 0.0, 0.069, 0.063), (0.000, -0.004, 0.069, 0.061), (0.036, -0.008, 0.040, 0.036),
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
    (0.110, 0.012, 0.099, 0.077), (0.155, 0.008, 0.094, 0.074), (0.190, 0.004, 0.072, 0.056),
    (0.207, 0.002, 0.034, 0.028),
)  # fmt: skip
# Lofted along x, heel to toe; the second number is the depth of the middle below the ankle.
_FOOT: tuple[Ring, ...] = (
    (-0.085, 0.050, 0.028, 0.028), (-0.068, 0.046, 0.042, 0.040), (0.000, 0.032, 0.056, 0.044),
    (0.090, 0.050, 0.038, 0.050),
    (0.150, 0.058, 0.030, 0.050), (0.190, 0.062, 0.021, 0.038), (0.204, 0.062, 0.010, 0.018),
)  # fmt: skip
_BOOT_SHAFT: tuple[Ring, ...] = (
    (-0.060, 0.0, 0.050, 0.042), (0.000, -0.004, 0.053, 0.046), (0.080, -0.006, 0.052, 0.048),
    (0.095, -0.006, 0.040, 0.038),
)  # fmt: skip
_RUBBER_LEG: tuple[Ring, ...] = (
    (-0.425, 0.000, 0.070, 0.066), (-0.330, -0.008, 0.078, 0.074), (-0.170, -0.012, 0.084, 0.079),
    (-0.150, -0.012, 0.070, 0.066),
)  # fmt: skip
_PARTS: dict[str, tuple[tuple[Ring, ...], int, float]] = {
    "pelvis": (_PELVIS, 14, 2.3), "thigh": (_THIGH, 10, 2.0), "shin": (_SHIN, 10, 2.0),
    "upper_arm": (_UPPER_ARM, 10, 2.0), "forearm": (_FOREARM, 10, 2.0), "hand": (_HAND, 8, 2.0),
    "neck": (_NECK, 8, 2.0), "head": (_HEAD, 12, 2.0),
}  # fmt: skip
"""Sections, columns and squareness of each part."""
# Edges of the bands of tape are edges of the mesh: rings 2 and 4 go around, columns 1, 6, 9 and 14 over the shoulders.
_VEST_EDGES_M = (-0.085, -0.045, 0.005, 0.055, 0.115, 0.165, 0.24, 0.31, 0.355, 0.392, 0.422)
_VEST_COLUMNS_DEG = np.array(
    [0, 22, 42, 64, 90, 116, 138, 158, 180, 202, 222, 244, 270, 296, 318, 338], dtype=np.float64
)
_FOLDS = 0.028


def sole(scale: float) -> Sole:
    """Return the sole of the boot at a body scale."""
    ahead, middle, half = np.asarray(_FOOT, dtype=np.float64).T[:3]
    return Sole(np.column_stack([ahead, -middle - half]) * scale)


def _tinted(rings: tuple[Ring, ...], columns_deg: FloatArray, surface: Surface, squareness: float = 2.0) -> Mesh:
    folds = _FOLDS if surface is Surface.FABRIC else 0.0
    return Mesh.of(loft(rings, columns_deg, squareness=squareness, folds=folds), None, surface, crease_deg=60.0)


@lru_cache(maxsize=32)
def part(name: str, bare: bool) -> Mesh:
    """Return a limb's segment, hand, neck, head or pelvis; bare ones are skin."""
    rings, columns, squareness = _PARTS[name]
    return _tinted(rings, even_columns(columns), Surface.SKIN if bare else Surface.FABRIC, squareness)


@lru_cache(maxsize=2)
def boot(rubber: bool) -> Mesh:
    """Return a boot up to the ankle, its origin."""
    foot = loft(_FOOT, even_columns(8), squareness=2.8)
    foot.apply_transform(rotation("y", 90.0))
    surface = Surface.RUBBER if rubber else Surface.FABRIC
    return join([Mesh.of(foot, None, surface, 50.0), Mesh.of(loft(_BOOT_SHAFT, even_columns(8)), None, surface, 50.0)])


@lru_cache(maxsize=1)
def rubber_leg() -> Mesh:
    """Return the leg of a rubber boot, worn over the trousers, in the shin's frame."""
    return _tinted(_RUBBER_LEG, even_columns(10), Surface.RUBBER)


@lru_cache(maxsize=8)
def hem(build: str, jacket: bool) -> Mesh:
    """Return the lower end of a shirt or jacket, in the pelvis frame: it does not bend with the chest."""
    bulk, low_m = (JACKET_BULK, -0.06) if jacket else (1.0, 0.015)
    belly = {"slim": (0.0, 0.124, 0.176), "average": (0.006, 0.138, 0.186), "heavy": (0.028, 0.160, 0.192)}[build]
    x, half_x, half_y = belly[0], belly[1] * bulk, belly[2] * bulk
    rings = (
        (low_m, 0.3 * x, 1.02 * half_x, 1.03 * half_y), (0.06, 0.7 * x, half_x, half_y),
        (0.12, x, half_x, 0.98 * half_y), (0.16, x, 0.86 * half_x, 0.86 * half_y),
    )  # fmt: skip
    return _tinted(rings, even_columns(14), Surface.FABRIC, 2.3)


@lru_cache(maxsize=8)
def shirt(build: str, jacket: bool) -> Mesh:
    """Return what covers the chest from the waist to the neck; a jacket is wider."""
    bulk = JACKET_BULK if jacket else 1.0
    rings = [(z, x, a * bulk, b * bulk) for z, x, a, b in _CHEST[build]]
    return _tinted(tuple(rings), even_columns(14), Surface.FABRIC, 2.3)


@lru_cache(maxsize=32)
def vest(build: str, bands: str, open_front: bool, jacket: bool) -> Mesh:
    """Return a hi-vis vest.

    Args:
        build: As of the shirt.
        bands: Of reflective tape: "two" around, "braces" (two around and one over each shoulder), "one", "none".
        open_front: Whether it hangs open.
        jacket: Whether it covers a jacket.
    """
    solid = loft(_vest_rings(build, jacket), _VEST_COLUMNS_DEG, squareness=2.3, folds=0.012)
    columns = len(_VEST_COLUMNS_DEG)
    index = np.arange(len(solid.faces))
    ring, column = index // (2 * columns), index // 2 % columns
    around = {"none": [], "one": [2], "two": [2, 4], "braces": [2, 4]}[bands]
    tape = np.isin(ring, around)
    if bands == "braces":
        tape |= np.isin(column, [1, 6, 9, 14]) & (ring >= 4)
    shown = (ring < len(_VEST_EDGES_M) - 1) & ~(open_front & np.isin(column, [0, 15]))
    cloth = Mesh.of(keep(solid, shown & ~tape), None, Surface.FABRIC, 60.0)
    if not around:
        return cloth
    return join([cloth, Mesh.of(keep(solid, shown & tape), _TAPE, Surface.REFLECTIVE, 60.0)])


def _vest_rings(build: str, jacket: bool) -> list[Ring]:
    """Return sections a little outside the shirt's; below the chest the cloth hangs straight."""
    known = np.asarray(_CHEST[build])
    bulk = JACKET_BULK if jacket else 1.0
    rings: list[Ring] = []
    for z in _VEST_EDGES_M:
        x, half_x, half_y = (float(np.interp(z, known[:, 0], known[:, k])) for k in (1, 2, 3))
        if z < 0.22:
            half_x, half_y = max(half_x, 0.98 * known[3, 2]), max(half_y, 0.96 * known[3, 3])
        loose = bulk * (1.03 if z > 0.37 else 1.06)
        rings.append((z, x, half_x * loose + 0.004, half_y * loose + 0.004))
    return rings


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
