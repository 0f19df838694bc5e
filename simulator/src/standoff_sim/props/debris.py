"""What lies about: planks, film, cardboard, hoses and cables, tarpaulins, drums of cable, tyres, rope, offcuts."""

from __future__ import annotations

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.props.materials import (
    DARK_PLASTIC,
    FADED,
    FILM_FACED_PLY,
    HOLE,
    RUSTY_STEEL,
    WHITE_PLASTIC,
    WOODS,
    bar,
    block,
    laid,
    relief,
    ripples,
    scattered,
    single,
    tints,
    tubular,
    varied,
)
from standoff_sim.props.prop import Prop
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.mesh import Mesh, Surface, cylinder, join, rotation, srgb, toned, translation, tube

_HOSES = tuple(srgb(code) for code in ("#26262a", "#b5401f", "#c2a01f", "#2f5fa0", "#3f6b45", "#8f8f8c", "#d06a1c"))
_CARDBOARD = (srgb("#9a7b56"), srgb("#b0936a"), srgb("#7f684c"))
_FILMS = (WHITE_PLASTIC, WHITE_PLASTIC, srgb("#b5babd"), srgb("#2a2b2e"), srgb("#5c7f9c"))
_TARPAULINS = (srgb("#2f5f93"), srgb("#4b6a48"), srgb("#8d8f8d"), srgb("#3a3b3d"), srgb("#a9a08c"), srgb("#b96a2a"))
_BAGS = (DARK_PLASTIC, DARK_PLASTIC, srgb("#3f5f9a"), WHITE_PLASTIC)
_CORES = (srgb("#222224"), srgb("#b85c1e"), srgb("#8f2f24"), srgb("#5a5a5c"))


@varied
def plank(rng: np.random.Generator) -> Mesh:
    """Return a board lying on the ground."""
    return block((rng.uniform(1.2, 4.0), rng.uniform(0.12, 0.25), rng.uniform(0.025, 0.05)), None, Surface.WOOD)


@varied
def _beam(rng: np.random.Generator) -> Mesh:
    """A formwork girder: yellow wood with an I section."""
    length = rng.uniform(2.4, 4.5)
    wood = srgb("#b98f33")
    return join([
        block((length, 0.08, 0.04), wood, Surface.WOOD),
        toned(block((length, 0.03, 0.12), wood, Surface.WOOD), 0.7).at(0.0, 0.0, 0.04),
        block((length, 0.08, 0.04), wood, Surface.WOOD).at(0.0, 0.0, 0.16),
    ])  # fmt: skip


@varied
def _offcut(rng: np.random.Generator) -> Mesh:
    return block((rng.uniform(0.3, 0.9), rng.uniform(0.06, 0.3), rng.uniform(0.02, 0.1)), None, Surface.WOOD)


def _dropped(rng: np.random.Generator, count: int, spread_m: float, aligned: bool) -> FloatArray:
    """Poses of long things thrown on a loose heap, each a little on top of the one before."""
    poses = []
    for number in range(count):
        turn_deg = rng.normal(0.0, 12.0) if aligned else rng.uniform(0.0, 180.0)
        x, y = rng.normal(0.0, spread_m, 2).clip(-2 * spread_m, 2 * spread_m)
        tilt = rotation("y", rng.normal(0.0, 1.5))
        poses.append(translation(x, y, 0.03 * number + 0.01) @ rotation("z", turn_deg) @ tilt)
    return np.stack(poses)


def _planks(rng: np.random.Generator) -> tuple[Batch, ...]:
    count = int(rng.integers(2, 9))
    poses = _dropped(rng, count, 0.35, rng.uniform() < 0.6)
    return (place(plank(int(rng.integers(6))), poses, tint=tints(rng, WOODS, count, 0.3), dust=0.4),)


