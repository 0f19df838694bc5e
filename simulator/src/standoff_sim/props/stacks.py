"""Deliveries in store: timber, boards, pallets, big bags, pipes, kerbs, blocks, scaffold tubes, rolls."""

from __future__ import annotations

import numpy as np

from standoff_sim.props.materials import (
    CONCRETE,
    DARK_PLASTIC,
    FILM_FACED_PLY,
    FORMWORK_RED,
    FORMWORK_YELLOW,
    GALVANISED,
    HOLE,
    STONES,
    WOODS,
    block,
    laid,
    open_ended,
    piled,
    single,
    tubular,
    varied,
)
from standoff_sim.props.prop import Prop
from standoff_sim.solids.mesh import Mesh, Surface, cylinder, join, rotation, srgb, toned

_PVC = (srgb("#b5622b"), srgb("#8b8f92"), DARK_PLASTIC, srgb("#2f6fa5"), srgb("#c6c7c3"), srgb("#5b7f4a"))
_GEOTEXTILES = (srgb("#c7c6c0"), srgb("#3a3a3c"), srgb("#8a8c88"))


@varied
def _timber(rng: np.random.Generator) -> Mesh:
    length, width, height = rng.uniform(2.5, 5.0), rng.uniform(0.1, 0.24), rng.uniform(0.05, 0.14)
    layers, across = int(rng.integers(2, 6)), int(rng.integers(3, 7))
    beam = block((length, width, height), None, Surface.WOOD)
    pitch = (1.12 * width, height + 0.03)
    stack = piled(rng, beam.at(0.0, 0.0, 0.1), layers, across, pitch, 0.07)
    bearers = [block((0.09, across * pitch[0], 0.1 + layers * pitch[1] * 0.97), None, Surface.WOOD).at(x * length, 0, 0)
               for x in (-0.32, 0.32)]  # fmt: skip
    loose = laid(beam, (rng.normal(0.0, 0.2), 0.6 * across * pitch[0] + 0.2), 0.0, rng.normal(0.0, 12.0))
    return join([stack, *(toned(bearer, 0.7) for bearer in bearers), loose])


@varied
def _sheets(rng: np.random.Generator) -> Mesh:
    """Plywood or formwork panels, each pushed on a little askew."""
    z, parts = 0.1, [block((0.1, 1.2, 0.1), WOODS[2], Surface.WOOD).at(x, 0.0, 0.0) for x in (-0.8, 0.8)]
    for _ in range(int(rng.integers(4, 14))):
        thickness = rng.uniform(0.02, 0.06)
        sheet = toned(block((2.5, 1.25, thickness), None, Surface.WOOD), rng.uniform(0.65, 1.0))
        offset = rng.normal(0.0, 0.05, 2)
        parts.append(laid(sheet, offset, z, rng.normal(0.0, 1.8)))
        z += thickness + 0.008
    return join(parts)


@varied
def _formwork_stack(rng: np.random.Generator) -> Mesh:
    """Steel-framed panels lying on each other: red or yellow rims, dark faces."""
    frame = FORMWORK_YELLOW if rng.uniform() < 0.5 else FORMWORK_RED
    length, width = rng.uniform(2.4, 3.0), rng.uniform(0.75, 1.35)
    z, parts = 0.1, [block((0.1, width, 0.1), WOODS[0], Surface.WOOD).at(x, 0.0, 0.0) for x in (-0.8, 0.8)]
    for _ in range(int(rng.integers(3, 9))):
        rim = toned(block((length, width, 0.1), frame, Surface.PAINT), rng.uniform(0.7, 1.1))
        face = toned(block((length - 0.1, width - 0.1, 0.004), FILM_FACED_PLY, Surface.WOOD), rng.uniform(0.7, 1.5))
        offset = rng.normal(0.0, 0.04, 2)
        parts.append(laid(join([rim, face.at(0.0, 0.0, 0.1)]), offset, z, rng.normal(0.0, 1.0)))
        z += 0.108
    return join(parts)


@varied
def _plastic_pipes(rng: np.random.Generator) -> Mesh:
    radius, length = rng.uniform(0.06, 0.22), rng.uniform(3.0, 6.0)
    across, layers = int(rng.integers(2, 6)), int(rng.integers(1, 4))
    pipe = open_ended(cylinder(radius, length, None, Surface.PLASTIC, axis="x", sections=8), 0).at(0.0, 0.0, radius)
    return piled(rng, pipe, layers, across, (2.05 * radius, 1.85 * radius), 0.06)


