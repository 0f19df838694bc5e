"""Site office cabins, alone or stacked with stairs and a gallery, and portable toilets."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from standoff_sim.props.materials import aged
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.bars import bars, blotches, corrugated, grid
from standoff_sim.solids.mesh import Mesh, Surface, box, join, profile, rotation, slab, srgb, translation

_LENGTH_M, _WIDTH_M, _HEIGHT_M = 6.06, 2.44, 2.7
_VARIANTS = 6
_WALLS = tuple(
    srgb(code)
    for code in ("#d9d7d0", "#e6e3da", "#c9cac6", "#3f6f9f", "#d7c9a3", "#8d9298", "#4b7a5c", "#c8742b", "#2f4a66")
)
_TOILETS = tuple(srgb(code) for code in ("#1e5aa8", "#2e7f9a", "#2f7d4f", "#6b7a83", "#b0502a", "#3d6fb5", "#7a8f2f"))
_GLASS = srgb("#1d252b")
_FRAME_WHITE = srgb("#e0dfd8")
_GALVANISED = srgb("#8f9394")


def make_cabin(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build an office cabin on timber blocks."""
    return _cabins(rng, 1, 1)


def make_cabin_block(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build two or three cabins side by side, in one or two storeys with stairs up to a gallery."""
    columns, storeys = int(rng.integers(2, 4)), int(rng.integers(1, 3))
    batches = _cabins(rng, columns, storeys)
    if storeys == 1:
        return batches
    return (*batches, place(_gallery(columns), np.eye(4), dust=rng.uniform(0.1, 0.4)))


def make_toilet(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a portable toilet, or a short row of them."""
    count = int(rng.choice([1, 1, 1, 2, 3]))
    shift = (np.arange(count) - (count - 1) / 2) * 1.25
    poses = np.stack([translation(rng.normal(0, 0.04), y, 0.0) @ rotation("z", rng.normal(0, 2)) for y in shift])
    tint = aged(rng, _TOILETS, (0.8, 1.1), count)
    return (place(_toilet(), poses, tint=tint, dust=rng.uniform(0.05, 0.4)),)


def _cabins(rng: np.random.Generator, columns: int, storeys: int) -> tuple[Batch, ...]:
    wall = aged(rng, _WALLS, (0.85, 1.05))
    batches = []
    for level in range(storeys):
        for column in range(columns):
            y_m = (column - (columns - 1) / 2) * (_WIDTH_M + 0.02)
            variant = int(rng.integers(_VARIANTS))
            tint = np.minimum(wall * rng.uniform(0.93, 1.04), 0.8)
            pose = translation(rng.normal(0, 0.03), y_m, level * _HEIGHT_M)
            batches.append(place(_cabin(variant), pose, tint=tint, dust=rng.uniform(0.05, 0.3)))
    return tuple(batches)


@lru_cache(maxsize=_VARIANTS)
def _cabin(variant: int) -> Mesh:
    rng = np.random.default_rng([33, variant])
    half_x, half_y, low, high = _LENGTH_M / 2, _WIDTH_M / 2, 0.12, _HEIGHT_M
    wall_m = high - low - 0.3
    trim = (0.55, 0.55, 0.55) if variant % 2 else None
    corners = [(sx * (half_x - 0.07), sy * (half_y - 0.07)) for sx in (-1, 1) for sy in (-1, 1)]
    posts = [((x, y, 0.0), (x, y, high)) for x, y in corners]
    rails = [((-half_x, s * (half_y - 0.07), z), (half_x, s * (half_y - 0.07), z)) for s in (-1, 1) for z in (0.2, 2.6)]
    rails += [
        ((s * (half_x - 0.07), -half_y, z), (s * (half_x - 0.07), half_y, z)) for s in (-1, 1) for z in (0.2, 2.6)
    ]
    side = corrugated(_LENGTH_M - 0.2, wall_m, 0.3, 0.025)
    sheet = grid(side, None, Surface.PAINT, shade=blotches(rng, side.shape[:2], low=0.9))
    roof = corrugated(_LENGTH_M - 0.1, _WIDTH_M - 0.1, 0.5, 0.02, rows=5)
    roof_colour = srgb(str(rng.choice(["#b9b9b4", "#cfcfca", "#9a9c9b"])))
    return join(
        [
            sheet.at(0.0, 0.04 - half_y, low + 0.2),
            sheet.moved(translation(0.0, half_y - 0.04, low + 0.2) @ rotation("z", 180.0)),
            box((_LENGTH_M - 0.12, _WIDTH_M - 0.3, wall_m), None).at(0.0, 0.0, low + 0.2),
            grid(roof, roof_colour, Surface.PAINT, shade=blotches(rng, roof.shape[:2], low=0.6)).moved(
                translation(0.0, 0.05 - half_y, high) @ rotation("x", -90.0)
            ),
            bars(np.array([*posts, *rails]), 0.15, trim or (0.8, 0.8, 0.8), Surface.PAINT),
            *_openings(rng, half_x, half_y),
            *([_air_conditioner().at(-half_x - 0.2, 0.5, 1.6)] if variant % 3 == 0 else []),
        ]
    )


def _openings(rng: np.random.Generator, half_x: float, half_y: float) -> list[Mesh]:
    window = join(
        [
            box((0.06, 1.0, 1.05), _FRAME_WHITE, Surface.PLASTIC),
            box((0.08, 0.86, 0.9), _GLASS, Surface.GLASS).at(0.0, 0.0, 0.08),
        ]
    )
    door_colour = srgb(str(rng.choice(["#d5d3cc", "#6d7276", "#345a80"])))
    door = join(
        [
            box((0.06, 0.95, 2.05), door_colour),
            box((0.08, 0.4, 0.5), _GLASS, Surface.GLASS).at(0.0, 0.0, 1.35),
            box((0.5, 0.9, 0.12), srgb("#77756f"), Surface.STEEL).at(0.3, 0.0, 0.0),
        ]
    )
    parts = [door.at(half_x, -0.55, 0.2), window.at(half_x, 0.55, 1.0), window.at(-half_x, -0.4, 1.0)]
    for x_m in rng.choice([-2.1, -0.7, 0.7, 2.1], 2, replace=False):
        sign = float(rng.choice([-1.0, 1.0]))
        parts.append(window.moved(translation(x_m, sign * (half_y - 0.01), 1.0) @ rotation("z", 90.0)))
    return parts


def _air_conditioner() -> Mesh:
    return join(
        [
            box((0.35, 0.85, 0.6), srgb("#d8d6cf"), Surface.PLASTIC),
            box((0.02, 0.45, 0.45), srgb("#2b2b2a"), Surface.PLASTIC).at(-0.18, 0.1, 0.07),
        ]
    )


@lru_cache(maxsize=4)
def _gallery(columns: int) -> Mesh:
    half_y = columns * (_WIDTH_M + 0.02) / 2
    deck_x, floor_m, deep_m = _LENGTH_M / 2 + 0.6, _HEIGHT_M, 1.1
    outer_x = deck_x + deep_m / 2
    posts_y = np.linspace(-half_y, half_y, columns + 1)
    rail = [((outer_x, -half_y, floor_m + z), (outer_x, half_y, floor_m + z)) for z in (0.5, 1.05)]
    posts = [((outer_x, y, 0.0), (outer_x, y, floor_m + 1.05)) for y in posts_y]
    run_m, treads = 2.9, 11
    foot_y = half_y + run_m
    steps = [
        box((0.9, 0.24, 0.04), _GALVANISED, Surface.STEEL).at(
            deck_x, half_y + run_m * (k + 0.5) / treads, floor_m * (1 - (k + 1) / (treads + 1))
        )
        for k in range(treads)
    ]
    slope = [((x, half_y, floor_m + z), (x, foot_y, z)) for x in (deck_x - 0.48, deck_x + 0.48) for z in (0.05, 0.95)]
    ends = [((x, foot_y, 0.0), (x, foot_y, 0.95)) for x in (deck_x - 0.48, deck_x + 0.48)]
    return join(
        [
            box((deep_m, 2 * half_y, 0.08), _GALVANISED, Surface.STEEL).at(deck_x, 0.0, floor_m - 0.08),
            bars(np.array([*rail, *posts, *slope, *ends]), 0.05, _GALVANISED),
            *steps,
        ]
    )


@lru_cache(maxsize=1)
def _toilet() -> Mesh:
    roof = slab([(-0.58, -0.56), (0.58, -0.56), (0.58, 0.56), (-0.58, 0.56)], 0.08, srgb("#d9d9d2"), Surface.PLASTIC)
    dome = profile([(-0.5, 0.0), (0.5, 0.0), (0.32, 0.12), (-0.32, 0.12)], 0.95, srgb("#d2d4cf"), Surface.PLASTIC)
    ribs = [((0.57, y, 0.2), (0.57, y, 2.1)) for y in (-0.42, 0.42)]
    ribs += [((x, s * 0.565, 0.2), (x, s * 0.565, 2.1)) for x in (-0.35, 0.0, 0.35) for s in (-1, 1)]
    return join(
        [
            box((1.14, 1.12, 2.05), None, Surface.PLASTIC).at(0.0, 0.0, 0.12),
            box((1.2, 1.15, 0.14), srgb("#2c2e30"), Surface.PLASTIC),
            box((0.03, 0.78, 1.85), (0.8, 0.8, 0.8), Surface.PLASTIC).at(0.575, 0.0, 0.22),
            box((0.04, 0.5, 0.2), srgb("#c9c9c4"), Surface.PLASTIC).at(0.58, 0.0, 1.6),
            bars(np.array(ribs), 0.05, None, Surface.PLASTIC),
            roof.at(0.0, 0.0, 2.15),
            dome.at(0.0, 0.0, 2.23),
            bars(np.array([((-0.4, 0.35, 2.2), (-0.4, 0.35, 2.55))]), 0.1, srgb("#3b3d3f"), Surface.PLASTIC),
        ]
    )
