"""Reinforcement: starter bars out of concrete, mats, bundles and cages."""

from __future__ import annotations

import numpy as np

from standoff_sim.props.materials import RUSTY_STEEL, WOODS, bar, block, scattered, single, tints, varied
from standoff_sim.props.prop import Prop
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.mesh import Mesh, Surface, join, rotation, srgb, toned, translation

_CAPS = (srgb("#d5691c"), srgb("#c93a22"), srgb("#d7b423"))


def starters(
    rng: np.random.Generator, size_m: tuple[float, float], z_m: float, length_m: float, pitch_m: float
) -> list[Mesh]:
    """Return bars standing along the outline of a rectangle, slightly bent, some with a coloured cap."""
    half = np.array(size_m) / 2
    counts = np.maximum(np.round(2 * half / pitch_m).astype(int), 1)
    xs, ys = np.linspace(-half[0], half[0], counts[0] + 1), np.linspace(-half[1], half[1], counts[1] + 1)
    feet = {(x, y) for x in xs for y in (ys[0], ys[-1])} | {(x, y) for x in (xs[0], xs[-1]) for y in ys}
    capped = rng.uniform() < 0.4
    cap = _CAPS[int(rng.integers(len(_CAPS)))]
    bars = []
    for x, y in sorted(feet):
        lean = rng.normal(0.0, 0.03, 2) * length_m
        top = (x + lean[0], y + lean[1], z_m + length_m * rng.uniform(0.85, 1.05))
        bars.append(toned(bar((x, y, z_m), top, 0.016, RUSTY_STEEL, Surface.RUST, sections=4, capped=False),
                          rng.uniform(0.7, 1.2)))  # fmt: skip
        if capped:
            bars.append(block((0.09, 0.09, 0.07), cap, Surface.PLASTIC).at(*top))
    return bars


def steel_lattice(size_m: tuple[float, float], pitch_m: float, radius_m: float, rng: np.random.Generator) -> Mesh:
    """Return a mat of crossing bars lying on z = 0, no two quite parallel or equally rusty."""
    length, width = size_m
    bars = []
    for y in np.arange(-width / 2 + 0.05, width / 2, pitch_m):
        bars.append(bar((-length / 2, y, 0.02), (length / 2, y + rng.normal(0.0, 0.01), 0.02), radius_m,
                        RUSTY_STEEL, Surface.RUST, sections=3, capped=False))  # fmt: skip
    for x in np.arange(-length / 2 + 0.05, length / 2, pitch_m):
        bars.append(bar((x, -width / 2, 0.035), (x + rng.normal(0.0, 0.01), width / 2, 0.035), radius_m,
                        RUSTY_STEEL, Surface.RUST, sections=3, capped=False))  # fmt: skip
    return join([toned(one, rng.uniform(0.7, 1.2)) for one in bars])


@varied
def _mat(rng: np.random.Generator) -> Mesh:
    return steel_lattice((rng.uniform(2.5, 5.0), rng.uniform(1.8, 2.3)), rng.uniform(0.15, 0.25), 0.011, rng)


def _mats(rng: np.random.Generator) -> tuple[Batch, ...]:
    """A stack of mats that slid, on two timbers."""
    count = int(rng.integers(1, 9))
    poses = scattered(rng, rng.normal(0.0, 0.05, (count, 2)), np.linspace(0.1, 0.1 + 0.028 * (count - 1), count), 1.0)
    turn = np.deg2rad(rng.normal(0.0, 1.5, count))
    poses[:, 0, 0] = poses[:, 1, 1] = np.cos(turn)
    poses[:, 1, 0], poses[:, 0, 1] = np.sin(turn), -np.sin(turn)
    feet = np.stack([translation(x, 0.0, 0.0) for x in (-0.9, 0.9)])
    return (
        place(_mat(int(rng.integers(4))), poses, dust=0.3),
        place(_timber_bearer(0), feet, tint=tints(rng, WOODS, 2)),
    )


@varied
def _timber_bearer(_: np.random.Generator) -> Mesh:
    return block((0.1, 2.2, 0.1), None, Surface.WOOD)


@varied
def _rebar_bundle(rng: np.random.Generator) -> Mesh:
    length = rng.uniform(3.5, 7.0)
    parts = [block((0.1, 0.9, 0.1), WOODS[2], Surface.WOOD).at(x * length, 0.0, 0.0) for x in (-0.3, 0.3)]
    for _ in range(int(rng.integers(16, 40))):
        y, z = rng.normal(0.0, 0.16), 0.12 + abs(rng.normal(0.0, 0.06))
        shift, skew = rng.normal(0.0, 0.12), rng.normal(0.0, 0.05)
        steel = bar((shift - length / 2, y, z), (shift + length / 2, y + skew, z), 0.016, RUSTY_STEEL, Surface.RUST,
                    sections=3, capped=False)  # fmt: skip
        parts.append(toned(steel, rng.uniform(0.65, 1.25)))
    return join(parts)


@varied
def _cage(rng: np.random.Generator) -> Mesh:
    length, side = rng.uniform(3.0, 6.0), rng.uniform(0.35, 0.6)
    corners = [(y * side / 2, z * side / 2) for y, z in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    middles = [(0.0, -side / 2), (side / 2, 0.0), (0.0, side / 2), (-side / 2, 0.0)]
    lift = side / 2 + 0.08
    parts = [
        toned(bar((-length / 2, y, z + lift), (length / 2, y, z + lift), 0.014, RUSTY_STEEL, Surface.RUST, sections=3,
                  capped=False), rng.uniform(0.7, 1.2))
        for y, z in corners + middles
    ]  # fmt: skip
    for x in np.arange(-length / 2 + 0.1, length / 2, 0.24):
        for (y0, z0), (y1, z1) in zip(corners, corners[1:] + corners[:1], strict=True):
            parts.append(bar((x, y0, z0 + lift), (x, y1, z1 + lift), 0.008, RUSTY_STEEL, Surface.RUST, sections=3,
                             capped=False))  # fmt: skip
    return join(parts)


@varied
def _standing_cage(rng: np.random.Generator) -> Mesh:
    cage = _cage(int(rng.integers(100)))
    top = float(cage.vertices_m[:, 0].max())
    upright = cage.at(0.0, 0.0, -float(cage.vertices_m[:, 2].mean())).moved(rotation("y", -90.0))
    low = upright.at(0.0, 0.0, 0.45 * top)
    return low.at(0.0, 0.0, -float(low.vertices_m[:, 2].min()))


REBAR: tuple[Prop, ...] = (
    Prop("rebar mats", 2.9, _mats, 1.6),
    single("rebar bundle", 3.7, 1.5, _rebar_bundle, stretch=0.05),
    single("lying cage", 3.2, 1.0, _cage, stretch=0.05),
    single("standing cage", 0.6, 0.7, _standing_cage, stretch=0.05),
)
