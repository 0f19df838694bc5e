"""Things people use and leave standing: barrows, ladders, tripods, posts, bottles, mixers; many as tall as a person."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from standoff_sim.props.materials import (
    BARE_STEEL,
    DARK_PLASTIC,
    FADED,
    FORMWORK_RED,
    FORMWORK_YELLOW,
    GALVANISED,
    HOLE,
    RUSTY_STEEL,
    WHITE_PLASTIC,
    WOODS,
    bar,
    block,
    laid,
    mound,
    single,
    tints,
    varied,
)
from standoff_sim.props.prop import Prop
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.mesh import (
    Mesh,
    Surface,
    ball,
    cylinder,
    join,
    lathe,
    profile,
    rotation,
    srgb,
    toned,
    translation,
)

_TAPES = (srgb("#c23a24"), srgb("#d87a1c"), srgb("#d8d6cf"), srgb("#d9c02f"))
_GASES = (srgb("#9a2f24"), srgb("#2f5f8f"), srgb("#7d7f80"), srgb("#3f6f4f"), srgb("#c8c7c0"))
_BUCKETS = (srgb("#232325"), srgb("#c9c7c0"), srgb("#b5521f"), srgb("#2f5fa0"), srgb("#c9a227"))
_VESTS = (srgb("#d9e021"), srgb("#e8671b"))


@varied
def _barrow(rng: np.random.Generator) -> Mesh:
    """A wheelbarrow, sometimes with a load, sometimes tipped on its nose."""
    colour = (srgb("#2f6a45"), srgb("#b5391f"), BARE_STEEL, srgb("#2d4f86"))[int(rng.integers(4))]
    tray = profile([(-0.4, 0.35), (0.35, 0.3), (0.6, 0.62), (-0.48, 0.62)], 0.6, colour, Surface.PAINT)
    load = block((0.9, 0.52, 0.01), HOLE, Surface.SOIL).at(0.05, 0.0, 0.618)
    parts = [tray, load, cylinder(0.2, 0.08, DARK_PLASTIC, Surface.RUBBER, axis="y", sections=12).at(0.72, 0.0, 0.2)]
    for side in (-0.24, 0.24):
        parts += [bar((0.72, 0.5 * side, 0.2), (-0.95, 1.2 * side, 0.58), 0.02, RUSTY_STEEL),
                  bar((-0.25, side, 0.4), (-0.35, side, 0.0), 0.02, RUSTY_STEEL)]  # fmt: skip
    if rng.uniform() < 0.5:
        parts.append(mound(rng, 0.45, 0.16, srgb("#a58c66"), rings=5, sectors=12).at(0.05, 0.0, 0.6))
    return join(parts)


@varied
def _ladder(rng: np.random.Generator) -> Mesh:
    length, colour = rng.uniform(2.5, 5.0), (GALVANISED, WOODS[1], FORMWORK_YELLOW)[int(rng.integers(3))]
    parts = [block((length, 0.05, 0.07), colour, Surface.STEEL).at(0.0, y, 0.01) for y in (-0.22, 0.22)]
    parts += [block((0.035, 0.44, 0.035), colour, Surface.STEEL).at(float(x), 0.0, 0.03)
              for x in np.arange(-length / 2 + 0.15, length / 2, 0.28)]  # fmt: skip
    return join(parts)


@varied
def _tripod(rng: np.random.Generator) -> Mesh:
    """A surveyor's tripod, as tall as a person, with or without its instrument."""
    top = rng.uniform(1.25, 1.5)
    legs = [bar((0.0, 0.0, top), (0.55 * np.cos(turn), 0.55 * np.sin(turn), 0.0), 0.028, FORMWORK_YELLOW, Surface.PAINT)
            for turn in np.deg2rad((90.0, 210.0, 330.0))]  # fmt: skip
    head = cylinder(0.09, 0.05, DARK_PLASTIC, Surface.PLASTIC, sections=10).at(0.0, 0.0, top)
    parts = [*legs, head]
    if rng.uniform() < 0.7:
        parts.append(block((0.17, 0.2, 0.3), FORMWORK_YELLOW, Surface.PAINT).at(0.0, 0.0, top + 0.03))
    return join(parts)