def _beams(rng: np.random.Generator) -> tuple[Batch, ...]:
    count = int(rng.integers(2, 8))
    across = np.stack([
        translation(rng.normal(0.0, 0.1), 0.12 * number - 0.06 * count, 0.0) @ rotation("z", rng.normal(0.0, 2.0))
        for number in range(count)
    ])  # fmt: skip
    poses = across if rng.uniform() < 0.6 else _dropped(rng, count, 0.3, True)
    return (place(_beam(int(rng.integers(6))), poses, dust=rng.uniform(0.1, 0.6, count)),)


def _waste_wood(rng: np.random.Generator) -> tuple[Batch, ...]:
    """A heap of offcuts and boards for the skip."""
    batches = []
    for build, count in ((_offcut, 14), (_offcut, 10), (plank, 5)):
        poses = scattered(rng, rng.normal(0.0, 0.5, (count, 2)).clip(-1.1, 1.1), rng.uniform(0.0, 0.25, count), 1.0)
        poses = poses @ rotation("y", rng.uniform(-8.0, 8.0))
        batches.append(place(build(int(rng.integers(6))), poses, tint=tints(rng, (*WOODS, FILM_FACED_PLY), count, 0.3),
                             dust=0.3))  # fmt: skip
    return tuple(batches)


@varied
def _film(rng: np.random.Generator) -> Mesh:
    """Plastic film or a bag, crumpled and flat by turns."""
    length, width = rng.uniform(0.8, 2.4), rng.uniform(0.6, 1.6)
    return _cloth(rng, (length, width), (15, 12), rng.uniform(0.04, 0.16), Surface.PLASTIC)


def _cloth(
    rng: np.random.Generator, size_m: tuple[float, float], cells: tuple[int, int], height_m: float, surface: Surface
) -> Mesh:
    axes = [np.linspace(-side / 2, side / 2, count) for side, count in zip(size_m, cells, strict=True)]
    xy = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    folds = ripples(rng, xy, 0.7, 4)
    drift = 0.12 * np.stack([ripples(rng, xy, 1.0, 2), ripples(rng, xy, 1.0, 2)], axis=-1)
    z = 0.01 + height_m * np.maximum(folds + 0.35, 0.0)
    return relief(np.concatenate([xy + drift, z[..., None]], axis=-1), None, surface, mottling=0.1)


@varied
def _covered_stack(rng: np.random.Generator) -> Mesh:
    """A stack under a tarpaulin that hangs to the ground, held down by a plank."""
    half = rng.uniform((0.6, 0.4), (1.4, 0.8))
    height = rng.uniform(0.4, 1.2)
    axes = [np.linspace(-side - 0.45, side + 0.45, 19) for side in half]
    xy = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    beyond = np.max(np.abs(xy) - half, axis=-1)
    drape = np.clip(1.0 - np.maximum(beyond, 0.0) / 0.22, 0.0, 1.0)
    z = height * drape * (1.0 + 0.05 * ripples(rng, xy, 1.0, 3)) + 0.03 * np.abs(ripples(rng, xy, 0.5, 3))
    sheet = relief(np.concatenate([xy, z[..., None]], axis=-1), None, Surface.PLASTIC)
    weight = block((half[0] * 1.6, 0.15, 0.05), WOODS[2], Surface.WOOD)
    return join([sheet, weight.at(0.0, rng.normal(0.0, 0.1), 1.06 * height)])


@varied
def _carton(rng: np.random.Generator) -> Mesh:
    """A flattened or an open box of cardboard."""
    if rng.uniform() < 0.5:
        return _cloth(rng, (rng.uniform(0.7, 1.3), rng.uniform(0.5, 0.9)), (6, 5), 0.04, Surface.WOOD)
    side, height = rng.uniform(0.35, 0.7), rng.uniform(0.25, 0.5)
    flaps = [block((side, 0.2, 0.012), None, Surface.WOOD).moved(
        rotation("z", turn) @ translation(0.0, -side / 2 - 0.08, height - 0.04) @ rotation("x", rng.uniform(10.0, 50.0))
    ) for turn in (0.0, 90.0, 180.0, 270.0)]  # fmt: skip
    inside = block((side - 0.02, side - 0.02, 0.01), HOLE, Surface.WOOD).at(0.0, 0.0, height - 0.004)
    return join([block((side, side, height), None, Surface.WOOD), inside, *flaps])


