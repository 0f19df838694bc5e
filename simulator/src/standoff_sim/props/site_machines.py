"""Machines that stand still: generators, compressors, lighting masts, silos, pumps."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.machines.machine_parts import grille, hull, wheel
from standoff_sim.props.materials import aged
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.bars import bars, lattice
from standoff_sim.solids.mesh import (
    Mesh,
    Surface,
    box,
    cylinder,
    join,
    lathe,
    rotation,
    srgb,
    translation,
    tube,
)

_PAINTS = tuple(
    srgb(code)
    for code in ("#d8a01c", "#d9d8d2", "#c9651e", "#2f6fa5", "#8c9194", "#4a7a4c", "#a82c22", "#e0c23a", "#55606a")
)
_STEEL = srgb("#85878a")
_DARK = srgb("#2b2c2d")


def make_generator(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a generator in its canopy, on skids, its cable running off."""
    size = rng.uniform(0.8, 1.5)
    pose = np.diag([size, rng.uniform(0.9, 1.15), rng.uniform(0.9, 1.1), 1.0])
    return (_painted(rng, _generator(), pose), place(_cable(int(rng.integers(4))), np.eye(4), dust=0.15))


def make_compressor(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a compressor on a single-axle trailer with a hose."""
    hose = place(_cable(int(rng.integers(4))), rotation("z", 180.0), dust=0.15)
    return (_painted(rng, _compressor(), np.eye(4)), hose)


def make_lighting_mast(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a mobile lighting mast on its trailer."""
    return (_painted(rng, _lighting_mast(), rotation("z", rng.uniform(0, 360))),)


def make_silo(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build one or two standing silos for mortar or cement."""
    count = int(rng.choice([1, 1, 2]))
    poses = np.stack([translation((k - (count - 1) / 2) * 2.9, 0.0, 0.0) for k in range(count)])
    return (_painted(rng, _silo(), poses),)


def make_pump(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a portable pump with suction and delivery hose."""
    hoses = [place(_cable(int(rng.integers(4))), rotation("z", turn), dust=0.15) for turn in (0.0, 180.0)]
    return (_painted(rng, _pump(), np.eye(4)), *hoses)


def _painted(rng: np.random.Generator, mesh: Mesh, poses: FloatArray) -> Batch:
    tint = aged(rng, _PAINTS, (0.75, 1.0))
    return place(mesh, poses, tint=tint, dust=rng.uniform(0.1, 0.6))


@lru_cache(maxsize=1)
def _generator() -> Mesh:
    canopy = hull(
        [(x, y, z) for x in (-1.2, 1.2) for y in (-0.5, 0.5) for z in (0.22, 1.4)]
        + [(x, y, 1.52) for x in (-1.08, 1.08) for y in (-0.4, 0.4)],
        None,
    )
    vents = [
        grille(0.7, 0.6).moved(rotation("z", turn)).moved(translation(x, y, 0.85))
        for turn, x, y in ((0.0, 0.6, 0.5), (180.0, 0.6, -0.5), (90.0, -1.2, 0.0))
    ]
    return join(
        [
            box((2.5, 1.0, 0.22), _DARK, Surface.STEEL),
            canopy,
            *vents,
            cylinder(0.06, 0.25, _DARK, sections=8).at(0.8, 0.2, 1.6),
            box((0.3, 0.06, 0.3), _DARK).at(-0.5, 0.5, 0.9),
            tube([(-0.3, 0, 1.5), (-0.3, 0, 1.62), (0.3, 0, 1.62), (0.3, 0, 1.5)], 0.03, _STEEL, sections=5),
        ]
    )


@lru_cache(maxsize=1)
def _compressor() -> Mesh:
    shell = hull(
        [
            (x, s * half, z)
            for x, half, z in (
                (-1.1, 0.6, 0.45),
                (-1.0, 0.55, 1.3),
                (0.7, 0.55, 1.3),
                (1.0, 0.6, 0.95),
                (1.0, 0.6, 0.45),
            )
            for s in (-1, 1)
        ],
        None,
    )
    tyre = wheel(0.31, 0.18, srgb("#8d8f90"), sections=12)
    bar = [
        ((0.9, 0.25, 0.45), (2.0, 0.0, 0.45)),
        ((0.9, -0.25, 0.45), (2.0, 0.0, 0.45)),
        ((1.8, 0.0, 0.0), (1.8, 0.0, 0.5)),
    ]
    return join(
        [
            shell,
            bars(np.array(bar), 0.07, _STEEL),
            *(tyre.at(-0.1, s * 0.72, 0.31) for s in (-1, 1)),
            *(box((0.8, 0.2, 0.05), _DARK).at(-0.1, s * 0.74, 0.65) for s in (-1, 1)),
            grille(0.8, 0.5).moved(rotation("z", 90.0)).at(-1.06, 0.0, 0.85),
            box((0.5, 0.5, 0.02), _DARK).at(-0.5, 0.0, 1.3),
        ]
    )


@lru_cache(maxsize=1)
def _lighting_mast() -> Mesh:
    legs = [((0.3 * sx, 0.3 * sy, 0.35), (1.25 * sx, 1.25 * sy, 0.35)) for sx in (-1, 1) for sy in (-1, 1)]
    feet = [((1.2 * sx, 1.2 * sy, 0.0), (1.2 * sx, 1.2 * sy, 0.5)) for sx in (-1, 1) for sy in (-1, 1)]
    chords, bracing = lattice(5.5, (0.22, 0.22), 0.45)
    tyre = wheel(0.3, 0.18, srgb("#8d8f90"), sections=12)
    head = [
        box((0.12, 0.5, 0.4), srgb("#dcdcd4"), Surface.GLASS).moved(translation(0.1, y, z) @ rotation("y", 30.0))
        for y in (-0.35, 0.35)
        for z in (7.0, 7.45)
    ]
    return join(
        [
            box((1.8, 0.95, 0.85), None).at(0.0, 0.0, 0.4),
            bars(np.array([*legs, *feet]), 0.08, _STEEL),
            *(tyre.at(0.0, s * 0.62, 0.3) for s in (-1, 1)),
            bars(chords, 0.05, _STEEL).at(0.0, 0.0, 1.2),
            bars(bracing, 0.03, _STEEL).at(0.0, 0.0, 1.2),
            bars(np.array([((0, 0, 6.5), (0, 0, 7.9)), ((0, -0.6, 7.2), (0, 0.6, 7.2))]), 0.08, _STEEL),
            *head,
            bars(np.array([((0.9, 0.0, 0.5), (2.0, 0.0, 0.5))]), 0.08, _STEEL),
        ]
    )


@lru_cache(maxsize=1)
def _silo() -> Mesh:
    shell = lathe([(0.18, 1.3), (1.2, 3.0), (1.2, 6.4), (0.9, 6.75), (0.0, 6.85)], None, Surface.PAINT, sections=20)
    rings = [
        lathe([(1.2, z), (1.24, z + 0.04), (1.2, z + 0.08)], None, Surface.PAINT, sections=20) for z in (3.1, 4.7, 6.3)
    ]
    legs = [((0.95 * sx, 0.95 * sy, 0.0), (0.85 * sx, 0.85 * sy, 3.4)) for sx in (-1, 1) for sy in (-1, 1)]
    braces = [((-0.95, s * 0.95, 0.2), (0.9, s * 0.9, 2.2)) for s in (-1, 1)]
    braces += [((s * 0.95, -0.95, 0.2), (s * 0.9, 0.9, 2.2)) for s in (-1, 1)]
    rungs = [((1.32, -0.2, z), (1.32, 0.2, z)) for z in np.arange(0.5, 6.8, 0.4)]
    rails = [((1.32, y, 0.3), (1.32, y, 7.3)) for y in (-0.2, 0.2)]
    top = [
        ((0.8 * x0, 0.8 * y0, 7.5), (0.8 * x1, 0.8 * y1, 7.5))
        for (x0, y0), (x1, y1) in (((-1, -1), (1, -1)), ((1, 1), (-1, 1)), ((-1, 1), (-1, -1)))
    ]
    posts = [((0.8 * sx, 0.8 * sy, 6.4), (0.8 * sx, 0.8 * sy, 7.5)) for sx in (-1, 1) for sy in (-1, 1)]
    return join(
        [
            shell,
            *rings,
            bars(np.array([*legs]), 0.14, None, Surface.PAINT),
            bars(np.array(braces), 0.06, _STEEL),
            bars(np.array([*rungs, *rails, *top, *posts]), 0.04, _STEEL),
            box((2.4, 2.4, 0.1), srgb("#8a867c"), Surface.CONCRETE),
            box((0.6, 0.5, 0.6), _DARK).at(0.0, 0.0, 0.7),
        ]
    )


@lru_cache(maxsize=1)
def _pump() -> Mesh:
    frame = [((s * 0.55, y, 0.05), (s * 0.55, y, 0.75)) for s in (-1, 1) for y in (-0.3, 0.3)]
    frame += [((-0.55, y, z), (0.55, y, z)) for y in (-0.3, 0.3) for z in (0.05, 0.75)]
    return join(
        [
            bars(np.array(frame), 0.05, _DARK),
            box((0.55, 0.45, 0.45), None).at(-0.2, 0.0, 0.12),
            cylinder(0.2, 0.25, _STEEL, axis="x", sections=12).at(0.3, 0.0, 0.35),
            cylinder(0.09, 0.4, _STEEL).at(0.3, 0.0, 0.6),
        ]
    )


@lru_cache(maxsize=4)
def _cable(variant: int) -> Mesh:
    rng = np.random.default_rng([36, variant])
    heading = np.cumsum(rng.normal(0.0, 0.45, 12))
    steps = 0.25 * np.column_stack([np.cos(heading), np.sin(heading)])
    xy = np.cumsum([[0.3, 0.0], *steps], axis=0)
    radius_m = (0.02, 0.02, 0.05, 0.05)[variant]
    path = np.column_stack([xy, np.full(len(xy), radius_m)])
    path[0, 2] = 0.3
    colour = (srgb("#1c1c1c"), srgb("#c8641c"), srgb("#2a4f7a"), srgb("#252525"))[variant]
    return tube(path, radius_m, colour, Surface.RUBBER, sections=5)