@varied
def _gas_bottles(rng: np.random.Generator) -> Mesh:
    """Tall gas bottles on a trolley or standing in a frame."""
    parts = [block((0.75, 0.4, 0.05), RUSTY_STEEL, Surface.STEEL), block((0.75, 0.03, 1.1), RUSTY_STEEL, Surface.STEEL)
             .at(0.0, 0.2, 0.0)]  # fmt: skip
    outline = [(0.0, 0.05), (0.115, 0.05), (0.115, 1.25), (0.07, 1.42), (0.035, 1.45), (0.035, 1.6), (0.0, 1.6)]
    for x in np.array([-0.25, 0.0, 0.25])[: int(rng.integers(2, 4))]:
        colour = _GASES[int(rng.integers(len(_GASES)))]
        parts.append(lathe(outline, colour, Surface.PAINT, sections=10).at(float(x), 0.0, 0.0))
    return join(parts)


@varied
def _mixer(rng: np.random.Generator) -> Mesh:
    """A small concrete mixer on two wheels, its drum tilted."""
    colour = (FORMWORK_RED, srgb("#c8741c"), srgb("#33588c"), GALVANISED)[int(rng.integers(4))]
    drum = lathe(
        [(0.0, -0.38), (0.28, -0.34), (0.4, 0.0), (0.22, 0.42), (0.19, 0.42)], colour, Surface.PAINT, sections=14
    )
    mouth = cylinder(0.19, 0.01, HOLE, Surface.PAINT, sections=12).at(0.0, 0.0, 0.4)
    tilt = translation(0.0, 0.0, 0.95) @ rotation("y", rng.uniform(25.0, 75.0)) @ rotation("z", rng.uniform(0.0, 360.0))
    parts = [join([drum, mouth]).moved(tilt), block((0.3, 0.32, 0.35), colour, Surface.PAINT).at(-0.45, 0.0, 0.6)]
    for side in (-0.33, 0.33):
        wheel = cylinder(0.24, 0.07, DARK_PLASTIC, Surface.RUBBER, axis="y", sections=12)
        parts.append(wheel.at(-0.35, side, 0.24))
        parts += [bar(foot, (0.0, side, 0.95), 0.03, RUSTY_STEEL) for foot in ((-0.35, side, 0.25), (0.45, side, 0.0))]
    return join(parts)


@varied
def _post(rng: np.random.Generator) -> Mesh:
    """Something slim that stands: a sign, a striped marker, a standpipe, a post with tape, a pipe with a cap."""
    kind, height = int(rng.integers(4)), rng.uniform(1.3, 2.0)
    if kind == 0:
        colour = (srgb("#2f5fa0"), WHITE_PLASTIC, FORMWORK_YELLOW)[int(rng.integers(3))]
        face = cylinder(0.3, 0.02, colour, Surface.PAINT, axis="y", sections=14)
        return join([bar((0, 0, 0), (0, 0, height + 0.3), 0.03, GALVANISED), face.at(0.0, -0.04, height),
                     block((0.5, 0.5, 0.1), DARK_PLASTIC, Surface.RUBBER)])  # fmt: skip
    if kind == 1:
        bands = [cylinder(0.07, 0.25, (FORMWORK_RED, WHITE_PLASTIC)[n % 2], Surface.PLASTIC, sections=8)
                 .at(0.0, 0.0, 0.125 + 0.25 * n) for n in range(5)]  # fmt: skip
        return join([*bands, block((0.4, 0.4, 0.07), DARK_PLASTIC, Surface.RUBBER)])
    if kind == 2:
        radius = rng.uniform(0.1, 0.22)
        pipe = cylinder(radius, height, FADED[int(rng.integers(len(FADED)))], Surface.PLASTIC, sections=12)
        return join([pipe.at(0.0, 0.0, height / 2), cylinder(0.8 * radius, 0.01, HOLE, Surface.PLASTIC, sections=10)
                     .at(0.0, 0.0, height)])  # fmt: skip
    stake = block((0.09, 0.09, height), WOODS[int(rng.integers(len(WOODS)))], Surface.WOOD)
    head = block((0.11, 0.11, 0.25), _TAPES[int(rng.integers(4))], Surface.PAINT).at(0.0, 0.0, height - 0.2)
    return join([stake, head])


