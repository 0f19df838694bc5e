"""Small traffic and storage things in groups: cones, drums, signs, jerry-built edge protection."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.bars import bars
from standoff_sim.solids.mesh import Mesh, Surface, box, cylinder, join, lathe, rotation, slab, srgb, translation

_STEEL_DRUMS = tuple(
    srgb(code) for code in ("#1f4f8a", "#2a2a2a", "#7a2e20", "#3c6b3f", "#6a625a", "#b88a1e", "#8c8f90")
)
_PLASTIC_DRUMS = tuple(srgb(code) for code in ("#1c57a5", "#2366b3", "#1e4a8c", "#d5d6d2", "#23231f"))


def make_cones(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a line of traffic cones, one or the other fallen over."""
    count = int(rng.integers(3, 9))
    x_m = (np.arange(count) - (count - 1) / 2) * rng.uniform(0.8, 1.8)
    poses = []
    for x in x_m:
        pose = translation(x, rng.normal(0, 0.15), 0.0) @ rotation("z", rng.uniform(0, 360))
        poses.append(pose @ translation(0, 0, 0.18) @ rotation("y", 82.0) if rng.random() < 0.1 else pose)
    tint = np.array(srgb("#e0491c")) * rng.uniform(0.7, 1.0, (count, 1))
    return (place(_cone(), np.stack(poses), tint=tint, dust=rng.uniform(0.1, 0.6, count)),)


