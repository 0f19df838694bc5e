"""What comes to lie on the reference object: sand over a corner or an edge, a plate, a tarpaulin."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from standoff.core.errors import ConfigError
from standoff.core.homography import FloatArray
from standoff_sim.props.materials import BARE_STEEL, SANDS, SOILS, WOODS, block, mound, relief, ripples, tints
from standoff_sim.scene.scene import Cover, GroundSurface, Reference, place
from standoff_sim.solids.mesh import Mesh, Surface, join, rotation, srgb, toned, translation

_TARPAULINS = tuple(srgb(code) for code in ("#2f5f8f", "#4d6b4a", "#8a8c8a", "#3b3c3e"))
_STEEPNESS = 0.6
"""Height over run of sand that has come to rest: 31 degrees."""
_SIDE_LOADS = 6
"""Heaps from corner to corner, so close that they merge into one bank."""


@dataclass(frozen=True, slots=True)
class _Bed:
    """The reference object as a cover sees it.

    Attributes:
        corners_m: (4, 2) of the top, site frame, counter-clockwise.
        height_m: Of the top above the ground.
    """

    corners_m: FloatArray
    height_m: float

    def outside_m(self, xy_m: FloatArray) -> FloatArray:
        """Return how far (..., 2) points lie beyond the nearest edge's line; negative inside."""
        edges = np.roll(self.corners_m, -1, axis=0) - self.corners_m
        outwards = np.stack([edges[:, 1], -edges[:, 0]], axis=-1) / np.linalg.norm(edges, axis=1, keepdims=True)
        return np.asarray(np.max(((xy_m[..., None, :] - self.corners_m) * outwards).sum(axis=-1), axis=-1))

    def middle_of_edge(self, number: int) -> FloatArray:
        """Return (2,) the middle of an edge."""
        return np.asarray((self.corners_m[number] + self.corners_m[(number + 1) % 4]) / 2)


def make_cover(
    rng: np.random.Generator, kind: str, reference: Reference, ground: GroundSurface, start_s: float, stop_s: float
) -> Cover:
    """Lay something on a reference object.

    Args:
        rng: Chooses the corner or edge, sizes and colours.
        kind: One of `COVER_KINDS`.
        reference: What it lies on.
        ground: Around it.
        start_s: When it appears.
        stop_s: When it is gone.

    Raises:
        ConfigError: Unknown kind.
    """
    if kind not in _MAKERS:
        raise ConfigError(expected=f"one of {', '.join(_MAKERS)}", found=repr(kind), fix="choose one of these covers")
    low_m = float(ground.height_at(reference.base_m[:, :2]).mean())
    bed = _Bed(reference.top_m[:, :2], float(reference.top_m[:, 2].mean()) - low_m)
    spot_m, mesh, colours = _MAKERS[kind](rng, bed)
    batch = place(mesh, translation(spot_m[0], spot_m[1], low_m), tint=tints(rng, colours, 1), dust=0.1)
    return Cover(batch, start_s, stop_s)


Laid = tuple[FloatArray, Mesh, tuple[tuple[float, float, float], ...]]
"""(2,) where it lies in the site frame, its look around that point with z = 0 on the ground, colours to choose from."""


def _heap_on(rng: np.random.Generator, bed: _Bed, spot_m: FloatArray) -> Laid:
    """Sand tipped on a spot, so high that the spot is well under it."""
    above_m = rng.uniform(0.3, 0.5)
    height_m = bed.height_m + above_m
    mesh = mound(rng, height_m / _STEEPNESS + 0.15, height_m, None, lumps=0.04, rings=14, sectors=30)
    near = np.linalg.norm(mesh.vertices_m[:, :2], axis=1) < 0.5 * above_m / _STEEPNESS
    lift = max(1.0, (bed.height_m + 0.08) / float(mesh.vertices_m[near, 2].min()))
    return spot_m, mesh.moved(np.diag([1.0, 1.0, lift, 1.0])), SANDS + SOILS[:2]


def _make_sand_corner(rng: np.random.Generator, bed: _Bed) -> Laid:
    return _heap_on(rng, bed, bed.corners_m[int(rng.integers(4))])


def _make_sand_edge(rng: np.random.Generator, bed: _Bed) -> Laid:
    return _heap_on(rng, bed, bed.middle_of_edge(int(rng.integers(4))))


def _disc(radius_m: float, rings: int = 16, sectors: int = 40) -> FloatArray:
    """Return (rings, sectors + 1, 2) points from the middle outwards, closed."""
    angle = np.linspace(0.0, 2 * np.pi, sectors + 1)
    share = np.linspace(0.0, 1.0, rings)[:, None]
    return np.asarray(radius_m * np.stack([share * np.cos(angle), share * np.sin(angle)], axis=-1))