@varied
def _rolls_upright(rng: np.random.Generator) -> Mesh:
    """Rolls of roofing felt or membrane on end: the height and width of people seen from above."""
    parts = []
    for number in range(int(rng.integers(2, 6))):
        height, radius = rng.uniform(1.0, 1.7), rng.uniform(0.13, 0.24)
        roll = cylinder(radius, height, None, Surface.FABRIC, sections=12)
        core = cylinder(0.05, 0.01, HOLE, Surface.FABRIC, sections=6).at(0.0, 0.0, height / 2)
        spot = (0.5 * (number % 3) - 0.5, 0.5 * (number // 3) - 0.2, height / 2)
        parts.append(toned(join([roll, core]), rng.uniform(0.7, 1.0)).at(*spot))
    return join(parts)


@varied
def _bucket(rng: np.random.Generator) -> Mesh:
    height = rng.uniform(0.25, 0.4)
    shell = lathe([(0.0, 0.0), (0.12, 0.0), (0.16, height)], None, Surface.PLASTIC, sections=10)
    fill = cylinder(0.15, 0.01, HOLE if rng.uniform() < 0.6 else srgb("#8d8a83"), Surface.SOIL, sections=10)
    return join([shell, fill.at(0.0, 0.0, height - 0.03)])


def _buckets(rng: np.random.Generator) -> tuple[Batch, ...]:
    count = int(rng.integers(1, 6))
    poses = []
    for x, y in rng.uniform(-0.7, 0.7, (count, 2)):
        tipped = rng.uniform() < 0.25
        turn = rotation("z", rng.uniform(0.0, 360.0))
        poses.append(translation(x, y, 0.15 if tipped else 0.0) @ turn @ rotation("x", 84.0 if tipped else 0.0))
    return (place(_bucket(int(rng.integers(6))), np.stack(poses), tint=tints(rng, _BUCKETS, count), dust=0.4),)


@varied
def _stakes(rng: np.random.Generator) -> Mesh:
    """Pegs with string or tape between them, as setting-out leaves them."""
    count, step, height = int(rng.integers(3, 6)), rng.uniform(1.0, 1.8), rng.uniform(0.5, 1.1)
    tape = _TAPES[int(rng.integers(len(_TAPES)))]
    parts, tops = [], []
    for number in range(count):
        x, y = (number - (count - 1) / 2) * step, rng.normal(0.0, 0.06)
        parts.append(block((0.05, 0.05, height), WOODS[int(rng.integers(6))], Surface.WOOD).at(x, y, 0.0))
        parts.append(block((0.06, 0.06, 0.12), tape, Surface.PAINT).at(x, y, height - 0.1))
        tops.append((x, y, height * 0.85))
    for start, stop in pairwise(tops):
        middle = (0.5 * (start[0] + stop[0]), 0.5 * (start[1] + stop[1]), 0.9 * start[2])
        for piece in ((start, middle), (middle, stop)):
            parts.append(bar(*piece, 0.02, tape, Surface.PLASTIC, sections=3, capped=False))
    return join(parts)


@varied
def _trestle(rng: np.random.Generator) -> Mesh:
    """A work bench: trestles with a board and things on it; sometimes a vest or jacket thrown over."""
    wood = WOODS[int(rng.integers(6))]
    parts = [block((1.8, 0.7, 0.04), wood, Surface.WOOD).at(0.0, 0.0, 0.8)]
    for x in (-0.7, 0.7):
        parts += [bar((x, y, 0.8), (x, 1.4 * y, 0.0), 0.03, wood, Surface.WOOD, sections=4) for y in (-0.25, 0.25)]
    for _ in range(int(rng.integers(2, 6))):
        size = rng.uniform((0.1, 0.1, 0.05), (0.45, 0.3, 0.3))
        thing = block((size[0], size[1], size[2]), FADED[int(rng.integers(len(FADED)))], Surface.PAINT)
        parts.append(laid(thing, rng.uniform((-0.7, -0.2), (0.7, 0.2)), 0.84, rng.uniform(0.0, 90.0)))
    if rng.uniform() < 0.4:
        cloth = ball((0.28, 0.22, 0.06), _VESTS[int(rng.integers(2))], Surface.FABRIC, detail=1)
        parts.append(cloth.at(0.5, 0.1, 0.88))
    return join(parts)


@varied
def _tool_boxes(rng: np.random.Generator) -> Mesh:
    parts = []
    for number in range(int(rng.integers(1, 4))):
        colour = FADED[int(rng.integers(len(FADED)))]
        size = (float(rng.uniform(0.5, 1.3)), float(rng.uniform(0.35, 0.6)), float(rng.uniform(0.25, 0.7)))
        lid = toned(block((size[0] * 1.02, size[1] * 1.02, 0.06), colour, Surface.PAINT), 0.8)
        chest = join([block(size, colour, Surface.PAINT), lid.at(0.0, 0.0, size[2])])
        parts.append(laid(chest, (rng.normal(0.0, 0.1), 0.75 * number - 0.5), 0.0, rng.normal(0.0, 10.0)))
    return join(parts)


def _props_standing(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Steel props in a loose group, upright: thin, as tall as people, in rows."""
    count = int(rng.integers(3, 9))
    x, y = np.divmod(np.arange(count), 3)
    poses = np.stack([
        translation(0.9 * x[n] - 0.9, 0.9 * y[n] - 0.9, 0.0) @ rotation("x", rng.normal(0.0, 2.0)) for n in range(count)
    ])  # fmt: skip
    colours = tints(rng, (FORMWORK_RED, FORMWORK_YELLOW, GALVANISED), 1)
    return (place(_steel_prop(int(rng.integers(3))), poses, tint=np.repeat(colours, count, axis=0), dust=0.3),)


@varied
def _steel_prop(rng: np.random.Generator) -> Mesh:
    height = rng.uniform(2.0, 3.0)
    return join([
        bar((0, 0, 0), (0, 0, 0.6 * height), 0.035, None, Surface.PAINT, sections=5),
        bar((0, 0, 0.5 * height), (0, 0, height), 0.026, GALVANISED, sections=5),
        block((0.16, 0.16, 0.02), None, Surface.PAINT),
        block((0.2, 0.2, 0.02), GALVANISED, Surface.STEEL).at(0.0, 0.0, height),
    ])  # fmt: skip


TOOLS: tuple[Prop, ...] = (
    single("wheelbarrow", 1.1, 0.9, _barrow, free=True),
    single("ladder", 2.6, 0.8, _ladder, free=True),
    single("tripod", 0.7, 0.6, _tripod, free=True),
    single("gas bottles", 0.6, 0.7, _gas_bottles),
    single("small mixer", 0.9, 1.0, _mixer, free=True),
    single("post", 0.5, 2.0, _post, free=True, variants=12),
    single("rolls on end", 1.0, 0.8, _rolls_upright, (DARK_PLASTIC, WHITE_PLASTIC, *FADED)),
    Prop("buckets", 1.1, _buckets, 1.0),
    single("stakes and tape", 3.8, 1.2, _stakes),
    single("trestle", 1.1, 0.9, _trestle),
    single("tool chests", 1.3, 0.9, _tool_boxes),
    Prop("steel props", 1.5, _props_standing, 0.8),
)