def make_drums(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a group of steel or plastic drums, some lying."""
    count = int(rng.integers(2, 10))
    spots = _cluster(rng, count, 0.64)
    steel = rng.random() < 0.6
    palette = np.array(_STEEL_DRUMS if steel else _PLASTIC_DRUMS)
    one_colour = rng.random() < 0.5
    chosen = np.full(count, rng.integers(len(palette))) if one_colour else rng.integers(len(palette), size=count)
    poses = []
    for x, y in spots:
        pose = translation(x, y, 0.0) @ rotation("z", rng.uniform(0, 360))
        lying = rng.random() < 0.12
        poses.append(pose @ translation(-0.44, 0, 0.3) @ rotation("y", 90.0) if lying else pose)
    tint = palette[chosen] * rng.uniform(0.7, 1.1, (count, 1))
    return (place(_drum(steel), np.stack(poses), tint=tint, dust=rng.uniform(0.2, 0.7, count)),)


def make_signs(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build one to three road or safety signs on posts."""
    count = int(rng.integers(1, 4))
    batches = []
    for k in range(count):
        pose = translation((k - (count - 1) / 2) * 1.1, rng.normal(0, 0.1), 0.0) @ rotation("z", rng.normal(0, 15))
        batches.append(
            place(_sign(int(rng.integers(5))), pose @ rotation("y", rng.normal(0, 2)), dust=rng.uniform(0, 0.5))
        )
    return tuple(batches)


def make_edge_rail(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a stretch of guard rail of steel posts and planks, as along slab edges and pits."""
    count = int(rng.integers(2, 6))
    shift = (np.arange(count) - (count - 1) / 2) * 2.4
    poses = np.stack([translation(x, 0.0, 0.0) @ rotation("y", rng.normal(0, 1.0)) for x in shift])
    wood = np.array(srgb("#b8935c")) * rng.uniform(0.6, 1.1, (count, 1))
    if rng.random() < 0.3:
        wood = np.array(srgb("#c03a24")) * rng.uniform(0.8, 1.0, (count, 1))
    return (place(_rail(), poses, tint=wood, dust=rng.uniform(0.1, 0.5)),)


def _cluster(rng: np.random.Generator, count: int, pitch_m: float) -> FloatArray:
    """Return (count, 2) cells of a loose hexagonal packing nearest to the origin."""
    i, j = np.meshgrid(np.arange(-4, 5), np.arange(-4, 5))
    cells = np.stack([i + 0.5 * (j % 2), 0.87 * j], axis=-1).reshape(-1, 2) * pitch_m
    order = np.argsort(np.hypot(*cells.T) + rng.uniform(0.0, 0.9, len(cells)))
    chosen: FloatArray = cells[order[:count]]
    return chosen


@lru_cache(maxsize=1)
def _cone() -> Mesh:
    foot = slab([(-0.19, -0.19), (0.19, -0.19), (0.19, 0.19), (-0.19, 0.19)], 0.035, srgb("#1d1c1b"), Surface.RUBBER)
    body = lathe([(0.14, 0.03), (0.03, 0.72), (0.0, 0.72)], None, Surface.PLASTIC, sections=12)
    low = lathe([(0.118, 0.2), (0.086, 0.4)], srgb("#dedcd6"), Surface.REFLECTIVE, sections=12)
    high = lathe([(0.072, 0.5), (0.054, 0.61)], srgb("#dedcd6"), Surface.REFLECTIVE, sections=12)
    return join([foot, body, low, high])


@lru_cache(maxsize=2)
def _drum(steel: bool) -> Mesh:
    if steel:
        outline = [(0.0, 0.0), (0.29, 0.0), (0.285, 0.29), (0.3, 0.3), (0.285, 0.31), (0.285, 0.58), (0.3, 0.59)]
        outline += [(0.285, 0.6), (0.29, 0.88), (0.27, 0.88), (0.265, 0.86), (0.0, 0.86)]
        surface = Surface.PAINT
    else:
        outline = [(0.0, 0.0), (0.26, 0.0), (0.29, 0.06), (0.29, 0.8), (0.25, 0.88), (0.22, 0.93), (0.0, 0.93)]
        surface = Surface.PLASTIC
    top_m = outline[-1][1]
    bung = cylinder(0.04, 0.04, srgb("#8d8d88"), sections=8).at(0.16, 0.0, top_m + 0.01)
    return join([lathe(outline, None, surface, sections=14), bung])


@lru_cache(maxsize=5)
def _sign(variant: int) -> Mesh:
    post = bars(np.array([((0.0, 0.0, 0.0), (0.0, 0.0, 2.1))]), 0.06, srgb("#9a9d9e"))
    foot = box((0.5, 0.4, 0.12), srgb("#26261f"), Surface.RUBBER)
    faces = {
        0: (
            cylinder(0.33, 0.03, srgb("#c3201c"), axis="x", sections=20),
            cylinder(0.24, 0.04, srgb("#dddad2"), axis="x"),
        ),
        1: (
            box((0.03, 0.6, 0.8), srgb("#e0b51a")).at(0, 0, -0.4),
            box((0.04, 0.45, 0.12), srgb("#1c1b19")).at(0, 0, 0.1),
        ),
        2: (
            cylinder(0.33, 0.03, srgb("#1d4f9e"), axis="x", sections=20),
            box((0.04, 0.1, 0.35), (0.7, 0.7, 0.7)).at(0, 0, -0.2),
        ),
        3: (
            box((0.03, 0.9, 0.6), srgb("#dcdad4")).at(0, 0, -0.3),
            box((0.04, 0.7, 0.2), srgb("#b3262a")).at(0, 0, 0.02),
        ),
        4: (
            cylinder(0.42, 0.03, srgb("#c3201c"), axis="x", sections=3).moved(rotation("x", 90.0)),
            cylinder(0.27, 0.04, srgb("#e0c03a"), axis="x", sections=3).moved(rotation("x", 90.0)),
        ),
    }
    return join([post, foot, *(face.at(0.05, 0.0, 1.75) for face in faces[variant])])


@lru_cache(maxsize=1)
def _rail() -> Mesh:
    posts = bars(np.array([((x, 0.0, 0.0), (x, 0.0, 1.15)) for x in (-1.2, 1.2)]), 0.05, srgb("#a8321f"), Surface.PAINT)
    planks = [((-1.3, -0.03, z), (1.3, -0.03, z)) for z in (0.1, 0.55, 1.02)]
    return join([posts, bars(np.array(planks), 0.03, None, Surface.WOOD, depth_m=0.15)])
