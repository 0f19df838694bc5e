"""What comes on pallets and in bags: blocks, cement, paving, wrapped goods, big bags, and the empty pallets."""

from __future__ import annotations

import numpy as np

from standoff_sim.props.materials import (
    FADED,
    SANDS,
    STONES,
    WHITE_PLASTIC,
    WOODS,
    block,
    laid,
    mound,
    piled,
    relief,
    ripples,
    tints,
    varied,
)
from standoff_sim.props.prop import Prop
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.mesh import Colour, Mesh, Surface, join, rotation, srgb, toned, translation

_BRICKS = (srgb("#9a5638"), srgb("#8a8880"), srgb("#b3ada0"), srgb("#a9795a"))


_SACKS = (srgb("#b9b2a2"), srgb("#8f8f8b"), srgb("#b59a6a"), srgb("#c9c6bd"))


@varied
def pallet(rng: np.random.Generator) -> Mesh:
    """Return a 1.2 m x 0.8 m pallet of boards."""
    parts = [block((1.2, 0.1, 0.1), None, Surface.WOOD).at(0.0, y, 0.0) for y in (-0.35, 0.0, 0.35)]
    for x in np.linspace(-0.55, 0.55, 7):
        parts.append(block((0.1, 0.8, 0.022), None, Surface.WOOD).at(float(x), 0.0, 0.1))
    return join([toned(part, rng.uniform(0.65, 1.0)) for part in parts])


def _pallets(rng: np.random.Generator) -> tuple[Batch, ...]:
    count = int(rng.integers(1, 11))
    poses = np.stack([
        translation(rng.normal(0.0, 0.03), rng.normal(0.0, 0.03), 0.125 * level) @ rotation("z", rng.normal(0.0, 3.0))
        for level in range(count)
    ])  # fmt: skip
    if rng.uniform() < 0.4:
        leaning = translation(0.0, 0.62, 0.0) @ rotation("x", rng.uniform(55.0, 75.0)) @ translation(0.0, 0.42, 0.0)
        poses = np.concatenate([poses, leaning[None]])
    return (place(pallet(int(rng.integers(4))), poses, tint=tints(rng, WOODS, len(poses)), dust=0.3),)


def _on_pallet(mesh: Mesh, rng: np.random.Generator, tint: tuple[Colour, ...]) -> tuple[Batch, ...]:
    return (
        place(pallet(int(rng.integers(4))), np.eye(4), tint=tints(rng, WOODS, 1), dust=0.4),
        place(mesh, translation(0.0, 0.0, 0.125) @ rotation("z", rng.normal(0.0, 2.0)), tint=tints(rng, tint, 1),
              dust=float(rng.uniform(0.1, 0.5))),
    )  # fmt: skip


@varied
def _bricks(rng: np.random.Generator) -> Mesh:
    """Blocks in courses; the upper ones partly taken."""
    across, courses = int(rng.integers(3, 5)), int(rng.integers(2, 6))
    size = (1.08 / across, 0.19, 0.2)
    parts = []
    for course in range(courses):
        for x in range(across):
            for y in range(4):
                if course == courses - 1 and rng.uniform() < 0.35:
                    continue
                brick = block((size[0] - 0.012, size[1] - 0.008, size[2] - 0.012), None, Surface.CONCRETE)
                dx, dy = rng.normal(0.0, 0.006, 2)
                spot = ((x - (across - 1) / 2) * size[0] + dx, (y - 1.5) * size[1] + dy, course * size[2])
                parts.append(toned(brick, rng.uniform(0.72, 1.0)).at(*spot))
    return join(parts)


@varied
def _wrapped(rng: np.random.Generator) -> Mesh:
    """Goods under stretch film: a box with slack, bright creases and a darker foot."""
    return _pillow(rng, (1.15, 0.78, rng.uniform(0.6, 1.5)), 12.0, 0.02, None, Surface.PLASTIC)


def _pillow(
    rng: np.random.Generator, size_m: tuple[float, float, float], square: float, slack: float, colour: Colour | None,
    surface: Surface,
) -> Mesh:  # fmt: skip
    """Return a filled bag or wrapped load: a rounded box (`square` 2 is round, 12 is boxy), lumpy by `slack`."""
    angle = np.linspace(0.0, 2 * np.pi, 21)
    cosine, sine = np.cos(angle), np.sin(angle)
    reach = (np.abs(cosine) ** square + np.abs(sine) ** square) ** (-1.0 / square)
    shares = np.array([0.0, 0.55, 0.93, 1.0, 1.02, 1.0, 0.92])[:, None]
    level = np.array([1.0, 1.0, 0.97, 0.8, 0.4, 0.1, 0.0])[:, None]
    x, y = shares * reach * cosine * size_m[0] / 2, shares * reach * sine * size_m[1] / 2
    z = np.broadcast_to(level * size_m[2], x.shape)
    points = np.stack([x, y, z], axis=-1)
    noise = ripples(rng, points[..., :2] + points[..., 2:] * 0.7, 0.8, 3)
    noise[:, -1] = noise[:, 0]
    noise[0] = noise[0].mean()
    points[..., :2] *= 1.0 + slack * noise[..., None]
    points[..., 2] *= 1.0 + 1.5 * slack * noise
    return relief(points, colour, surface, mottling=0.07)


