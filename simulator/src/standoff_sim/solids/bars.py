"""Slender bars and thin sheets in bulk: lattices, rails, wire fences, corrugated steel.

One mesh for all bars of a lattice: hundreds of separate solids would take a second to build.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff_sim.solids.mesh import Colour, Mesh, Surface, grid_faces
from standoff_sim.solids.panels import panels


def bars(
    ends_m: FloatArray, width_m: float, colour: Colour | None, surface: Surface = Surface.STEEL, *, depth_m: float = 0.0
) -> Mesh:
    """Return square bars, open at their ends.

    Args:
        ends_m: (N, 2, 3) first and last point of each bar's axis.
        width_m: Of the section, horizontally.
        colour: None: the tint alone.
        surface: Of all bars.
        depth_m: Of the section at right angles to the width; 0: as wide as deep.
    """
    ends = np.asarray(ends_m, dtype=np.float64).reshape(-1, 2, 3)
    along = ends[:, 1] - ends[:, 0]
    upright = np.abs(along[:, 2]) > 0.99 * np.linalg.norm(along, axis=1)
    reference = np.where(upright[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    side = _unit(np.cross(along, reference))
    over = _unit(np.cross(side, along))
    half_m = np.array([width_m / 2, (depth_m or width_m) / 2])
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * half_m
    offset = corners[None, :, 0, None] * side[:, None] + corners[None, :, 1, None] * over[:, None]
    ring = ends[:, :, None] + offset[:, None]
    faces = np.stack([ring[:, 0], ring[:, 1], np.roll(ring[:, 1], -1, axis=1), np.roll(ring[:, 0], -1, axis=1)], axis=2)
    return panels(faces, colour, surface)


def grid(points_m: FloatArray, colour: Colour | None, surface: Surface, *, shade: FloatArray | None = None) -> Mesh:
    """Return a smooth sheet through a (rows, columns, 3) grid of points.

    Its front: with columns along x and rows along y the upper side, with columns along x and rows up z the one
    towards -y.

    Args:
        points_m: Of the grid.
        colour: None: the tint alone.
        surface: Of the sheet.
        shade: (rows, columns) factors of the albedo, or (rows, columns, 3): stains, rust, faded paint.
    """
    points = np.asarray(points_m, dtype=np.float64)
    rows, columns = points.shape[:2]
    normals = _unit(np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0)))
    albedo = np.tile(np.array(colour or (1.0, 1.0, 1.0), dtype=np.float64), (rows, columns, 1))
    if shade is not None:
        albedo = albedo * (shade if shade.ndim == 3 else shade[..., None])
    return Mesh(
        points.reshape(-1, 3).astype(np.float32),
        normals.reshape(-1, 3).astype(np.float32),
        albedo.reshape(-1, 3).astype(np.float32),
        np.full(rows * columns, colour is None, dtype=np.float32),
        np.full(rows * columns, surface, dtype=np.uint8),
        grid_faces(rows, columns)[:, ::-1].astype(np.uint32),
    )


def corrugated(length_m: float, height_m: float, pitch_m: float, depth_m: float, *, rows: int = 2) -> FloatArray:
    """Return the (rows, columns, 3) points of trapezoidal sheet steel along x, upright, facing -y around y = 0.

    >>> corrugated(1.0, 2.0, 0.25, 0.04).shape
    (2, 17, 3)
    """
    waves = max(1, round(length_m / pitch_m))
    corner = np.arange(4 * waves + 1)
    x_m = (corner // 4 + np.array([0.0, 0.35, 0.5, 0.85])[corner % 4]) * length_m / waves - length_m / 2
    y_m = np.array([0.5, 0.5, -0.5, -0.5])[corner % 4] * depth_m
    z_m = np.linspace(0.0, height_m, rows)
    return np.stack(
        [
            np.broadcast_to(x_m, (rows, len(x_m))),
            np.broadcast_to(y_m, (rows, len(x_m))),
            np.broadcast_to(z_m[:, None], (rows, len(x_m))),
        ],
        axis=-1,
    )


def lattice(
    length_m: float, size_m: tuple[float, float], bay_m: float, *, triangular: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return the bars of a lattice girder along z from z = 0: (4 or 3, 2, 3) chords and (M, 2, 3) bracing.

    Args:
        length_m: Of the girder.
        size_m: Of its section along x and y.
        bay_m: Between horizontal bars; diagonals turn direction from bay to bay.
        triangular: Three chords, one of them in the middle of the +x side.
    """
    half_x, half_y = size_m[0] / 2, size_m[1] / 2
    corners = np.array([[-half_x, -half_y], [half_x, -half_y], [half_x, half_y], [-half_x, half_y]])
    if triangular:
        corners = np.array([[-half_x, -half_y], [half_x, 0.0], [-half_x, half_y]])
    bays = max(1, round(length_m / bay_m))
    levels = np.linspace(0.0, length_m, bays + 1)
    rings = np.stack([np.column_stack([corners, np.full(len(corners), z)]) for z in levels])
    after = np.roll(rings, -1, axis=1)
    chords = np.stack([rings[0], rings[-1]], axis=1)
    level = np.stack([rings, after], axis=2).reshape(-1, 2, 3)
    even = (np.arange(bays) % 2 == 0)[:, None, None]
    low = np.where(even, rings[:-1], after[:-1])
    high = np.where(even, after[1:], rings[1:])
    diagonal = np.stack([low, high], axis=2).reshape(-1, 2, 3)
    return chords, np.concatenate([level, diagonal])


def rusted(mesh: Mesh, share: FloatArray) -> Mesh:
    """Return the mesh with paint that is browned by rust and dirt, by a share 0..1 for each of its (V,) vertices."""
    brown = np.array([0.55, 0.3, 0.2])
    kept = np.clip(1.0 - np.asarray(share).reshape(-1, 1), 0.0, 1.0)
    return replace(mesh, albedo=(mesh.albedo * (kept + (1.0 - kept) * brown)).astype(np.float32))


def blotches(rng: np.random.Generator, shape: tuple[int, int], low: float = 0.6) -> npt.NDArray[np.float64]:
    """Return (rows, columns) factors from `low` to 1 that vary smoothly, for faded and stained sheets."""
    coarse = rng.uniform(0.0, 1.0, (max(2, shape[0] // 3 + 1), max(2, shape[1] // 6 + 1)))
    row, column = np.linspace(0, len(coarse) - 1, shape[0]), np.linspace(0, coarse.shape[1] - 1, shape[1])
    by_column = np.stack([np.interp(column, np.arange(coarse.shape[1]), line) for line in coarse])
    smooth = np.stack([np.interp(row, np.arange(len(coarse)), line) for line in by_column.T], axis=1)
    return low + (1.0 - low) * np.clip(smooth + rng.normal(0.0, 0.12, shape), 0.0, 1.0)


def _unit(vectors: FloatArray) -> FloatArray:
    unit: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
    return unit
