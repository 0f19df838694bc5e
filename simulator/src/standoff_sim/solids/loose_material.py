"""Loose material in a skip, on a truck's bed, in a bucket: a bumpy skin and lumps that stick out of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.solids.bars import grid
from standoff_sim.solids.mesh import Colour, Mesh, Surface, box, join, rotation, translation


def heap(
    rng: np.random.Generator, size_m: tuple[float, float, float], colours: Sequence[Colour], *, lumps: int = 0
) -> Mesh:
    """Return material that fills a rectangle, its border on z = 0, its middle about size_m[2] high.

    Args:
        rng: Shapes it.
        size_m: Length, width, height of the middle; a height of 0 is a lumpy flat fill.
        colours: Mixed over the skin and the lumps.
        lumps: Pieces sticking out.
    """
    rows, columns = 11, 17
    x, y = np.meshgrid(np.linspace(-1, 1, columns), np.linspace(-1, 1, rows))
    rise = np.clip(1.15 - np.abs(x) ** 2.5, 0, 1) * np.clip(1.1 - np.abs(y) ** 2.2, 0, 1)
    crest = 1.0 + 0.3 * np.sin(2.2 * x + rng.uniform(0, 6)) * np.cos(1.7 * y + rng.uniform(0, 6))
    rough = rng.normal(0.0, 0.02 + 0.08 * size_m[2], x.shape)
    height = size_m[2] * rise * crest + np.maximum(rough, -0.06)
    height[[0, -1]], height[:, [0, -1]] = -0.02, -0.02
    points = np.stack([x * size_m[0] / 2, y * size_m[1] / 2, height], axis=-1)
    palette = np.array(colours)
    mixed = 0.65 * palette.mean(axis=0) + 0.35 * palette[rng.integers(0, len(palette), x.shape)]
    mixed *= rng.uniform(0.75, 1.1, (rows, columns, 1))
    skin = grid(points, None, Surface.SOIL, shade=mixed)
    skin.tintable[:] = 0.0
    return join([skin, *(_lump(rng, points, size_m, colours) for _ in range(lumps))])


def soil_heap(length_m: float, width_m: float, height_m: float, colour: Colour | None, *, seed: int = 0) -> Mesh:
    """Return a bucket's load: soil heaped on z = 0 over a rectangle centred in x and y."""
    rng = np.random.default_rng(seed)
    share = np.linspace(-1.0, 1.0, 9)
    x, y = np.meshgrid(share, share)
    rise = np.sqrt(np.clip((1.0 - x**4) * (1.0 - y**4), 0.0, 1.0))
    height = height_m * rise * rng.uniform(0.72, 1.0, x.shape)
    return grid(np.stack([x * length_m / 2, y * width_m / 2, height], axis=-1), colour, Surface.SOIL)


def _lump(
    rng: np.random.Generator, points_m: FloatArray, size_m: tuple[float, float, float], colours: Sequence[Colour]
) -> Mesh:
    row, column = rng.integers(2, len(points_m) - 2), rng.integers(2, points_m.shape[1] - 2)
    reach_m = 0.3 * min(size_m[:2])
    extents = tuple(float(extent) for extent in reach_m * rng.uniform([0.3, 0.15, 0.1], [1.2, 0.7, 0.35]))
    turn = (
        rotation("z", rng.uniform(0, 360)) @ rotation("y", rng.uniform(-35, 35)) @ rotation("x", rng.uniform(-30, 30))
    )
    piece = box((extents[0], extents[1], extents[2]), colours[int(rng.integers(len(colours)))], Surface.CONCRETE)
    return piece.moved(translation(*points_m[row, column]) @ turn)