@varied
def _big_bag(rng: np.random.Generator) -> Mesh:
    """A big bag: bulging, sagging at the top, four loops; some open with sand in them."""
    height = rng.uniform(0.45, 1.05)
    parts = [_pillow(rng, (0.95, 0.95, height), 3.6, 0.06, WHITE_PLASTIC, Surface.FABRIC)]
    if rng.uniform() < 0.45:
        fill = SANDS[int(rng.integers(len(SANDS)))]
        parts.append(mound(rng, 0.5, 0.12, fill, rings=5, sectors=12).at(0.0, 0.0, height))
    for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        loop = block((0.07, 0.03, 0.25), srgb("#3f5f93") if rng.uniform() < 0.3 else WHITE_PLASTIC, Surface.FABRIC)
        parts.append(loop.moved(rotation("x", y * rng.uniform(-30, 80))).at(0.36 * x, 0.36 * y, 0.93 * height))
    return join(parts)


def _big_bags(rng: np.random.Generator) -> tuple[Batch, ...]:
    count = int(rng.integers(1, 6))
    batches: list[Batch] = []
    for number in range(count):
        x, y = (number % 3 - 1) * 1.05, (number // 3) * 1.05 - 0.3
        pose = translation(x + rng.normal(0, 0.06), y + rng.normal(0, 0.06), 0.0) @ rotation("z", rng.normal(0, 12))
        batches.append(place(_big_bag(int(rng.integers(6))), pose, dust=float(rng.uniform(0.0, 0.6))))
    return tuple(batches)


@varied
def _sacks(rng: np.random.Generator) -> Mesh:
    """Cement bags in crossed layers."""
    sack = _sack()
    parts = []
    layers = int(rng.integers(2, 7))
    for layer in range(layers):
        for number in range(5 if layer < layers - 1 else int(rng.integers(1, 6))):
            x, y = ((-0.3, -0.2), (0.3, -0.2), (-0.38, 0.2), (0.0, 0.2), (0.38, 0.2))[number]
            turn = 0.0 if number < 2 else 90.0
            parts.append(toned(laid(sack, (x, y), 0.12 * layer, turn + rng.normal(0, 4)), rng.uniform(0.75, 1.0)))
    return join(parts)


def _sack() -> Mesh:
    angle = np.linspace(0.0, 2 * np.pi, 9)
    ring = np.stack([0.3 * np.cos(angle), 0.19 * np.sin(angle)], axis=-1)
    levels = ((0.0, 0.135), (0.75, 0.12), (1.0, 0.06), (0.85, 0.0))
    return relief(np.stack([np.column_stack([share * ring, np.full(9, z)]) for share, z in levels]), None,
                  Surface.FABRIC)  # fmt: skip


@varied
def _paving(rng: np.random.Generator) -> Mesh:
    slab = block((0.5, 0.5, 0.06), None, Surface.CONCRETE)
    stacks = [piled(rng, slab, int(rng.integers(2, 9)), 1, (0.5, 0.065), 0.012).at(x, y, 0.0)
              for x in (-0.55, 0.0, 0.55) for y in (-0.27, 0.27)]  # fmt: skip
    return join(stacks)


def _goods(rng: np.random.Generator) -> tuple[Batch, ...]:
    """A loaded pallet of one kind or another."""
    kind, variant = int(rng.integers(4)), int(rng.integers(6))
    if kind == 0:
        return _on_pallet(_bricks(variant), rng, _BRICKS)
    if kind == 1:
        return _on_pallet(_sacks(variant), rng, _SACKS)
    if kind == 2:
        return _on_pallet(_paving(variant), rng, STONES)
    return _on_pallet(_wrapped(variant), rng, (WHITE_PLASTIC, WHITE_PLASTIC, *FADED))


LOADS: tuple[Prop, ...] = (
    Prop("pallets", 1.0, _pallets, 2.0),
    Prop("goods on a pallet", 0.9, _goods, 3.0),
    Prop("big bags", 1.9, _big_bags, 2.2),
)
