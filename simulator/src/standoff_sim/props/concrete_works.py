"""Works in progress: footings with starter bars, column stubs, walls in formwork, strips, rebar mats and cages."""

from __future__ import annotations

import numpy as np

from standoff_sim.props.materials import (
    BARE_STEEL,
    CONCRETE,
    FILM_FACED_PLY,
    FORMWORK_RED,
    FORMWORK_YELLOW,
    FRESH_CONCRETE,
    GALVANISED,
    WOODS,
    bar,
    block,
    single,
    varied,
)
from standoff_sim.props.prop import Prop
from standoff_sim.props.rebar import starters, steel_lattice
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.mesh import Colour, Mesh, Surface, cylinder, join, rotation, srgb, toned, translation

_SKIRT_M = 0.6
"""Concrete reaches this deep, so that it does not hang over a slope."""


def poured(size_m: tuple[float, float, float], colour: Colour = CONCRETE) -> Mesh:
    """Return a concrete block whose foot is in the ground, a little stained."""
    deep = block((size_m[0], size_m[1], size_m[2] + _SKIRT_M), colour, Surface.CONCRETE).at(0.0, 0.0, -_SKIRT_M)
    return deep


@varied
def footing(rng: np.random.Generator) -> Mesh:
    """Return a low footing with a column stub or starter bars."""
    side, height = rng.uniform(1.0, 2.4), rng.uniform(0.15, 0.6)
    colour = CONCRETE if rng.uniform() < 0.6 else FRESH_CONCRETE
    parts = [poured((side, side * rng.uniform(0.8, 1.2), height), colour)]
    stub = side * rng.uniform(0.22, 0.35)
    top = height
    if rng.uniform() < 0.6:
        top = height + rng.uniform(0.1, 0.9)
        parts.append(
            toned(block((stub + 0.1, stub + 0.1, top - height), colour, Surface.CONCRETE).at(0, 0, height), 0.9)
        )
    parts += starters(rng, (stub, stub), top, rng.uniform(0.5, 1.3), 0.16)
    return join(parts)


@varied
def _column(rng: np.random.Generator) -> Mesh:
    side, height = rng.uniform(0.3, 0.5), rng.uniform(1.3, 3.2)
    parts = [poured((side, side, height))]
    parts += starters(rng, (side - 0.1, side - 0.1), height, rng.uniform(0.6, 1.1), 0.15)
    return join(parts)


def _panel(size_m: tuple[float, float], frame: Colour, face: Colour) -> Mesh:
    width, height = size_m
    parts = [block((width, 0.03, height), face, Surface.WOOD).at(0.0, 0.05, 0.0)]
    for x in np.linspace(-width / 2 + 0.04, width / 2 - 0.04, 4):
        parts.append(block((0.06, 0.1, height), frame, Surface.PAINT).at(float(x), -0.01, 0.0))
    for z in np.linspace(0.0, height - 0.08, 4):
        parts.append(block((width, 0.1, 0.07), frame, Surface.PAINT).at(0.0, -0.01, float(z)))
    return join(parts)


def _brace(x_m: float, height_m: float, reach_m: float) -> Mesh:
    return join([
        bar((x_m, -0.05, 0.8 * height_m), (x_m, -reach_m, 0.0), 0.035, FORMWORK_RED, Surface.PAINT),
        bar((x_m, -0.05, 0.25 * height_m), (x_m, -reach_m, 0.05), 0.03, GALVANISED),
        block((0.25, 0.25, 0.03), GALVANISED, Surface.STEEL).at(x_m, -reach_m, 0.0),
    ])  # fmt: skip


@varied
def _column_form(rng: np.random.Generator) -> Mesh:
    side, height = rng.uniform(0.45, 0.7), rng.uniform(2.4, 3.3)
    frame = FORMWORK_YELLOW if rng.uniform() < 0.5 else FORMWORK_RED
    faces = [_panel((side, height), frame, FILM_FACED_PLY).at(0.0, -side / 2, 0.0).moved(rotation("z", turn))
             for turn in (0.0, 90.0, 180.0, 270.0)]  # fmt: skip
    braces = [_brace(0.0, height, 1.3).moved(rotation("z", turn)) for turn in (0.0, 90.0)]
    return join([*faces, *braces, *starters(rng, (side - 0.2, side - 0.2), height - 0.2, 0.9, 0.15)])


@varied
def _wall_form(rng: np.random.Generator) -> Mesh:
    panels, width, height = int(rng.integers(3, 6)), rng.uniform(0.9, 1.35), rng.uniform(1.5, 2.7)
    frame = (FORMWORK_YELLOW, FORMWORK_RED, srgb("#3a5f8c"))[int(rng.integers(3))]
    parts = []
    length = panels * width
    for number in range(panels):
        x = (number + 0.5) * width - length / 2
        face = toned(_panel((width - 0.02, height), frame, FILM_FACED_PLY), rng.uniform(0.7, 1.1))
        parts.append(face.at(x, -0.2, 0.0))
        if rng.uniform() < 0.6:
            parts.append(face.moved(rotation("z", 180.0)).at(x, 0.2, 0.0))
        parts.append(_brace(x, height, rng.uniform(1.2, 1.7)).at(0.0, -0.2, 0.0))
    parts += starters(rng, (length - 0.3, 0.2), 0.0, height + rng.uniform(0.1, 0.6), 0.25)
    return join(parts)