@varied
def _concrete_pipes(rng: np.random.Generator) -> Mesh:
    radius, length = rng.uniform(0.3, 0.75), rng.uniform(1.8, 2.6)
    pipe = tubular(radius, 0.8 * radius, length, CONCRETE, Surface.CONCRETE).moved(rotation("y", 90.0))
    parts = []
    for number in range(int(rng.integers(1, 5))):
        spot = (rng.normal(0.0, 0.15), (number - 1) * 2.05 * radius, radius)
        parts.append(toned(pipe, rng.uniform(0.8, 1.1)).at(*spot))
    if len(parts) >= 3 and rng.uniform() < 0.5:
        parts.append(pipe.at(0.1, -1.02 * radius, 2.75 * radius))
    return join(parts)


@varied
def _manhole_rings(rng: np.random.Generator) -> Mesh:
    radius = rng.uniform(0.5, 0.75)
    parts = []
    for number in range(int(rng.integers(1, 4))):
        ring = tubular(radius, 0.86 * radius, 0.5, CONCRETE, Surface.CONCRETE).at(0.0, 0.0, 0.25)
        for level in range(int(rng.integers(1, 4))):
            shift = rng.normal(0.0, 0.02, 2)
            parts.append(
                toned(ring, rng.uniform(0.8, 1.1)).at(shift[0] + 2.15 * radius * number, shift[1], 0.51 * level)
            )
    joined = join(parts)
    return joined.at(-float(np.ptp(joined.vertices_m[:, 0])) / 2 + radius, 0.0, 0.0)


@varied
def _kerbs(rng: np.random.Generator) -> Mesh:
    kerb = block((1.0, 0.13, 0.25), None, Surface.CONCRETE)
    return piled(rng, kerb.at(0.0, 0.0, 0.08), int(rng.integers(1, 4)), int(rng.integers(4, 8)), (0.145, 0.27), 0.02)


@varied
def _scaffold_tubes(rng: np.random.Generator) -> Mesh:
    """Tubes in a rack of four posts, or slipping off a heap."""
    length = rng.uniform(2.5, 6.0)
    tube = open_ended(cylinder(0.026, length, GALVANISED, Surface.STEEL, axis="x", sections=5), 0)
    parts = [block((0.08, 1.0, 0.12), WOODS[2], Surface.WOOD).at(x * length, 0.0, 0.0) for x in (-0.3, 0.3)]
    for _ in range(int(rng.integers(14, 30))):
        y = rng.normal(0.0, 0.22)
        lift = 0.15 + max(0.0, 0.35 - abs(y)) * rng.uniform(0.0, 1.0)
        parts.append(laid(toned(tube, rng.uniform(0.6, 1.1)), (rng.normal(0.0, 0.15), y), lift, rng.normal(0.0, 1.0)))
    return join(parts)


@varied
def _scaffold_frames(rng: np.random.Generator) -> Mesh:
    frame = join([
        *(block((2.0, 0.05, 0.05), GALVANISED, Surface.STEEL).at(0.0, y, 0.0) for y in (-0.36, 0.36)),
        *(block((0.05, 0.7, 0.05), GALVANISED, Surface.STEEL).at(x, 0.0, 0.0) for x in (-0.95, -0.2, 0.55, 0.95)),
    ])  # fmt: skip
    count = int(rng.integers(3, 9))
    return join([laid(toned(frame, rng.uniform(0.7, 1.1)), rng.normal(0.0, 0.04, 2), 0.08 + 0.06 * level,
                      rng.normal(0.0, 2.0)) for level in range(count)])  # fmt: skip


@varied
def _geotextile(rng: np.random.Generator) -> Mesh:
    radius, length = rng.uniform(0.16, 0.3), rng.uniform(2.0, 5.0)
    colour = _GEOTEXTILES[int(rng.integers(3))]
    roll = cylinder(radius, length, colour, Surface.FABRIC, axis="x", sections=12).at(0.0, 0.0, radius)
    core = cylinder(0.05, length + 0.02, HOLE, Surface.FABRIC, axis="x", sections=6).at(0.0, 0.0, radius)
    one = join([roll, core])
    parts = [laid(toned(one, rng.uniform(0.8, 1.0)), (0.0, (n - 0.5) * 2.1 * radius), 0.0, rng.normal(0.0, 2.0))
             for n in range(int(rng.integers(1, 4)))]  # fmt: skip
    return join(parts)


STACKS: tuple[Prop, ...] = (
    single("timber stack", 2.8, 2.0, _timber, WOODS),
    single("plywood stack", 1.6, 1.5, _sheets, WOODS),
    single("formwork stack", 1.8, 1.5, _formwork_stack),
    single("plastic pipes", 3.2, 1.8, _plastic_pipes, _PVC),
    single("concrete pipes", 2.6, 1.2, _concrete_pipes),
    single("manhole rings", 2.4, 0.9, _manhole_rings),
    single("kerbs", 0.9, 0.9, _kerbs, STONES),
    single("scaffold tubes", 3.2, 1.4, _scaffold_tubes),
    single("scaffold frames", 1.3, 0.8, _scaffold_frames),
    single("geotextile rolls", 2.8, 0.7, _geotextile),
)
