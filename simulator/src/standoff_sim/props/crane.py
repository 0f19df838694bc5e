"""A tower crane of real bars: mast, jib, counter-jib; its shadow is half of what one sees of it from above."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from standoff_sim.props.materials import aged
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.bars import bars, lattice
from standoff_sim.solids.mesh import Mesh, Surface, box, cylinder, join, rotation, srgb, translation, tube

_PAINTS = tuple(srgb(code) for code in ("#d99a12", "#c7b03a", "#b3341f", "#d8d5cc", "#8b9094", "#d07a1c"))
_MAST_M = 1.9
_SECTION_M = 6.0
_HEAVY = srgb("#a8a49b")


def make_crane(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a tower crane 24 to 42 m high, its jib pointing anywhere."""
    sections = int(rng.integers(4, 8))
    tint = aged(rng, _PAINTS, (0.75, 1.0))
    dust = rng.uniform(0.05, 0.3)
    mast = np.stack([translation(0.0, 0.0, 0.6 + level * _SECTION_M) for level in range(sections)])
    top_m = 0.6 + sections * _SECTION_M
    head = translation(0.0, 0.0, top_m) @ rotation("z", rng.uniform(0.0, 360.0))
    return (
        place(_base(), np.eye(4), dust=0.5),
        place(_mast_section(), mast, tint=tint, dust=dust),
        place(_head(int(rng.integers(3))), head, tint=tint, dust=dust),
        place(_hook(round(rng.uniform(5.0, 18.0))), head @ translation(rng.uniform(8.0, 28.0), 0.0, 0.0), dust=dust),
    )


@lru_cache(maxsize=1)
def _mast_section() -> Mesh:
    chords, bracing = lattice(_SECTION_M, (_MAST_M, _MAST_M), 1.5)
    ladder = [((x, 0.45, 0.0), (x, 0.45, _SECTION_M)) for x in (-0.2, 0.2)]
    return join(
        [
            bars(chords, 0.16, None, Surface.PAINT),
            bars(bracing, 0.075, None, Surface.PAINT),
            bars(np.array(ladder), 0.04, srgb("#8f9394")),
            box((0.9, 0.7, 0.04), srgb("#77797a"), Surface.STEEL).at(0.35, -0.45, _SECTION_M - 1.5),
        ]
    )


@lru_cache(maxsize=1)
def _base() -> Mesh:
    arms = [((-2.6, 0.0, 0.45), (2.6, 0.0, 0.45)), ((0.0, -2.6, 0.45), (0.0, 2.6, 0.45))]
    turned = bars(np.array(arms), 0.35, srgb("#7d6a3a"), Surface.PAINT).moved(rotation("z", 45.0))
    ballast = [box((1.3, 0.5, 1.1), _HEAVY, Surface.CONCRETE).at(x, y, 0.62) for x in (-0.3, 0.3) for y in (-1.6, 1.6)]
    return join([box((5.2, 5.2, 0.3), _HEAVY, Surface.CONCRETE), turned, *ballast])


@lru_cache(maxsize=3)
def _head(variant: int) -> Mesh:
    jib_m = (32.0, 40.0, 48.0)[variant]
    counter_m, apex_m, deck_m = 0.28 * jib_m, 6.5, 1.6
    chords, bracing = lattice(jib_m, (1.2, 1.3), 1.6, triangular=True)
    lying = translation(1.0, 0.0, deck_m + 0.6) @ rotation("y", 90.0) @ rotation("z", 180.0)
    jib = join([bars(chords, 0.11, None, Surface.PAINT), bars(bracing, 0.055, None, Surface.PAINT)]).moved(lying)
    rails = [((-counter_m, s * 0.6, deck_m + z), (-1.0, s * 0.6, deck_m + z)) for s in (-1, 1) for z in (0.1, 1.1)]
    stubs = [
        ((x, s * 0.6, deck_m), (x, s * 0.6, deck_m + 1.1)) for s in (-1, 1) for x in np.arange(-counter_m, -1, 2.0)
    ]
    apex = [((x, y, deck_m), (0.0, 0.0, deck_m + apex_m)) for x in (-0.7, 0.7) for y in (-0.7, 0.7)]
    ties = [((0.0, 0.0, deck_m + apex_m), (x, 0.0, deck_m + 1.2)) for x in (0.42 * jib_m, 0.8 * jib_m)]
    ties += [((0.0, 0.0, deck_m + apex_m), (1.5 - counter_m, s * 0.6, deck_m)) for s in (-1, 1)]
    weights = [
        box((0.5, 1.5, 2.2), _HEAVY, Surface.CONCRETE).at(0.8 - counter_m + 0.55 * k, 0.0, deck_m - 1.4)
        for k in range(4)
    ]
    return join(
        [
            jib,
            cylinder(0.95, 0.6, srgb("#5d5f60"), sections=20).at(0.0, 0.0, 0.3),
            box((1.8, 1.8, 1.0), None).at(0.0, 0.0, 0.6),
            box((1.4, 1.2, 1.9), srgb("#c9cac6")).at(1.1, -1.4, 0.4),
            box((1.42, 1.0, 0.9), srgb("#1d252b"), Surface.GLASS).at(1.12, -1.4, 1.1),
            box((counter_m - 1.0, 1.1, 0.1), srgb("#6d6f70"), Surface.STEEL).at(-(counter_m + 1.0) / 2, 0.0, deck_m),
            box((1.6, 1.0, 1.1), srgb("#55585a"), Surface.STEEL).at(3.2 - counter_m, 0.0, deck_m + 0.1),
            bars(np.array([*rails, *stubs]), 0.06, None, Surface.PAINT),
            bars(np.array(apex), 0.16, None, Surface.PAINT),
            bars(np.array(ties), 0.06, srgb("#4b4a48")),
            *weights,
        ]
    )


@lru_cache(maxsize=14)
def _hook(drop_m: int) -> Mesh:
    ropes = [((0.0, y, 1.4 - drop_m), (0.0, y, 1.5)) for y in (-0.25, 0.25)]
    crook = [
        (0.0, 0.0, 0.5 - drop_m),
        (0.12, 0.0, 0.3 - drop_m),
        (0.0, 0.0, 0.12 - drop_m),
        (-0.12, 0.0, 0.25 - drop_m),
    ]
    return join(
        [
            box((1.2, 1.2, 0.3), srgb("#5d5f60"), Surface.STEEL).at(0.0, 0.0, 1.5),
            bars(np.array(ropes), 0.035, srgb("#2d2c2a")),
            box((0.35, 0.7, 0.9), srgb("#c59a1a")).at(0.0, 0.0, 0.5 - drop_m),
            tube(crook, 0.05, srgb("#3b3a38"), sections=5),
        ]
    )
