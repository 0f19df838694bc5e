"""Meshes and pivots of a dozer, in its local frame."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from standoff_sim.machines.machine_parts import (
    Crawler,
    Point,
    Ram,
    beacon,
    beam,
    cab,
    exhaust,
    grille,
    handrail,
    hull,
    lamp,
)
from standoff_sim.machines.paint import BLACK, DARK_GREY, STEEL
from standoff_sim.solids.bars import bars
from standoff_sim.solids.mesh import Mesh, Surface, box, cylinder, join, profile, rotation, srgb

CRAWLER = Crawler(length_m=3.5, height_m=1.02, width_m=0.56, shoes=38)
GAUGE_M = 1.88
BLADE_PIVOT_M: Point = (-0.2, 0.0, 0.5)
BLADE_EDGE_M: Point = (2.72, 0.0, 0.0)
RAM_FOOT_M: Point = (1.2, 0.0, 1.75)
RAM_HEAD_M: Point = (2.25, 0.0, 0.3)
RAM_Y_M = 0.58
_BLADE_WIDTH_M = 3.25


@lru_cache(maxsize=2)
def body(*, open_cab: bool) -> Mesh:
    """Return hood, cab or roof on posts, tank, fenders."""
    hood = hull(
        [
            (x, s * half, z)
            for x, half, z in ((2.0, 0.48, 1.72), (2.0, 0.5, 0.75), (-0.25, 0.58, 1.95), (-0.25, 0.6, 0.75))
            for s in (-1, 1)
        ],
        None,
    )
    fenders = [box((1.9, 0.5, 0.1), None).at(-0.85, s * 0.92, 1.12) for s in (-1, 1)]
    tank = hull(
        [
            (x, s * half, z)
            for x, half, z in ((-1.15, 0.72, 2.1), (-1.15, 0.72, 1.1), (-1.85, 0.62, 1.85), (-1.85, 0.66, 1.0))
            for s in (-1, 1)
        ],
        None,
    )
    rails = [handrail([(-0.2, s * 1.12, 1.75), (-1.5, s * 1.12, 1.75)], BLACK, floor_m=1.2) for s in (-1, 1)]
    return join(
        [
            hood,
            *fenders,
            tank,
            *rails,
            *(_roof_on_posts() if open_cab else _closed_cab()),
            box((0.9, 1.4, 0.5), None).at(-0.7, 0.0, 0.95),
            exhaust(0.85, 0.07).at(0.9, 0.3, 1.75),
            cylinder(0.11, 0.5, BLACK, sections=10).at(0.3, -0.3, 2.05),
            grille(0.75, 0.8).moved(rotation("z", -90.0)).at(2.01, 0.0, 1.25),
            *(grille(1.2, 0.45).moved(rotation("z", 0.0 if s > 0 else 180.0)).at(0.9, s * 0.56, 1.3) for s in (-1, 1)),
            *(lamp(0.15).at(1.9, y, 1.8) for y in (-0.35, 0.35)),
        ]
    )


def _closed_cab() -> list[Mesh]:
    cabin = cab(1.45, 1.5, 1.85, slant_m=0.12, sill=0.28).at(-0.75, 0.0, 1.2)
    lamps = [lamp(0.13).at(-0.15, y, 3.05) for y in (-0.55, 0.55)]
    return [cabin, beacon().at(-1.2, 0.4, 3.05), *lamps]


def _roof_on_posts() -> list[Mesh]:
    posts = [((x, s * 0.68, 1.2), (x, s * 0.68, 3.0)) for x in (-0.15, -1.35) for s in (-1, 1)]
    return [
        bars(np.array(posts), 0.12, None, Surface.PAINT),
        box((1.6, 1.6, 0.1), None).at(-0.75, 0.0, 2.95),
        box((0.55, 0.6, 0.35), srgb("#20201f"), Surface.PLASTIC).at(-0.95, 0.0, 1.3),
        box((0.15, 0.6, 0.6), srgb("#20201f"), Surface.PLASTIC).at(-1.2, 0.0, 1.5),
    ]


@lru_cache(maxsize=1)
def belly() -> Mesh:
    """Return what is between the tracks."""
    return join(
        [
            box((3.2, 0.95, 0.55), None, Surface.STEEL).at(0.0, 0.0, 0.35),
            box((0.35, GAUGE_M, 0.25), None, Surface.STEEL).at(0.6, 0.0, 0.5),
            box((0.3, GAUGE_M, 0.25), None, Surface.STEEL).at(-0.9, 0.0, 0.5),
        ]
    )


@lru_cache(maxsize=1)
def shoe() -> Mesh:
    """Return one shoe."""
    return CRAWLER.shoe()


@lru_cache(maxsize=1)
def track_frame() -> Mesh:
    """Return the frame of one crawler."""
    return CRAWLER.frame()


@lru_cache(maxsize=1)
def blade_ram() -> Ram:
    """Return one lifting cylinder."""
    return Ram.spanning(1.08, 2.06, 0.065)


@lru_cache(maxsize=1)
def blade() -> Mesh:
    """Return the curved blade with its cutting edge, ribs and end plates; the edge at `BLADE_EDGE_M`."""
    angle = np.linspace(-0.75, 0.62, 7)
    radius_m, centre_x, centre_z = 1.0, 3.45, 0.71
    inner = [(centre_x - radius_m * np.cos(a), centre_z + radius_m * np.sin(a)) for a in angle]
    outer = [(x - 0.09, z) for x, z in reversed(inner)]
    end = [*inner, (inner[-1][0] + 0.12, inner[-1][1]), (inner[0][0] + 0.05, inner[0][1])]
    edge_x, _, edge_z = BLADE_EDGE_M
    edge = [
        (edge_x, edge_z),
        (edge_x - 0.04, edge_z),
        (inner[0][0] - 0.1, inner[0][1] + 0.15),
        (inner[0][0] - 0.02, inner[0][1] + 0.15),
    ]
    ribs = [box((0.14, 0.1, 1.05), None).at(2.36, y, 0.18) for y in np.linspace(-1.4, 1.4, 7)]
    spill = profile([(0.0, 0.0), (0.06, 0.0), (0.2, 0.25), (0.14, 0.25)], 1.6, None).at(
        inner[-1][0] - 0.06, 0.0, inner[-1][1]
    )
    return join(
        [
            profile([*inner, *outer], _BLADE_WIDTH_M, None, Surface.PAINT),
            profile(edge, _BLADE_WIDTH_M + 0.06, STEEL, Surface.STEEL),
            *(profile(end, 0.05, None).at(0.0, s * _BLADE_WIDTH_M / 2, 0.0) for s in (-1, 1)),
            *ribs,
            spill,
            box((0.16, 2.9, 0.22), None).at(2.33, 0.0, 0.3),
        ]
    )


@lru_cache(maxsize=1)
def push_arms() -> Mesh:
    """Return the arms outside the tracks that carry the blade, and its struts."""
    side_m = GAUGE_M / 2 + CRAWLER.width_m / 2 + 0.12
    arms = [
        beam((BLADE_PIVOT_M[0], s * side_m, BLADE_PIVOT_M[2]), (2.35, s * side_m, 0.32), (0.16, 0.24), None)
        for s in (-1, 1)
    ]
    struts = [beam((1.2, s * side_m, 0.45), (2.35, s * (side_m - 0.15), 1.05), (0.09, 0.09), None) for s in (-1, 1)]
    balls = [
        cylinder(0.17, 0.25, DARK_GREY, axis="y", sections=10).at(BLADE_PIVOT_M[0], s * (side_m - 0.05), 0.5)
        for s in (-1, 1)
    ]
    brackets = [box((0.12, 0.12, 0.5), None).at(RAM_HEAD_M[0], s * RAM_Y_M, RAM_HEAD_M[2] - 0.1) for s in (-1, 1)]
    return join([*arms, *struts, *balls, *brackets])


@lru_cache(maxsize=1)
def ripper() -> Mesh:
    """Return the ripper's frame with three shanks, raised."""
    shank = [(-2.35, 1.25), (-2.5, 1.25), (-2.55, 0.7), (-2.42, 0.42), (-2.38, 0.5), (-2.4, 0.72)]
    arms = [beam((-1.75, y, 0.85), (-2.45, y, 1.0), (0.12, 0.16), None) for y in (-0.4, 0.4)]
    links = [beam((-1.75, y, 1.25), (-2.45, y, 1.15), (0.1, 0.1), None) for y in (-0.4, 0.4)]
    return join(
        [
            *arms,
            *links,
            box((0.25, 1.9, 0.25), None).at(-2.45, 0.0, 0.95),
            *(profile(shank, 0.09, None, Surface.STEEL).at(0.0, y, 0.0) for y in (-0.8, 0.0, 0.8)),
        ]
    )
