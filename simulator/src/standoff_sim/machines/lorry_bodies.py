"""What lorries carry that does not tip: platforms and concrete mixers."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from standoff_sim.machines.lorry import FOUR_AXLES, FRAME_TOP_M, TWO_AXLES
from standoff_sim.machines.machine_parts import handrail, ladder
from standoff_sim.machines.paint import DARK_GREY, STEEL
from standoff_sim.solids.bars import bars
from standoff_sim.solids.mesh import (
    Mesh,
    Surface,
    box,
    cylinder,
    join,
    lathe,
    profile,
    rotation,
    slab,
    srgb,
    translation,
)

MIXER_AXIS = translation(FOUR_AXLES.deck_m[0] + 0.6, 0.0, 2.75) @ rotation("y", 11.0)
"""From the drum's frame, x along its axis towards the cab, origin in its mouth, to the lorry's."""


@lru_cache(maxsize=3)
def flatbed(variant: int) -> Mesh:
    """Return a platform with drop sides: empty, with timber and pallets, or with pipes."""
    rear_m, front_m = TWO_AXLES.deck_m
    length_m, middle_m, floor_m = front_m - rear_m, (front_m + rear_m) / 2, FRAME_TOP_M + 0.1
    sides = [box((length_m, 0.04, 0.4), None).at(middle_m, s * 1.22, floor_m) for s in (-1, 1)]
    posts = [
        ((x, s * 1.24, floor_m), (x, s * 1.24, floor_m + 0.42)) for x in (rear_m, middle_m, front_m) for s in (-1, 1)
    ]
    parts = [
        box((length_m, 2.48, 0.14), srgb("#7a6347"), Surface.WOOD).at(middle_m, 0.0, floor_m - 0.14),
        box((0.08, 2.4, 1.2), None).at(front_m, 0.0, floor_m),
        box((0.04, 2.4, 0.4), None).at(rear_m, 0.0, floor_m),
        bars(np.array(posts), 0.08, srgb("#4a4b4c")),
        *sides,
    ]
    if variant == 1:
        stacks = [((-1.0, 0.3), (2.4, 1.0, 0.7)), ((0.9, -0.5), (1.2, 0.9, 0.9)), ((-1.2, -0.75), (2.8, 0.7, 0.3))]
        tones = ("#b89560", "#a9a49a", "#a7844f")
        for ((x, y), size), tone in zip(stacks, tones, strict=True):
            parts.append(box(size, srgb(tone), Surface.WOOD).at(middle_m + x, y, floor_m))
    if variant == 2:
        for k, (y, z) in enumerate(
            [(y, 0.12) for y in np.linspace(-0.9, 0.9, 8)] + [(y, 0.33) for y in (-0.5, -0.2, 0.3)]
        ):
            pipe = cylinder(0.11, length_m - 0.4 - 0.05 * k, srgb("#9a5a3a"), Surface.RUST, axis="x", sections=8)
            parts.append(pipe.at(middle_m, float(y), floor_m + z))
    return join(parts)


@lru_cache(maxsize=3)
def mixer_drum(variant: int) -> Mesh:
    """Return a mixer's drum along x, its mouth at the origin, bands and stripes showing how it turns."""
    outline = [(0.0, 0.05), (0.5, 0.0), (0.62, 0.2), (1.12, 1.9), (1.17, 2.6), (1.1, 3.5), (0.75, 4.4), (0.0, 4.5)]
    shell = lathe(outline, None, Surface.PAINT, sections=18)
    parts = [shell.moved(rotation("y", 90.0))]
    ring = cylinder(1.19, 0.12, srgb("#4a4b4c"), Surface.STEEL, axis="x", sections=18)
    parts.append(ring.at(2.5, 0.0, 0.0))
    spiral = np.linspace(0, 1, 10)
    tone = (srgb("#a8321f"), srgb("#2a4f86"), srgb("#d9d7d0"))[variant]
    for start in (0.0, np.pi):
        angle = start + 2.2 * spiral
        x = 0.9 + 2.9 * spiral
        radius = np.interp(x, [z for _, z in outline[1:]], [r for r, _ in outline[1:]]) + 0.005
        points = np.column_stack([x, radius * np.cos(angle), radius * np.sin(angle)])
        parts.append(bars(np.stack([points[:-1], points[1:]], axis=1), 0.16, tone, Surface.PAINT, depth_m=0.04))
    return join(parts)


@lru_cache(maxsize=1)
def mixer_frame() -> Mesh:
    """Return the drum's stands, hopper, chute, water tank and ladder, in the lorry's frame."""
    rear_m, front_m = FOUR_AXLES.deck_m
    stand = [(0.0, 0.0), (0.9, 0.0), (0.6, 1.1), (0.2, 1.1)]
    hopper = lathe([(0.28, 0.0), (0.55, 0.55), (0.5, 0.55), (0.24, 0.0)], None, Surface.PAINT, sections=12)
    chute = slab([(0.0, -0.2), (1.5, -0.16), (1.5, 0.16), (0.0, 0.2)], 0.06, None, Surface.STEEL)
    return join(
        [
            *(profile(stand, 0.12, None).at(rear_m + 0.6, s * 0.6, FRAME_TOP_M) for s in (-1, 1)),
            profile([(0.0, 0.0), (0.7, 0.0), (0.5, 0.95), (0.1, 0.95)], 1.2, None).at(front_m - 0.75, 0.0, FRAME_TOP_M),
            box((0.5, 2.2, 0.6), srgb("#b9bab8"), Surface.PLASTIC).at(front_m + 0.05, 0.0, FRAME_TOP_M + 0.05),
            hopper.at(rear_m + 0.45, 0.0, 3.15),
            cylinder(0.12, 1.0, STEEL).at(rear_m + 0.25, 0.0, 1.5),
            chute.moved(translation(rear_m + 0.35, 0.0, 2.1) @ rotation("z", 150.0) @ rotation("y", 32.0)),
            ladder((rear_m + 0.55, 0.95, 0.8), 2.2, 0.4, DARK_GREY, steps=7),
            handrail([(rear_m + 0.3, 0.9, 3.5), (rear_m + 1.1, 0.9, 3.5)], DARK_GREY, floor_m=2.9),
            *(box((1.3, 0.5, 0.08), None).at(x, s * 0.98, FRAME_TOP_M) for x in (-2.3, 0.0) for s in (-1, 1)),
        ]
    )
