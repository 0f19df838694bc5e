"""Shipping containers and skips."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.props.materials import aged
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.bars import bars, blotches, corrugated, grid, rusted
from standoff_sim.solids.loose_material import heap
from standoff_sim.solids.mesh import Colour, Mesh, Surface, box, join, rotation, srgb, translation
from standoff_sim.solids.panels import panels

_LENGTHS_M = (6.06, 6.06, 2.99, 12.19)
_VARIANTS = 8
_WIDTH_M, _HEIGHT_M = 2.44, 2.59
_PAINTS = tuple(
    srgb(code)
    for code in (
        "#7a2f22",
        "#8a3b1f",
        "#1f4e79",
        "#2a6496",
        "#2e6b4f",
        "#3f5f3a",
        "#5b6166",
        "#8c8f90",
        "#d8d6cf",
        "#e2e0d8",
        "#c8631c",
        "#b59a3c",
        "#233a5c",
        "#9b2d2b",
        "#6f8796",
    )
)
_RUBBLE = tuple(
    srgb(code)
    for code in (
        "#8f8a80",
        "#a39b8c",
        "#7d5b48",
        "#9a8f7c",
        "#c9c4b8",
        "#6d6256",
        "#a58a63",
        "#d0ccc0",
        "#35506f",
        "#b58c54",
    )
)


def make_container(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a shipping container of 10, 20 or 40 feet, now and then with a second one on top."""
    count = 2 if rng.random() < 0.15 else 1
    variant = int(rng.integers(_VARIANTS))
    batches = []
    for level in range(count):
        pose = translation(rng.normal(0.0, 0.04), rng.normal(0.0, 0.04), level * _HEIGHT_M) @ rotation(
            "z", 180.0 * rng.integers(2)
        )
        tint = aged(rng, _PAINTS, (0.75, 1.1))
        batches.append(place(_container(variant), pose, tint=tint, dust=rng.uniform(0.1, 0.5)))
    return tuple(batches)


