"""Tanks for fuel and water."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from standoff_sim.props.materials import aged
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.bars import bars
from standoff_sim.solids.mesh import Mesh, Surface, box, cylinder, join, lathe, scaling, srgb, translation, tube

_PAINTS = tuple(srgb(code) for code in ("#d9d8d2", "#3f6f4c", "#c9651e", "#2f6fa5", "#8c9194", "#d8a01c"))
_STEEL = srgb("#85878a")
_DARK = srgb("#2b2c2d")
_PLASTICS = (srgb("#26282a"), srgb("#cfd0cb"), srgb("#2f5f9a"))


def make_tank(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a tank: a steel fuel tank in its bund, a black or white water tank, or IBC containers."""
    kind = int(rng.integers(3))
    if kind == 2:
        count = int(rng.integers(1, 5))
        poses = np.stack([translation((k % 2) * 1.25 - 0.6, (k // 2) * 1.1 - 0.5, 0.0) for k in range(count)])
        return (
            place(
                _crate_tank(),
                poses,
                tint=np.array(srgb("#cfd2d0")) * rng.uniform(0.75, 1.0),
                dust=rng.uniform(0.1, 0.5),
            ),
        )
    if kind == 1:
        tint = np.array(_PLASTICS[int(rng.integers(len(_PLASTICS)))])
        stretch = scaling(1.0, 1.0, rng.uniform(0.8, 1.2))
        return (place(_water_tank(), stretch, tint=tint, dust=rng.uniform(0.1, 0.5)),)
    tint = aged(rng, _PAINTS, (0.75, 1.0))
    return (place(_fuel_tank(), np.eye(4), tint=tint, dust=rng.uniform(0.1, 0.6)),)


@lru_cache(maxsize=1)
def _fuel_tank() -> Mesh:
    shell = cylinder(0.75, 2.6, None, Surface.PAINT, axis="x", sections=20).at(0.0, 0.0, 1.05)
    saddles = [box((0.2, 1.3, 0.5), _STEEL).at(x, 0.0, 0.1) for x in (-0.8, 0.8)]
    rim = [((-1.6, s * 1.0, 0.25), (1.6, s * 1.0, 0.25)) for s in (-1, 1)] + [
        ((s * 1.6, -1.0, 0.25), (s * 1.6, 1.0, 0.25)) for s in (-1, 1)
    ]
    return join(
        [
            shell,
            *saddles,
            box((3.2, 2.0, 0.08), srgb("#4a4d4f"), Surface.STEEL),
            bars(np.array(rim), 0.06, _STEEL, depth_m=0.5),
            cylinder(0.22, 0.14, _STEEL, sections=12).at(0.0, 0.0, 1.85),
            box((0.4, 0.35, 0.6), srgb("#c9cac6")).at(1.35, 0.0, 0.3),
            tube([(1.3, 0.2, 0.8), (1.5, 0.6, 0.7), (1.5, 0.8, 0.2)], 0.025, _DARK, Surface.RUBBER, sections=5),
            box((0.02, 0.5, 0.35), srgb("#c9301c")).at(1.31, -0.35, 1.1),
        ]
    )


@lru_cache(maxsize=1)
def _water_tank() -> Mesh:
    outline = [
        (0.0, 0.0),
        (1.0, 0.0),
        (1.03, 0.3),
        (1.0, 0.35),
        (1.03, 0.7),
        (1.0, 0.75),
        (1.03, 1.1),
        (0.98, 1.5),
        (0.45, 1.85),
        (0.3, 1.85),
        (0.3, 1.95),
        (0.0, 1.97),
    ]
    return lathe(outline, None, Surface.PLASTIC, sections=20)


@lru_cache(maxsize=1)
def _crate_tank() -> Mesh:
    rings = [
        ((x0, y0, z), (x1, y1, z))
        for z in (0.3, 0.6, 0.9, 1.12)
        for (x0, y0), (x1, y1) in (
            ((-0.59, -0.49), (0.59, -0.49)),
            ((0.59, -0.49), (0.59, 0.49)),
            ((0.59, 0.49), (-0.59, 0.49)),
            ((-0.59, 0.49), (-0.59, -0.49)),
        )
    ]
    posts = [((x, s * 0.49, 0.15), (x, s * 0.49, 1.12)) for x in np.linspace(-0.59, 0.59, 5) for s in (-1, 1)]
    return join(
        [
            box((1.2, 1.0, 0.15), srgb("#7d6a4c"), Surface.WOOD),
            box((1.12, 0.92, 0.95), None, Surface.PLASTIC).at(0, 0, 0.15),
            bars(np.array([*rings, *posts]), 0.025, _STEEL),
            cylinder(0.11, 0.08, _DARK, Surface.PLASTIC, sections=10).at(0, 0, 1.13),
        ]
    )
