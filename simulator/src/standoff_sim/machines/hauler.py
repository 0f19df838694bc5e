"""The two halves of an articulated hauler, in the frame of the straight machine."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from standoff_sim.machines.machine_parts import (
    beacon,
    cab,
    exhaust,
    grille,
    handrail,
    hull,
    ladder,
    lamp,
    mirror,
    moulded,
)
from standoff_sim.machines.paint import BLACK, DARK_GREY
from standoff_sim.solids.bars import bars
from standoff_sim.solids.mesh import Mesh, Surface, box, cylinder, join, profile, rotation, srgb

HITCH_X_M = 1.1
WHEEL_RADIUS_M = 0.92
WHEEL_WIDTH_M = 0.72
FRONT_AXLES_X_M = (2.5,)
REAR_AXLES_X_M = (-1.75, -3.5)
TRACK_M = 2.2
LENGTH_M = 10.25
WIDTH_M = TRACK_M + WHEEL_WIDTH_M


@lru_cache(maxsize=1)
def front_body() -> Mesh:
    """Return hood, cab and mudguards in the tint's colour, with what is black or glass on them."""
    outline = [(3.45, -0.8), (5.0, -0.68), (5.0, 0.68), (3.45, 0.8)]
    hood_top = hull(
        [
            (x, y, z)
            for x, half, z in ((3.45, 0.8, 2.4), (5.0, 0.62, 1.85), (3.45, 0.82, 1.5), (5.05, 0.7, 1.1))
            for y in (-half, half)
        ],
        None,
    )
    guard = [(1.35, 1.6), (1.55, 2.05), (3.35, 2.05), (3.75, 1.55), (3.65, 1.5), (3.3, 1.92), (1.65, 1.92), (1.5, 1.55)]
    guards = [profile(guard, 0.78, None).at(0.0, side * 1.08, 0.0) for side in (-1, 1)]
    cabin = cab(1.75, 1.65, 1.85, slant_m=0.3, sill=0.38).at(2.55, 0.0, 1.8)
    rails = [
        handrail([(3.4, s * 1.0, 2.35), (2.6, s * 1.35, 2.75), (1.6, s * 1.35, 2.75)], BLACK, floor_m=2.05)
        for s in (-1, 1)
    ]
    return join(
        [
            moulded(outline, 0.9, 1.6, 0.1, None),
            hood_top,
            *guards,
            cabin,
            *rails,
            box((0.9, 2.6, 0.12), DARK_GREY, Surface.STEEL).at(2.2, 0.0, 1.55),
            box((0.25, 2.5, 0.4), DARK_GREY, Surface.STEEL).at(5.0, 0.0, 0.75),
            grille(1.1, 0.6).moved(rotation("z", -90.0)).at(5.06, 0.0, 1.4),
            exhaust(1.3, 0.07).at(3.4, -0.72, 2.2),
            beacon().at(2.2, 0.6, 3.65),
            *(lamp(0.16).at(5.1, y, 1.35) for y in (-0.78, 0.78)),
            *(lamp(0.14).at(3.1, y, 3.55) for y in (-0.6, 0.6)),
            *(mirror(0.5, left=side > 0).at(3.3, side * 0.85, 2.9) for side in (-1, 1)),
            ladder((3.55, 1.25, 0.6), 1.0, 0.45, BLACK),
        ]
    )


@lru_cache(maxsize=1)
def front_frame() -> Mesh:
    """Return the front chassis: axle, hitch, belly."""
    return join(
        [
            box((3.4, 0.9, 0.6), None, Surface.STEEL).at(3.2, 0.0, 0.85),
            box((0.9, 0.7, 0.5), None, Surface.STEEL).at(1.4, 0.0, 0.85),
            cylinder(0.3, 0.9, None, sections=12).at(HITCH_X_M, 0.0, 1.1),
            cylinder(0.22, 1.8, None, axis="y", sections=10).at(2.5, 0.0, WHEEL_RADIUS_M),
        ]
    )


@lru_cache(maxsize=1)
def rear_frame() -> Mesh:
    """Return the rear chassis: two beams, bogie, axles."""
    beams = [((HITCH_X_M, side * 0.45, 1.2), (-4.3, side * 0.45, 1.2)) for side in (-1, 1)]
    bogies = [((-1.75, side * 0.62, 0.9), (-3.5, side * 0.62, 0.9)) for side in (-1, 1)]
    axles = [cylinder(0.2, 1.8, None, axis="y", sections=10).at(x, 0.0, WHEEL_RADIUS_M) for x in REAR_AXLES_X_M]
    return join(
        [
            bars(np.array(beams), 0.2, None, depth_m=0.4),
            bars(np.array(bogies), 0.2, None, depth_m=0.3),
            *axles,
            box((0.3, 1.3, 0.35), None, Surface.STEEL).at(-4.1, 0.0, 1.0),
            box((0.06, 1.9, 0.2), srgb("#8f1712"), Surface.PLASTIC).at(-4.28, 0.0, 1.05),
        ]
    )
