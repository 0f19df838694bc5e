"""What clutter is made of: the colours of site materials, and the few solids that all clutter is built from.

Unit solids are made once and stretched: a stack of fifty planks costs two milliseconds, not a hundred.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import trimesh

from standoff.core.homography import FloatArray
from standoff_sim.props.prop import Prop
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.mesh import (
    Colour,
    Mesh,
    Surface,
    box,
    cylinder,
    grid_faces,
    join,
    rotation,
    scaling,
    srgb,
    toned,
    translation,
)

CONCRETE = srgb("#a09c93")
FRESH_CONCRETE = srgb("#7f7e78")
RUSTY_STEEL = srgb("#7a4f38")
BARE_STEEL = srgb("#8b8c8c")
GALVANISED = srgb("#a4a8aa")
FORMWORK_RED = srgb("#a3341f")
FORMWORK_YELLOW = srgb("#cf9a22")
FILM_FACED_PLY = srgb("#5a3b28")
DARK_PLASTIC = srgb("#2b2b2d")
WHITE_PLASTIC = srgb("#cfd0cc")
HOLE = srgb("#25221f")

WOODS = tuple(srgb(code) for code in ("#c2a172", "#a98a62", "#8d7a62", "#b79a78", "#857a6c", "#cbb28a"))
SOILS = tuple(srgb(code) for code in ("#8d7658", "#a58c66", "#6e5b45", "#9a8b74", "#7d5b41", "#b29f7c"))
SANDS = tuple(srgb(code) for code in ("#c0a878", "#b39a70", "#ccb890", "#a8936e"))
STONES = tuple(srgb(code) for code in ("#8d8a83", "#a19c90", "#75726c", "#9b8f7d", "#b0aca2"))
FADED = tuple(
    srgb(code)
    for code in ("#b83c26", "#d98b1e", "#e0b93a", "#2f5f9a", "#3d7f8f", "#4f8a4a", "#c9c8c2", "#8f8f8c", "#39393b")
)
"""Paints, plastics and cloths as the sun and dust leave them."""

VARIANTS = 6
"""Shapes of each family; pose, stretch, tint and dust make the rest of the variety."""


@cache
def _unit_box(colour: Colour | None, surface: Surface) -> Mesh:
    return box((1.0, 1.0, 1.0), colour, surface)


@cache
def _unit_bar(colour: Colour | None, surface: Surface, sections: int, capped: bool) -> Mesh:
    bar = cylinder(1.0, 1.0, colour, surface, sections=sections).at(0.0, 0.0, 0.5)
    if capped:
        return bar
    sides = np.abs(bar.normals[bar.triangles[:, 0], 2]) < 0.5
    return replace(bar, triangles=np.ascontiguousarray(bar.triangles[sides]))


def block(size_m: tuple[float, float, float], colour: Colour | None, surface: Surface) -> Mesh:
    """Return a box standing on z = 0, centred in x and y, as `mesh.box` does, in a hundredth of its time."""
    return _unit_box(colour, surface).moved(scaling(*size_m))


def bar(
    start_m: Sequence[float] | FloatArray, stop_m: Sequence[float] | FloatArray, radius_m: float, colour: Colour | None,
    surface: Surface = Surface.STEEL, *, sections: int = 6, capped: bool = True,
) -> Mesh:  # fmt: skip
    """Return a straight round bar between two points."""
    start = np.asarray(start_m, dtype=np.float64)
    along = np.asarray(stop_m, dtype=np.float64) - start
    length_m = float(np.linalg.norm(along))
    pose = trimesh.geometry.align_vectors([0.0, 0.0, 1.0], along / length_m) @ scaling(radius_m, radius_m, length_m)
    pose[:3, 3] = start
    return _unit_bar(colour, surface, sections, capped).moved(pose)


def open_ended(mesh: Mesh, axis: int) -> Mesh:
    """Return a closed tube along an axis (0, 1, 2) whose ends look like openings: nearly black."""
    end = np.abs(mesh.normals[:, axis]) > 0.9
    return toned(mesh, np.where(end, 0.12, 1.0))


def relief(points_m: FloatArray, colour: Colour | None, surface: Surface, mottling: float = 0.12) -> Mesh:
    """Return the skin through an (N, M, 3) grid of points, seen from the side where N x M turns counter-clockwise.

    Args:
        points_m: The grid. Equal first and last columns close it to a ring.
        colour: None for the tint alone.
        surface: Material.
        mottling: Standard deviation of the colour from point to point.
    """
    rows, columns = points_m.shape[:2]
    solid = trimesh.Trimesh(points_m.reshape(-1, 3), grid_faces(rows, columns), process=True)
    solid.update_faces(solid.nondegenerate_faces())
    solid.remove_unreferenced_vertices()
    mesh = Mesh.of(solid, colour, surface, crease_deg=75.0)
    blotches = ripples(np.random.default_rng(rows * 1000 + columns), mesh.vertices_m[:, :2].astype(np.float64), 1.1, 4)
    return toned(mesh, np.clip(0.9 + mottling * blotches, 0.6, 1.0))


def ripples(rng: np.random.Generator, xy_m: FloatArray, longest_m: float, octaves: int) -> FloatArray:
    """Return smooth noise of about unit size at (..., 2) points: waves in random directions, shorter ones smaller."""
    total = np.zeros(xy_m.shape[:-1])
    for octave in range(octaves):
        for _ in range(3):
            turn, phase = rng.uniform(0.0, 2 * np.pi, 2)
            rate = 2 * np.pi * 1.9**octave * rng.uniform(0.7, 1.3) / longest_m
            total += np.sin(rate * (np.cos(turn) * xy_m[..., 0] + np.sin(turn) * xy_m[..., 1]) + phase) / 1.7**octave
    return np.asarray(total / 2.4)


def mound(
    rng: np.random.Generator, radius_m: float, height_m: float, colour: Colour | None,
    surface: Surface = Surface.SOIL, *, lumps: float = 0.12, rings: int = 12, sectors: int = 26,
) -> Mesh:  # fmt: skip
    """Return a heap as shovels and tippers leave it: lobed outline, flanks of one slope, lumpy, a skirt below z = 0."""
    angle = np.linspace(0.0, 2 * np.pi, sectors + 1)
    share = np.concatenate([np.linspace(0.0, 1.0, rings) ** 0.9, [1.12]])[:, None]
    lobes = 1.0 + 0.13 * np.sin(2 * angle + rng.uniform(0, 6)) + 0.09 * np.sin(3 * angle + rng.uniform(0, 6))
    reach = radius_m * (lobes + 0.05 * np.sin(7 * angle + rng.uniform(0, 6))) / 1.27
    xy = np.stack([share * reach * np.cos(angle), share * reach * np.sin(angle)], axis=-1)
    off_top = rng.uniform(-0.12, 0.12, 2) * radius_m
    xy = xy + off_top * (1.0 - np.minimum(share, 1.0))[..., None]
    flank = np.minimum(1.0 - np.minimum(share, 1.0), 0.93) ** rng.uniform(0.9, 1.2)
    noise = ripples(rng, xy, 0.9 * radius_m + 0.2, 4)
    z = height_m * flank * (1.0 + 1.6 * lumps * noise) + 0.5 * height_m * lumps * noise * np.sqrt(flank)
    z = np.where(share >= 1.0, -0.02 - 0.9 * (share - 1.0) * height_m - 0.05 * (share > 1.0), np.maximum(z, 0.0))
    z[0] = z[0].mean()
    return relief(np.concatenate([xy, z[..., None]], axis=-1), colour, surface)


def stone(rng: np.random.Generator, points: int = 11) -> Mesh:
    """Return an angular stone of about unit diameter around the origin; the tint gives the colour."""
    directions = rng.normal(size=(points, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    corners = directions * rng.uniform(0.4, 0.55, (points, 1)) * (1.0, rng.uniform(0.6, 1.0), rng.uniform(0.45, 0.8))
    mesh = Mesh.of(trimesh.convex.convex_hull(corners), None, Surface.CONCRETE, crease_deg=20.0)
    return toned(mesh, rng.uniform(0.8, 1.0, len(mesh.vertices_m)))


def scattered(
    rng: np.random.Generator, xy_m: FloatArray, z_m: FloatArray | float, size_m: FloatArray | float
) -> FloatArray:
    """Return (N, 4, 4) poses at (N, 2) points, turned about z at random and scaled by (N,) or one size."""
    count = len(xy_m)
    turn = rng.uniform(0.0, 2 * np.pi, count)
    poses = np.zeros((count, 4, 4))
    poses[:, 0, 0] = poses[:, 1, 1] = np.cos(turn) * size_m
    poses[:, 1, 0] = np.sin(turn) * size_m
    poses[:, 0, 1] = -poses[:, 1, 0]
    poses[:, 2, 2] = size_m
    poses[:, :2, 3] = xy_m
    poses[:, 2, 3] = z_m
    poses[:, 3, 3] = 1.0
    return poses


def tints(rng: np.random.Generator, palette: Sequence[Colour], count: int, spread: float = 0.15) -> FloatArray:
    """Return (N, 3) colours near those of a palette, each a little lighter or darker, none above 0.85."""
    chosen = np.asarray(palette)[rng.integers(len(palette), size=count)]
    return np.clip(chosen * rng.uniform(1.0 - spread, 1.0 + spread, (count, 1)), 0.01, 0.85)


def aged(
    rng: np.random.Generator, palette: Sequence[Colour], shares: tuple[float, float], count: int = 1
) -> FloatArray:
    """Return (count, 3) tones of one colour of a palette, each multiplied by a share within a range.

    Args:
        rng: Decides.
        palette: Clean colours.
        shares: Least and largest factor.
        count: How many tones.
    """
    return np.array(palette[int(rng.integers(len(palette)))]) * rng.uniform(*shares, (count, 1))


@dataclass(frozen=True, slots=True)
class Shape:
    """Makes a prop of one mesh: a random variant, turned, stretched, tinted and dusted.

    Attributes:
        build: Returns the mesh of a variant number, always the same one.
        palette: Of the tint; empty when the mesh has its own colours.
        variants: How many there are.
        stretch: Largest change of each axis.
        free: Whether it lies in any direction; else along x within a few degrees.
    """

    build: Callable[[int], Mesh]
    palette: tuple[Colour, ...] = ()
    variants: int = VARIANTS
    stretch: float = 0.08
    free: bool = False

    def __call__(self, rng: np.random.Generator) -> tuple[Batch, ...]:
        """Build one around the local origin."""
        mesh = self.build(int(rng.integers(self.variants)))
        grown = rng.uniform(1.0 - self.stretch, 1.0 + self.stretch, 3)
        turn_deg = rng.uniform(0.0, 360.0) if self.free else rng.normal(0.0, 2.0)
        pose = rotation("z", turn_deg) @ scaling(*grown)
        tint = tints(rng, self.palette or ((1.0, 1.0, 1.0),), 1)
        return (place(mesh, pose, tint=tint, dust=float(rng.uniform(0.1, 0.7))),)


def single(
    name: str, radius_m: float, weight: float, build: Callable[[int], Mesh], palette: tuple[Colour, ...] = (), *,
    stretch: float = 0.08, free: bool = False, variants: int = VARIANTS,
) -> Prop:  # fmt: skip
    """Return the family of a thing that is one mesh."""
    return Prop(name, radius_m, Shape(build, palette, variants, stretch, free), weight)


def varied(build: Callable[[np.random.Generator], Mesh]) -> Callable[[int], Mesh]:
    """Turn a builder of random meshes into one of numbered variants, each built once and kept."""

    @cache
    def variant(number: int) -> Mesh:
        return build(np.random.default_rng((number, zlib.crc32(build.__name__.encode()))))

    return variant


def piled(
    rng: np.random.Generator, part: Mesh, layers: int, across: int, pitch_m: tuple[float, float], jitter_m: float
) -> Mesh:
    """Return copies of a long part (along x) side by side along y in layers, each a little off and of its own tone."""
    copies = []
    for layer in range(layers):
        for column in range(across):
            y_m = (column - (across - 1) / 2) * pitch_m[0]
            x_m, dy_m = rng.normal(0.0, jitter_m, 2) * (1.0, 0.15)
            copies.append(toned(part.at(x_m, y_m + dy_m, layer * pitch_m[1]), rng.uniform(0.72, 1.0)))
    return join(copies)


def laid(mesh: Mesh, xy_m: FloatArray | tuple[float, float], z_m: float, turn_deg: float) -> Mesh:
    """Return the mesh turned about z and moved."""
    return mesh.moved(translation(xy_m[0], xy_m[1], z_m) @ rotation("z", turn_deg))


def tubular(radius_m: float, hole_radius_m: float, length_m: float, colour: Colour | None, surface: Surface) -> Mesh:
    """Return a thick pipe along z, centred at the origin, dark inside."""
    solid = trimesh.creation.annulus(hole_radius_m, radius_m, length_m, sections=14)
    mesh = Mesh.of(solid, colour, surface)
    inwards = (mesh.vertices_m[:, :2] * mesh.normals[:, :2]).sum(axis=1) < -0.1 * hole_radius_m
    return toned(mesh, np.where(inwards, 0.3, 1.0))