def make_skip(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build an open skip with sloping ends, or a long roll-off dumpster, empty or full of rubble."""
    tint = aged(rng, _PAINTS, (0.7, 1.0))
    mesh = _skip(int(rng.integers(_VARIANTS)), bool(rng.random() < 0.35))
    return (place(mesh, np.eye(4), tint=tint, dust=rng.uniform(0.3, 0.7)),)


@lru_cache(maxsize=_VARIANTS)
def _container(variant: int) -> Mesh:
    rng = np.random.default_rng([31, variant])
    length_m = _LENGTHS_M[variant % len(_LENGTHS_M)]
    half_x, half_y = length_m / 2, _WIDTH_M / 2
    side, front = length_m - 0.2, _WIDTH_M - 0.2
    walls = [
        _sheet(rng, side, _HEIGHT_M - 0.25, 0.05).at(0.0, 0.03 - half_y, 0.15),
        _sheet(rng, side, _HEIGHT_M - 0.25, 0.05).moved(translation(0, half_y - 0.03, 0.15) @ rotation("z", 180.0)),
        _sheet(rng, front, _HEIGHT_M - 0.25, 0.05).moved(translation(0.04 - half_x, 0, 0.15) @ rotation("z", -90.0)),
        _sheet(rng, length_m - 0.1, front, 0.035, rows=5).moved(
            translation(0.0, -front / 2, _HEIGHT_M - 0.03) @ rotation("x", -90.0)
        ),
    ]
    return join([*walls, _frame(length_m), *_doors(rng, half_x)])


def _sheet(rng: np.random.Generator, length_m: float, height_m: float, depth_m: float, *, rows: int = 3) -> Mesh:
    points = corrugated(length_m, height_m, 0.36, depth_m, rows=rows)
    dents = blotches(rng, points.shape[:2], low=0.0)
    points[..., 1] += 0.06 * np.clip(0.25 - dents, 0.0, 1.0)
    sheet = grid(points, None, Surface.PAINT, shade=blotches(rng, points.shape[:2], low=0.72))
    rust = np.clip(2.5 * (blotches(rng, points.shape[:2], low=0.0) - 0.78), 0.0, 0.9)
    return rusted(sheet, rust.ravel())


def _frame(length_m: float) -> Mesh:
    x, y, z = length_m / 2 - 0.06, _WIDTH_M / 2 - 0.06, _HEIGHT_M - 0.06
    corners = [(sx * x, sy * y) for sx in (-1, 1) for sy in (-1, 1)]
    posts = [((cx, cy, 0.0), (cx, cy, _HEIGHT_M)) for cx, cy in corners]
    rails = [((-x, sy * y, level), (x, sy * y, level)) for sy in (-1, 1) for level in (0.09, z)]
    sills = [((sx * x, -y, level), (sx * x, y, level)) for sx in (-1, 1) for level in (0.09, z)]
    castings = [box((0.18, 0.16, 0.12), srgb("#3c3a38"), Surface.STEEL).at(cx, cy, z - 0.06) for cx, cy in corners]
    return join([bars(np.array([*posts, *rails, *sills]), 0.12, None, Surface.PAINT), *castings])


def _doors(rng: np.random.Generator, x_m: float) -> list[Mesh]:
    leaf_m = _WIDTH_M / 2 - 0.1
    parts = []
    for sign in (-1.0, 1.0):
        open_deg = float(rng.choice([0.0, 0.0, 0.0, 100.0, 250.0]))
        rods = [((0.05, -sign * y, 0.1), (0.05, -sign * y, 2.3)) for y in (0.3, 0.75)]
        leaf = join(
            [
                box((0.05, leaf_m, 2.3), None).at(0.0, -sign * leaf_m / 2, 0.0),
                bars(np.array(rods), 0.04, srgb("#8d8c88")),
            ]
        )
        parts.append(leaf.moved(translation(x_m - 0.03, sign * (leaf_m + 0.02), 0.15) @ rotation("z", sign * open_deg)))
    parts.append(box((0.02, _WIDTH_M - 0.2, 2.3), srgb("#141210")).at(x_m - 1.2, 0.0, 0.15))
    parts.append(box((1.2, _WIDTH_M - 0.2, 0.05), srgb("#4d3d2e"), Surface.WOOD).at(x_m - 0.6, 0.0, 0.12))
    return parts


@lru_cache(maxsize=2 * _VARIANTS)
def _skip(variant: int, empty: bool) -> Mesh:
    rng = np.random.default_rng([32, variant])
    long = variant % 3 == 0
    length_m, width_m, height_m = (6.2, 2.4, rng.uniform(1.2, 2.2)) if long else (3.6, 1.75, rng.uniform(1.1, 1.5))
    overhang_m = 0.05 if long else 0.75
    parts = [_hull(rng, (length_m, width_m, height_m), overhang_m)]
    if not empty:
        fill = heap(rng, (length_m - 0.15, width_m - 0.12, rng.uniform(0.1, 0.55)), _RUBBLE, lumps=26)
        parts.append(fill.at(0.0, 0.0, height_m - rng.uniform(0.1, 0.25)))
    return join(parts)


def _hull(rng: np.random.Generator, size_m: tuple[float, float, float], overhang_m: float) -> Mesh:
    length_m, width_m, height_m = size_m
    low = _ring(length_m - 2 * overhang_m, width_m, 0.12)
    high = _ring(length_m, width_m, height_m)
    rim = np.stack([high, np.roll(high, -1, axis=0)], axis=1)
    floor = panels(low[None], srgb("#4a4038"), Surface.RUST)
    rib_x = np.arange(-length_m / 2 + overhang_m + 0.3, length_m / 2 - overhang_m, 0.65)
    ribs = [((x, s * width_m / 2, 0.1), (x, s * width_m / 2, height_m)) for x in rib_x for s in (-1, 1)]
    skids = [((-length_m / 2 + overhang_m, s * 0.5, 0.06), (length_m / 2 - overhang_m, s * 0.5, 0.06)) for s in (-1, 1)]
    outside = _walls(low, high, None, Surface.PAINT)
    outside = rusted(outside, np.clip(rng.normal(0.2, 0.2, len(outside.vertices_m)), 0.0, 0.8))
    inside = _walls(high[::-1], low[::-1], srgb("#5a4536"), Surface.RUST)
    return join(
        [
            outside,
            inside,
            floor,
            bars(rim, 0.1, None, Surface.PAINT),
            bars(np.array(ribs), 0.09, None, Surface.PAINT),
            bars(np.array(skids), 0.12, srgb("#37312c")),
        ]
    )


def _ring(length_m: float, width_m: float, z_m: float) -> FloatArray:
    half = np.array([length_m / 2, width_m / 2])
    return np.column_stack([np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half, np.full(4, z_m)])


def _walls(low_m: FloatArray, high_m: FloatArray, colour: Colour | None, surface: Surface) -> Mesh:
    after = np.roll(low_m, -1, axis=0)
    corners = np.stack([low_m, after, np.roll(high_m, -1, axis=0), high_m], axis=1)
    return panels(corners, colour, surface)