@varied
def _hose(rng: np.random.Generator) -> Mesh:
    """A hose or cable that wanders over the ground."""
    count = 26
    turn = np.cumsum(rng.normal(0.0, 0.32, count))
    path = np.cumsum(0.3 * np.column_stack([np.cos(turn), np.sin(turn)]), axis=0)
    radius = rng.uniform(0.012, 0.045)
    path = path - (path.max(axis=0) + path.min(axis=0)) / 2
    return tube(np.column_stack([path, np.full(count, radius)]), radius, None, Surface.RUBBER, sections=4)


@varied
def _coil(rng: np.random.Generator) -> Mesh:
    """A coil of hose, drainage pipe or rope, with its end let out."""
    outer, radius = rng.uniform(0.3, 0.75), rng.uniform(0.02, 0.06)
    turns = rng.uniform(3.0, 5.0)
    angle = np.linspace(0.0, 2 * np.pi * turns, int(14 * turns))
    reach = outer * (1.0 - 0.05 * np.sin(1.7 * angle)) * rng.uniform(0.94, 1.06, len(angle))
    z = radius + np.linspace(0.0, 1.7 * radius * (turns - 1), len(angle))
    tail = np.array([[2.2 * outer, -1.5 * outer, radius], [1.5 * outer, -0.9 * outer, radius]])
    path = np.vstack([tail, np.column_stack([reach * np.cos(angle), reach * np.sin(angle), z])])
    return tube(path, radius, None, Surface.PLASTIC, sections=4)


@varied
def _cable_drum(rng: np.random.Generator) -> Mesh:
    """A wooden drum, wound with cable or empty, upright or on its side."""
    radius, width = rng.uniform(0.4, 1.0), rng.uniform(0.4, 0.8)
    core = cylinder(radius * rng.uniform(0.45, 0.85), width, _CORES[int(rng.integers(4))], Surface.RUBBER, sections=14)
    wood = WOODS[int(rng.integers(len(WOODS)))]
    flange = join([
        cylinder(radius, 0.06, wood, Surface.WOOD, sections=18),
        cylinder(0.06, 0.064, HOLE, Surface.WOOD, sections=8),
    ])  # fmt: skip
    drum = join([core, flange.at(0.0, 0.0, width / 2), toned(flange, 0.85).at(0.0, 0.0, -width / 2)])
    if rng.uniform() < 0.5:
        return drum.at(0.0, 0.0, width / 2 + 0.03)
    return drum.moved(rotation("x", 90.0)).at(0.0, 0.0, radius)


@varied
def _tyre(rng: np.random.Generator) -> Mesh:
    radius, width = rng.uniform(0.3, 0.75), rng.uniform(0.2, 0.4)
    one = tubular(radius, 0.55 * radius, width, srgb("#2c2b2a"), Surface.RUBBER)
    return join(
        [laid(one, rng.normal(0.0, 0.04, 2), (level + 0.5) * width, 0.0) for level in range(int(rng.integers(1, 4)))]
    )


def _tyres(rng: np.random.Generator) -> tuple[Batch, ...]:
    count = int(rng.integers(1, 4))
    xy = np.column_stack([np.arange(count) * 1.3 - 0.65 * (count - 1), rng.normal(0.0, 0.15, count)])
    return (place(_tyre(int(rng.integers(6))), scattered(rng, xy, 0.0, rng.uniform(0.75, 1.0, count)), dust=0.5),)


@varied
def _scrap_steel(rng: np.random.Generator) -> Mesh:
    """Bent offcuts of rebar and sheet in a tangle."""
    parts = []
    for _ in range(int(rng.integers(14, 30))):
        start = np.append(rng.normal(0.0, 0.4, 2), rng.uniform(0.02, 0.25))
        turn, length = rng.uniform(0.0, 2 * np.pi), rng.uniform(0.3, 1.3)
        bend = start + length * np.array([np.cos(turn), np.sin(turn), rng.normal(0.0, 0.1)])
        bend[2] = max(bend[2], 0.02)
        parts.append(toned(bar(start, bend, 0.014, RUSTY_STEEL, Surface.RUST, sections=3, capped=False),
                           rng.uniform(0.6, 1.2)))  # fmt: skip
    return join(parts)