@varied
def _wall(rng: np.random.Generator) -> Mesh:
    length, height = rng.uniform(2.5, 6.0), rng.uniform(0.6, 2.4)
    parts = [poured((length, 0.25, height))]
    if rng.uniform() < 0.5:
        wing = rng.uniform(1.5, 3.0)
        parts.append(toned(poured((0.25, wing, height * 0.999)), 0.93).at((0.25 - length) / 2, wing / 2 - 0.125, 0.0))
    parts += starters(rng, (length - 0.2, 0.15), height, rng.uniform(0.4, 0.9), 0.25)
    return join(parts)


@varied
def _strip(rng: np.random.Generator) -> Mesh:
    length, height = rng.uniform(4.0, 8.0), rng.uniform(0.12, 0.45)
    wood = WOODS[int(rng.integers(len(WOODS)))]
    parts = [poured((length, rng.uniform(0.4, 0.7), height), FRESH_CONCRETE)]
    for side in (-0.4, 0.4):
        parts.append(block((length + 0.1, 0.035, height + 0.05), wood, Surface.WOOD).at(0.0, side, 0.0))
        for x in np.arange(-length / 2 + 0.3, length / 2, 1.2):
            parts.append(block((0.05, 0.05, 0.5), wood, Surface.WOOD).at(float(x), 1.1 * side, 0.0))
    parts += starters(rng, (length - 0.3, 0.2), height, rng.uniform(0.3, 0.7), 0.5)
    return join(parts)


@varied
def _deck(rng: np.random.Generator) -> Mesh:
    """A slab in its edge boards, half of it still bare mats on blinding."""
    length, width, height = rng.uniform(5.0, 8.0), rng.uniform(4.0, 6.0), rng.uniform(0.12, 0.3)
    wood = WOODS[int(rng.integers(len(WOODS)))]
    parts = [toned(poured((length, width, 0.04), CONCRETE), 1.1)]
    poured_length = length * rng.uniform(0.35, 0.7)
    parts.append(poured((poured_length, width, height), FRESH_CONCRETE).at((poured_length - length) / 2, 0.0, 0.0))
    for side in (-1, 1):
        parts.append(block((length + 0.1, 0.04, height + 0.06), wood, Surface.WOOD).at(0.0, side * width / 2, 0.0))
    bare = length - poured_length
    parts.append(steel_lattice((bare, width - 0.1), 0.3, 0.014, rng).at(poured_length / 2, 0.0, 0.12))
    for x in (-0.3, 0.3):
        parts += [join(starters(rng, (0.3, 0.3), height, 0.9, 0.15)).at(x * length, y * width, 0.0)
                  for y in (-0.25, 0.25)]  # fmt: skip
    return join(parts)


@varied
def _shoring(rng: np.random.Generator) -> Mesh:
    """A trench box: two steel sheets held apart by struts, standing on the ground before it goes in."""
    length, height, gap = rng.uniform(2.4, 3.6), rng.uniform(1.2, 2.2), rng.uniform(0.9, 1.4)
    colour = (FORMWORK_YELLOW, FORMWORK_RED, srgb("#4c6b8a"), BARE_STEEL)[int(rng.integers(4))]
    parts = []
    for side in (-1, 1):
        parts.append(block((length, 0.1, height), colour, Surface.PAINT).at(0.0, side * gap / 2, 0.0))
        parts += [block((0.14, 0.16, height + 0.1), colour, Surface.PAINT).at(x * length, side * gap / 2, 0.0)
                  for x in (-0.45, 0.0, 0.45)]  # fmt: skip
    for x in (-0.4, 0.4):
        for z in (0.3, 0.8):
            strut = cylinder(0.06, gap, BARE_STEEL, axis="y", sections=8)
            parts.append(strut.at(x * length, 0.0, z * height))
    return join(parts)


@varied
def _shoring_boards(rng: np.random.Generator) -> Mesh:
    """Boards driven along a trench: an uneven palisade with walings."""
    length = rng.uniform(3.0, 6.0)
    parts = []
    for x in np.arange(-length / 2, length / 2, 0.27):
        board = block((0.25, 0.05, rng.uniform(0.5, 1.0)), WOODS[int(rng.integers(len(WOODS)))], Surface.WOOD)
        parts.append(toned(board, rng.uniform(0.7, 1.0)).at(float(x), rng.normal(0.0, 0.015), 0.0))
    parts.append(block((length, 0.12, 0.15), WOODS[2], Surface.WOOD).at(0.0, -0.09, 0.25))
    return join(parts)


def _footing_rows(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Rows of equal footings on the building's grid, as most foundation works show them."""
    rows, columns, pitch = int(rng.integers(1, 3)), int(rng.integers(2, 4)), rng.uniform(3.2, 4.2)
    x, y = np.meshgrid((np.arange(columns) - (columns - 1) / 2) * pitch, (np.arange(rows) - (rows - 1) / 2) * pitch)
    poses = np.stack([translation(east, north, 0.0) for east, north in zip(x.ravel(), y.ravel(), strict=True)])
    works = footing(int(rng.integers(8)))
    return (place(works, poses, tint=(1.0, 1.0, 1.0), dust=rng.uniform(0.1, 0.6, len(poses))),)


CONCRETE_WORKS: tuple[Prop, ...] = (
    single("footing", 1.8, 2.0, footing, variants=8),
    Prop("footing rows", 6.5, _footing_rows, 1.2),
    single("column stub", 0.8, 1.2, _column),
    single("column in formwork", 1.8, 0.9, _column_form),
    single("wall in formwork", 3.6, 0.9, _wall_form),
    single("concrete wall", 3.6, 0.7, _wall),
    single("strip foundation", 4.2, 1.0, _strip),
    single("slab", 5.2, 0.8, _deck),
    single("trench box", 2.0, 0.5, _shoring),
    single("shoring boards", 3.2, 0.6, _shoring_boards),
)
