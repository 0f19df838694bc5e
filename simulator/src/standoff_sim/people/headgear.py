"""Meshes of what is on a head; frame of the head, origin at the top of the spine."""

from __future__ import annotations

from functools import lru_cache

from standoff_sim.people.loft import Ring, even_columns, loft
from standoff_sim.solids.mesh import Mesh, Surface, join

_ROUND = even_columns(14)
_RIM_Z_M = 0.118


def _dome(rings: tuple[Ring, ...], surface: Surface) -> Mesh:
    return Mesh.of(loft(rings, _ROUND), None, surface, crease_deg=60.0)


def _plate(x_m: float, half_x_m: float, half_y_m: float, z_m: float, surface: Surface) -> Mesh:
    rings = ((z_m - 0.006, x_m, half_x_m, half_y_m), (z_m + 0.004, x_m, half_x_m * 0.985, half_y_m * 0.985))
    return Mesh.of(loft(rings, _ROUND), None, surface)


@lru_cache(maxsize=8)
def headgear(kind: str) -> Mesh:
    """Return a hat: "hard_hat" (peak in front), "hard_hat_brim" (all around), "cap", "sun_hat", "beanie"."""
    z = _RIM_Z_M
    shell = _dome(
        ((z, 0.0, 0.136, 0.113), (z + 0.05, 0.0, 0.131, 0.107), (z + 0.09, -0.002, 0.105, 0.086),
         (z + 0.113, -0.003, 0.070, 0.056), (z + 0.122, -0.003, 0.030, 0.024)),
        Surface.PLASTIC,
    )  # fmt: skip
    ridge = _dome(
        ((z + 0.08, 0.0, 0.115, 0.026), (z + 0.115, 0.0, 0.075, 0.017), (z + 0.128, 0.0, 0.03, 0.012)), Surface.PLASTIC
    )
    crown = _dome(
        ((z - 0.02, 0.0, 0.106, 0.086), (z + 0.04, 0.0, 0.104, 0.084), (z + 0.085, 0.0, 0.080, 0.063),
         (z + 0.102, 0.0, 0.036, 0.030)),
        Surface.FABRIC,
    )  # fmt: skip
    hood = _dome(
        ((z - 0.05, -0.02, 0.094, 0.086), (z + 0.03, -0.004, 0.110, 0.092), (z + 0.085, -0.008, 0.084, 0.070),
         (z + 0.108, -0.012, 0.036, 0.032)),
        Surface.FABRIC,
    )  # fmt: skip
    return {
        "hard_hat": lambda: join([shell, ridge, _plate(0.022, 0.155, 0.116, z, Surface.PLASTIC)]),
        "hard_hat_brim": lambda: join([shell, ridge, _plate(0.005, 0.180, 0.155, z, Surface.PLASTIC)]),
        "cap": lambda: join([crown, _plate(0.055, 0.125, 0.078, z - 0.01, Surface.FABRIC)]),
        "sun_hat": lambda: join([crown, _plate(0.0, 0.205, 0.195, z - 0.005, Surface.FABRIC)]),
        "beanie": lambda: hood,
    }[kind]()


@lru_cache(maxsize=1)
def hair() -> Mesh:
    """Return short hair."""
    return _dome(
        ((0.06, -0.040, 0.066, 0.074), (0.11, -0.012, 0.096, 0.083), (0.16, 0.000, 0.102, 0.081),
         (0.197, 0.000, 0.080, 0.063), (0.217, 0.000, 0.036, 0.030)),
        Surface.FABRIC,
    )  # fmt: skip
