"""Loose material: heaps of soil, sand and gravel, rubble, and the stones and scraps that lie everywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
import trimesh

from standoff.core.homography import FloatArray
from standoff_sim.props.materials import (
    FADED,
    SANDS,
    SOILS,
    STONES,
    VARIANTS,
    WHITE_PLASTIC,
    WOODS,
    block,
    mound,
    relief,
    ripples,
    scattered,
    stone,
    tints,
    varied,
)
from standoff_sim.props.prop import Prop
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.mesh import Colour, Mesh, Surface, join, rotation, scaling, srgb, toned

_STONE_VARIANTS = 8
_WEEDS = (srgb("#5d6b33"), srgb("#7d7a45"), srgb("#8f8558"), srgb("#4b5a2c"))
_SCRAPS = (*[WHITE_PLASTIC] * 4, *[srgb("#8f8b84")] * 4, *[srgb("#9a7b56")] * 5, *[srgb("#3a3937")] * 4, *FADED)
_GRAVELS = (srgb("#8e8b85"), srgb("#a5a099"), srgb("#777470"))


@varied
def pebble(rng: np.random.Generator) -> Mesh:
    """Return an angular stone of unit size; the tint colours it."""
    return stone(rng, int(rng.integers(8, 12)))


@varied
def _soil_heap(rng: np.random.Generator) -> Mesh:
    radius = rng.uniform(1.2, 3.2)
    return _cloddy(rng, mound(rng, radius, radius * rng.uniform(0.3, 0.55), None, lumps=0.2), 26)


@varied
def _sand_heap(rng: np.random.Generator) -> Mesh:
    radius = rng.uniform(0.9, 2.6)
    return mound(rng, radius, radius * rng.uniform(0.4, 0.6), None, lumps=0.07)


@varied
def _spread(rng: np.random.Generator) -> Mesh:
    """What is left of a heap: a thin, wide, lumpy patch."""
    radius = rng.uniform(1.0, 2.5)
    return _cloddy(rng, mound(rng, radius, rng.uniform(0.1, 0.3), None, lumps=0.5), 14)


def _cloddy(rng: np.random.Generator, heap: Mesh, count: int) -> Mesh:
    """Return a heap with clods on its flanks, lighter and darker than the rest."""
    spots = heap.vertices_m[rng.permutation(np.flatnonzero(heap.vertices_m[:, 2] > 0.03))[:count]]
    clods = []
    for spot in spots:
        clod = stone(rng, 7).moved(scaling(*rng.uniform(0.12, 0.4, 3)))
        clods.append(toned(clod, rng.uniform(0.75, 1.0)).at(float(spot[0]), float(spot[1]), float(spot[2])))
    return join([heap, *clods])


@varied
def weed(rng: np.random.Generator) -> Mesh:
    """Return a tuft of grass: leaning blades, each a thin triangle seen from both sides."""
    count = 9
    foot = np.column_stack([rng.normal(0.0, 0.04, (count, 2)), np.full(count, -0.02)])
    turn = rng.uniform(0.0, 2 * np.pi, count)
    across = 0.02 * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(count)])
    tip = foot + np.column_stack([rng.normal(0.0, 0.13, (count, 2)), rng.uniform(0.12, 0.4, count)])
    corners = np.stack([foot - across, foot + across, tip], axis=1).reshape(-1, 3)
    front = np.arange(3 * count).reshape(-1, 3)
    solid = trimesh.Trimesh(np.tile(corners, (2, 1)), np.vstack([front, front[:, ::-1] + 3 * count]), process=False)
    return toned(Mesh.of(solid, None, Surface.FOLIAGE, crease_deg=1.0), rng.uniform(0.6, 1.0))


@varied
def _scrap(rng: np.random.Generator) -> Mesh:
    """A bent bit of sheet, film or cardboard of about unit size."""
    xy = np.stack(np.meshgrid([-0.5, 0.0, 0.5], [-0.35, 0.35], indexing="ij"), axis=-1) + rng.normal(
        0.0, 0.1, (3, 2, 2)
    )
    z = np.abs(rng.normal(0.05, 0.12, (3, 2, 1)))
    return relief(np.concatenate([xy, z], axis=-1), None, Surface.PLASTIC)


@varied
def _splinter(rng: np.random.Generator) -> Mesh:
    return block((1.0, rng.uniform(0.05, 0.15), rng.uniform(0.03, 0.08)), None, Surface.WOOD)


def _stones_around(rng: np.random.Generator, count: int, near_m: float, far_m: float, size_m: float) -> Batch:
    """Stones between two circles, more of them inside."""
    turn = rng.uniform(0.0, 2 * np.pi, count)
    reach = near_m + (far_m - near_m) * rng.beta(1.0, 2.5, count)
    sizes = np.minimum(size_m * rng.lognormal(0.0, 0.5, count), 4 * size_m)
    xy = reach[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    poses = scattered(rng, xy, 0.15 * sizes, sizes)
    return place(
        pebble(int(rng.integers(_STONE_VARIANTS))), poses, tint=tints(rng, STONES + SOILS, count, 0.3), dust=0.4
    )


def _heap(
    build: Callable[[int], Mesh], palette: tuple[Colour, ...]
) -> Callable[[np.random.Generator], tuple[Batch, ...]]:
    """Return the maker of a heap with the clods and stones that rolled off it."""

    def make(rng: np.random.Generator) -> tuple[Batch, ...]:
        mesh = build(int(rng.integers(VARIANTS)))
        grown = scaling(*rng.uniform(0.8, 1.15, 3))
        reach_m = 0.8 * float(np.abs(mesh.vertices_m[:, 0]).max())
        return (
            place(mesh, rotation("z", rng.uniform(0.0, 360.0)) @ grown, tint=tints(rng, palette, 1), dust=0.15),
            _stones_around(rng, 30, 0.7 * reach_m, 1.3 * reach_m, 0.12),
        )

    return make


def _rubble(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Broken concrete and stones, in a heap of many sizes."""
    radius_m, count = rng.uniform(0.7, 2.0), int(rng.integers(50, 110))
    share = np.sqrt(rng.uniform(0.0, 1.0, count))
    turn = rng.uniform(0.0, 2 * np.pi, count)
    xy = radius_m * share[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    sizes = np.clip(0.25 * rng.lognormal(0.0, 0.5, count), 0.08, 0.9)
    poses = scattered(rng, xy, 0.35 * radius_m * (1.0 - share) + 0.15 * sizes, sizes)
    colours = tints(rng, STONES if rng.uniform() < 0.7 else (srgb("#9a5638"), *STONES), count, 0.25)
    half = count // 2
    kinds = rng.permutation(_STONE_VARIANTS)[:2]
    return tuple(
        place(pebble(int(kind)), poses[part], tint=colours[part], dust=0.35)
        for kind, part in zip(kinds, (slice(half), slice(half, None)), strict=True)
    )


def _scattered_stones(rng: np.random.Generator) -> tuple[Batch, ...]:
    return (_stones_around(rng, int(rng.integers(15, 50)), 0.0, rng.uniform(0.6, 1.8), 0.14),)


def _weeds(rng: np.random.Generator) -> tuple[Batch, ...]:
    count = int(rng.integers(6, 25))
    xy = rng.normal(0.0, 0.45, (count, 2)).clip(-1.2, 1.2)
    poses = scattered(rng, xy, 0.0, rng.uniform(0.6, 1.6, count))
    return (place(weed(int(rng.integers(VARIANTS))), poses, tint=tints(rng, _WEEDS, count, 0.25), dust=0.1),)


def scatter_litter(
    rng: np.random.Generator, count: int, region: shapely.Polygon, height_at: Callable[[FloatArray], FloatArray]
) -> tuple[Batch, ...]:
    """Strew small stones, scraps, splinters and weeds over an area, thick in some places and thin in others.

    Args:
        rng: Decides everything.
        count: How many pieces.
        region: Where, site frame.
        height_at: Returns the (N,) ground heights under (N, 2).
    """
    xy = _patchy(rng, count, region)
    z = height_at(xy)
    kinds = rng.choice(len(_LITTER), size=len(xy), p=[kind.share for kind in _LITTER])
    batches = []
    for number, kind in enumerate(_LITTER):
        chosen = np.flatnonzero(kinds == number)
        sizes = np.minimum(kind.size_m * rng.lognormal(0.0, 0.5, len(chosen)), 5 * kind.size_m)
        poses = scattered(rng, xy[chosen], z[chosen] + kind.lift * sizes, sizes)
        colours = tints(rng, kind.palette, len(chosen), 0.25)
        for variant in range(kind.variants):
            part = slice(variant, None, kind.variants)
            batches.append(place(kind.build(variant), poses[part], tint=colours[part], dust=0.35))
    return tuple(batch for batch in batches if len(batch.poses))


@dataclass(frozen=True, slots=True)
class _Litter:
    """A kind of small things: its share of all, median size, lift of its centre in sizes, colours."""

    build: Callable[[int], Mesh]
    variants: int
    share: float
    size_m: float
    lift: float
    palette: tuple[Colour, ...]


_LITTER = (
    _Litter(pebble, _STONE_VARIANTS, 0.66, 0.11, 0.12, STONES + SOILS),
    _Litter(_scrap, 4, 0.12, 0.2, 0.0, _SCRAPS),
    _Litter(_splinter, 3, 0.15, 0.55, 0.0, WOODS),
    _Litter(weed, 3, 0.07, 0.9, 0.0, _WEEDS),
)


def _patchy(rng: np.random.Generator, count: int, region: shapely.Polygon) -> FloatArray:
    """Return (count, 2) points in a region, at most places few, in some many."""
    west, south, east, north = region.bounds
    waves = int(rng.integers(2**31))
    found = np.empty((0, 2))
    while len(found) < count:
        xy = rng.uniform((west, south), (east, north), (4 * count, 2))
        thick = ripples(np.random.default_rng(waves), xy, 11.0, 3)
        wanted = rng.uniform(0.0, 1.0, len(xy)) < 0.12 + 0.5 * np.clip(thick, 0.0, 1.2)
        found = np.concatenate([found, xy[wanted & shapely.contains_xy(region, xy[:, 0], xy[:, 1])]])
    return found[:count]


HEAPS: tuple[Prop, ...] = (
    Prop("soil heap", 3.4, _heap(_soil_heap, SOILS), 1.8),
    Prop("sand heap", 2.9, _heap(_sand_heap, SANDS + _GRAVELS), 1.6),
    Prop("spread material", 2.8, _heap(_spread, SOILS + SANDS + _GRAVELS), 1.2),
    Prop("rubble", 2.2, _rubble, 1.3),
    Prop("scattered stones", 1.9, _scattered_stones, 1.5),
    Prop("weeds", 1.4, _weeds, 1.2),
)