def _walkway(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Boards laid end to end over mud and puddles."""
    rows, columns = int(rng.integers(2, 4)), int(rng.integers(2, 4))
    board = plank(int(rng.integers(6)))
    length_m = float(np.ptp(board.vertices_m[:, 0]))
    poses = np.stack([
        translation((column - (columns - 1) / 2) * 0.97 * length_m, (row - (rows - 1) / 2) * 0.27, 0.02)
        @ rotation("z", rng.normal(0.0, 2.5))
        for row in range(rows)
        for column in range(columns)
    ])  # fmt: skip
    return (place(board, poses, tint=tints(rng, WOODS, len(poses), 0.25), dust=0.7),)


@varied
def _bin_bags(rng: np.random.Generator) -> Mesh:
    """Full rubbish bags leaning on each other."""
    angle = np.linspace(0.0, 2 * np.pi, 13)
    shape = ((0.05, 1.0), (0.12, 0.86), (0.75, 0.66), (1.0, 0.33), (0.85, 0.0))
    parts = []
    for number in range(int(rng.integers(2, 6))):
        rings = [np.column_stack([share * 0.33 * np.cos(angle), share * 0.33 * np.sin(angle), np.full(13, 0.75 * z)])
                 for share, z in shape]  # fmt: skip
        bag = relief(np.stack(rings), None, Surface.PLASTIC)
        lean = rotation("x", rng.normal(0.0, 9.0)) @ rotation("z", rng.uniform(0.0, 360.0))
        parts.append(toned(bag.moved(lean), rng.uniform(0.7, 1.0)).at(0.45 * number - 0.9, rng.normal(0.0, 0.2), 0.02))
    return join(parts)


@varied
def _site_rubbish(rng: np.random.Generator) -> Mesh:
    """A muddle of small boards, boxes and lids in many colours."""
    parts = []
    for _ in range(int(rng.integers(14, 26))):
        size = rng.uniform((0.08, 0.05, 0.02), (0.6, 0.35, 0.22))
        colour = (*WOODS, *FADED, *_CARDBOARD)[int(rng.integers(len(WOODS) + len(FADED) + len(_CARDBOARD)))]
        piece = block((size[0], size[1], size[2]), colour, Surface.PLASTIC)
        tilted = piece.moved(rotation("y", rng.normal(0.0, 6.0)))
        parts.append(laid(tilted, rng.normal(0.0, 0.5, 2).clip(-1.2, 1.2), 0.0, rng.uniform(0.0, 360.0)))
    return join(parts)


DEBRIS: tuple[Prop, ...] = (
    Prop("planks", 2.4, _planks, 2.2),
    Prop("formwork girders", 2.5, _beams, 2.0),
    Prop("waste wood", 2.0, _waste_wood, 1.4),
    single("film", 1.5, 1.6, _film, _FILMS, free=True),
    single("covered stack", 1.9, 1.5, _covered_stack, _TARPAULINS),
    single("carton", 0.8, 0.9, _carton, _CARDBOARD, free=True),
    single("hose", 3.0, 1.3, _hose, _HOSES, free=True),
    single("coil", 1.6, 1.2, _coil, _HOSES, free=True),
    single("cable drum", 1.1, 0.9, _cable_drum, free=True),
    Prop("tyres", 2.0, _tyres, 0.6),
    single("scrap steel", 1.7, 1.0, _scrap_steel, free=True),
    Prop("walkway", 4.2, _walkway, 0.8),
    single("rubbish bags", 1.5, 0.9, _bin_bags, _BAGS, free=True),
    single("site rubbish", 1.6, 1.3, _site_rubbish, free=True),
)
