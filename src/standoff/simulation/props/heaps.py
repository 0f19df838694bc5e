"""Loose material: heaps of soil, sand and gravel, rubble, and the stones and scraps that lie everywhere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely

from standoff.core.homography import FloatArray
from standoff.simulation.mesh import Mesh, Surface, join, srgb
from standoff.simulation.props.materials import (
    FADED,
    HOLE,
    SANDS,
    SOILS,
    STONES,
    VARIANTS,
    WHITE_PLASTIC,
    WOODS,
    block,
    mound,
    scattered,
    single,
    stone,
    tints,
    varied,
)
from standoff.simulation.props.prop import Prop
from standoff.simulation.scene import Batch, place

_STONE_VARIANTS = 8
_WEEDS = (srgb("#5d6b33"), srgb("#7d7a45"), srgb("#8f8558"), srgb("#4b5a2c"))
_GRAVELS = (srgb("#8e8b85"), srgb("#a5a099"), srgb("#777470"))
_LITTER_SHARES = {"stone": 0.62, "scrap": 0.2, "splinter": 0.12, "weed": 0.06}


@varied
def pebble(rng: np.random.Generator) -> Mesh:
    """Return an angular stone of unit size; the tint colours it."""
    return stone(rng, int(rng.integers(8, 12)))


@varied
def _soil_heap(rng: np.random.Generator) -> Mesh:
    radius = rng.uniform(1.2, 3.2)
    return mound(rng, radius, radius * rng.uniform(0.3, 0.55), None, lumps=0.2)


@varied
def _sand_heap(rng: np.random.Generator) -> Mesh:
    radius = rng.uniform(0.9, 2.6)
    return mound(rng, radius, radius * rng.uniform(0.4, 0.6), None, lumps=0.07)


@varied
def _spread(rng: np.random.Generator) -> Mesh:
    """What is left of a heap: a thin, wide, lumpy patch."""
    radius = rng.uniform(1.0, 2.5)
    return mound(rng, radius, rng.uniform(0.1, 0.3), None, lumps=0.5)


def _heap_with_stones(rng: np.random.Generator) -> tuple[Batch, ...]:
    """A heap of soil, and the clods and stones that rolled off it."""
    heap = Prop("", 0.0, lambda _: ()) if False else None
    raise AssertionError(heap)


@varied
def _weed(rng: np.random.Generator) -> Mesh:
    """A tuft: a few blades, each a thin standing wedge seen from both sides."""
    blades = []
    for _ in range(7):
        blade = block((0.035, 0.004, rng.uniform(0.2, 0.5)), None, Surface.FOLIAGE)
        tapered = blade.vertices_m.copy()
        tapered[:, 0] *= np.where(tapered[:, 2] > 0.05, 0.2, 1.0)
        tapered[:, :2] += np.where(tapered[:, 2:] > 0.05, rng.normal(0.0, 0.13, 2), rng.normal(0.0, 0.03, 2))
        blades.append(Mesh(tapered.astype(np.float32), *_looks(blade)))
    return join(blades)