def _make_sand_blanket(rng: np.random.Generator, bed: _Bed) -> Laid:
    """A few centimetres of sand over an edge, ragged inwards, sloping to the ground outwards."""
    spot_m = bed.middle_of_edge(int(rng.integers(4)))
    xy = _disc(rng.uniform(0.8, 1.2))
    reach = np.linalg.norm(xy, axis=-1) / np.linalg.norm(xy[-1, 0])
    ragged = ripples(rng, xy, 0.7, 4)
    fade = np.clip((1.0 - reach) / 0.35 + 0.3 * ragged * reach, 0.0, 1.0) * (reach < 0.99)
    outside_m = bed.outside_m(xy + spot_m)
    crest_m = bed.height_m + rng.uniform(0.06, 0.1)
    slope = np.clip(1.0 - np.maximum(outside_m - 0.1, 0.0) * _STEEPNESS / crest_m, 0.0, 1.0)
    z = crest_m * fade * slope * (1.0 + 0.02 * ragged) - 0.02
    return spot_m, relief(np.concatenate([xy, z[..., None]], axis=-1), None, Surface.SOIL), SANDS + SOILS[:2]


def _make_tarpaulin(rng: np.random.Generator, bed: _Bed) -> Laid:
    """A sheet thrown over a corner: flat on the top, hanging down beyond it, wrinkled."""
    corner_m = bed.corners_m[int(rng.integers(4))]
    spot_m = corner_m + 0.35 * (bed.corners_m.mean(axis=0) - corner_m)
    half_m = rng.uniform(1.2, 1.7, 2)
    turn = rotation("z", rng.uniform(0.0, 360.0))[:2, :2]
    axis = np.linspace(-1.0, 1.0, 25)
    xy = np.stack(np.meshgrid(axis * half_m[0], axis * half_m[1], indexing="ij"), axis=-1) @ turn.T
    drop_m = 2.5 * np.maximum(bed.outside_m(xy + spot_m) - 0.15, 0.0)
    wrinkles_m = 0.02 * np.maximum(ripples(rng, xy, 0.8, 3) + 0.5, 0.0)
    z = np.maximum(bed.height_m + 0.015 - drop_m, 0.015) + wrinkles_m
    return spot_m, relief(np.concatenate([xy, z[..., None]], axis=-1), None, Surface.PLASTIC), _TARPAULINS


def _make_plate(rng: np.random.Generator, bed: _Bed) -> Laid:
    """A board or steel plate across a corner, its weight on the object."""
    corner_m = bed.corners_m[int(rng.integers(4))]
    inwards = bed.corners_m.mean(axis=0) - corner_m
    spot_m = corner_m + inwards / np.linalg.norm(inwards) * rng.uniform(0.25, 0.4)
    steel = rng.uniform() < 0.4
    size_m = (float(rng.uniform(1.6, 2.5)), float(rng.uniform(1.1, 1.3)), 0.02 if steel else 0.03)
    surface = Surface.STEEL if steel else Surface.WOOD
    plate = toned(block(size_m, None, surface), rng.uniform(0.8, 1.0)).at(0.0, 0.0, bed.height_m + 0.004)
    return spot_m, plate.moved(rotation("z", rng.uniform(0.0, 360.0))), (BARE_STEEL,) if steel else WOODS


def _make_sand_side(rng: np.random.Generator, bed: _Bed) -> Laid:
    """Sand tipped all along one side, load by load: the edge and both its corners are under it."""
    number = int(rng.integers(4))
    start_m, stop_m = bed.corners_m[number], bed.corners_m[(number + 1) % 4]
    loads = [_heap_on(rng, bed, start_m + share * (stop_m - start_m)) for share in np.linspace(0.0, 1.0, _SIDE_LOADS)]
    middle_m = bed.middle_of_edge(number)
    heaps = [heap.at(float(spot_m[0] - middle_m[0]), float(spot_m[1] - middle_m[1]), 0.0) for spot_m, heap, _ in loads]
    return middle_m, join(heaps), loads[0][2]


_MAKERS: Mapping[str, Callable[[np.random.Generator, _Bed], Laid]] = MappingProxyType({
    "sand_corner": _make_sand_corner,
    "sand_edge": _make_sand_edge,
    "sand_side": _make_sand_side,
    "sand_blanket": _make_sand_blanket,
    "plate": _make_plate,
    "tarpaulin": _make_tarpaulin,
})  # fmt: skip

COVER_KINDS = tuple(_MAKERS)
