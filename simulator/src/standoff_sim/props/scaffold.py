"""Scaffolds of real tubes and planks: free-standing towers, and long ones, now and then in front of a wall."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.props.materials import aged
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.bars import bars
from standoff_sim.solids.mesh import Mesh, Surface, box, join, srgb, translation

_BAY_M, _DEPTH_M, _LIFT_M = 2.5, 1.05, 2.0
_TUBES = (srgb("#9a9ea0"), srgb("#8c8f8e"), srgb("#b0761f"), srgb("#3f5f86"), srgb("#7d5a44"))
_WALLS = tuple(srgb(code) for code in ("#a7a298", "#b8b2a6", "#8f6a55", "#a58a70", "#c3bfb4"))


def make_scaffold_tower(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a scaffold tower of one bay and two to four lifts."""
    return _scaffold(rng, 1, int(rng.integers(2, 5)))


def make_scaffold(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a long scaffold, in half of the cases before a wall with openings, some of it under netting."""
    bays, lifts = int(rng.integers(3, 7)), int(rng.integers(2, 5))
    batches = _scaffold(rng, bays, lifts)
    if rng.random() < 0.6:
        batches = (*batches, *_netting(rng, bays, lifts))
    if rng.random() < 0.5:
        return batches
    tint = aged(rng, _WALLS, (0.8, 1.05))
    stretch = np.diag([bays * _BAY_M / 10.0, 1.0, (lifts * _LIFT_M - 0.6) / 6.0, 1.0])
    return (*batches, place(_wall(), translation(0.0, 1.0, 0.0) @ stretch, tint=tint, dust=rng.uniform(0.1, 0.4)))


def _scaffold(rng: np.random.Generator, bays: int, lifts: int) -> tuple[Batch, ...]:
    tint = aged(rng, _TUBES, (0.8, 1.0))
    dust = rng.uniform(0.1, 0.5)
    bay_x = (np.arange(bays) - (bays - 1) / 2) * _BAY_M
    cells = np.stack([translation(x, 0.0, lift * _LIFT_M) for x in bay_x for lift in range(lifts)])
    last = np.stack([translation(bay_x[-1] + _BAY_M, 0.0, lift * _LIFT_M) for lift in range(lifts)])
    decked = cells[(cells[:, 2, 3] > 0.0) & (rng.random(len(cells)) < 0.85)]
    top = cells[cells[:, 2, 3] == (lifts - 1) * _LIFT_M]
    wood = np.array(srgb("#a98a5c")) * rng.uniform(0.6, 1.1, (len(top) + len(decked), 1))
    decks = np.concatenate([decked, top @ translation(0.0, 0.0, _LIFT_M)])
    return (
        place(_bay(), cells, tint=tint, dust=dust),
        place(_end(), last, tint=tint, dust=dust),
        place(_deck(), decks, tint=wood, dust=rng.uniform(0.1, 0.5)),
        place(_rail(), decks, tint=tint, dust=dust),
    )


def _netting(rng: np.random.Generator, bays: int, lifts: int) -> tuple[Batch, ...]:
    bay_x = (np.arange(bays) - (bays - 1) / 2) * _BAY_M
    cells = np.stack([translation(x, 0.0, lift * _LIFT_M) for x in bay_x for lift in range(lifts)])
    hung = cells[rng.random(len(cells)) < rng.uniform(0.2, 0.9)]
    if len(hung) == 0:
        return ()
    tint = np.array(srgb(str(rng.choice(["#2f6f4f", "#cfd2cf", "#4a7fb0", "#3c6a45"])))) * rng.uniform(0.8, 1.0)
    return (place(_net(), hung, tint=tint, dust=rng.uniform(0.1, 0.5)),)


def _frame(x_m: float) -> list[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    near, far = -_DEPTH_M / 2, _DEPTH_M / 2
    posts = [((x_m, y, 0.0), (x_m, y, _LIFT_M)) for y in (near, far)]
    return [*posts, ((x_m, near, 1.95), (x_m, far, 1.95)), ((x_m, near, 0.2), (x_m, far, 0.2))]


@lru_cache(maxsize=1)
def _bay() -> Mesh:
    half = _BAY_M / 2
    ledgers = [((-half, s * _DEPTH_M / 2, 1.95), (half, s * _DEPTH_M / 2, 1.95)) for s in (-1, 1)]
    brace = [((-half, -_DEPTH_M / 2 - 0.03, 0.05), (half, -_DEPTH_M / 2 - 0.03, 1.95))]
    return bars(np.array([*_frame(-half), *ledgers, *brace]), 0.055, None)


@lru_cache(maxsize=1)
def _end() -> Mesh:
    return bars(np.array(_frame(-_BAY_M / 2)), 0.055, None)


@lru_cache(maxsize=1)
def _deck() -> Mesh:
    planks = [((-_BAY_M / 2 + 0.02, y, -0.02), (_BAY_M / 2 - 0.02, y, -0.02)) for y in (-0.36, -0.12, 0.12, 0.36)]
    board = box((_BAY_M, 0.03, 0.16), None, Surface.WOOD).at(0.0, -_DEPTH_M / 2, 0.0)
    return join([bars(np.array(planks), 0.225, None, Surface.WOOD, depth_m=0.045), board])


@lru_cache(maxsize=1)
def _rail() -> Mesh:
    half, near = _BAY_M / 2, -_DEPTH_M / 2
    rails = [((-half, near, z), (half, near, z)) for z in (0.5, 1.0)]
    posts = [((x, near, 0.0), (x, near, 1.05)) for x in (-half, half)]
    return bars(np.array([*rails, *posts]), 0.045, None)


@lru_cache(maxsize=1)
def _net() -> Mesh:
    return box((_BAY_M, 0.01, _LIFT_M), None, Surface.FABRIC).at(0.0, -_DEPTH_M / 2 - 0.06, 0.0)


@lru_cache(maxsize=1)
def _wall() -> Mesh:
    """Return a wall 10 m long and 6 m high with two rows of openings, its face at y = 0 towards -y."""
    cells = _wall_cells()
    return join([box((w, 0.3, h), None, Surface.CONCRETE).at(x, 0.15, z) for x, z, w, h in cells])


def _wall_cells() -> FloatArray:
    """Return (N, 4) middle x, lower z, width, height of the pieces around the openings."""
    bands = [(0.0, 0.0, 10.0, 0.9), (0.0, 2.4, 10.0, 1.5), (0.0, 5.3, 10.0, 0.7)]
    piers = [(x, z, 0.9, h) for x in (-4.55, -1.5, 1.5, 4.55) for z, h in ((0.9, 1.5), (3.9, 1.4))]
    return np.array([*bands, *piers])
