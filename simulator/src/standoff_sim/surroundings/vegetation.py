"""Trees and bushes: a trunk, lumpy crowns and loose tufts of leaves that make their outline ragged."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import trimesh

from standoff.core.homography import FloatArray
from standoff_sim.solids.mesh import Colour, Mesh, Surface, cylinder, join, srgb
from standoff_sim.solids.panels import panels

TREE_VARIANTS = 7
BUSH_VARIANTS = 4
FAR_VARIANTS = 4
GREENS: tuple[Colour, ...] = tuple(
    srgb(code) for code in ("#5c6b3a", "#6b7a48", "#4d5c34", "#7a8550", "#56663f", "#8a8a55", "#6e7552", "#44522f")
)
"""Tints of leaves: dusty greens, a few turning yellow."""


@lru_cache
def tree(variant: int) -> Mesh:
    """Return a tree of about 8 m, its crown tintable; variants 0 to TREE_VARIANTS - 1."""
    rng = np.random.default_rng([71, variant])
    slim = variant % 3 == 2
    trunk_m = rng.uniform(1.6, 2.8)
    trunk = cylinder(0.14, trunk_m + 2.0, srgb("#5a4d40"), Surface.WOOD, sections=6).at(0.0, 0.0, trunk_m / 2 + 1.0)
    lobes = [trunk]
    for lobe in range(int(rng.integers(3, 5))):
        radius_m = rng.uniform(0.9, 1.5) * np.array((0.75, 0.75, 1.5) if slim else (1.25, 1.25, 1.0))
        away_m = 0.0 if lobe == 0 else rng.uniform(0.5, 1.0 if slim else 1.9)
        turn = rng.uniform(0.0, 2 * np.pi)
        middle = np.array([away_m * np.cos(turn), away_m * np.sin(turn), trunk_m + rng.uniform(1.5, 4.2)])
        lobes.append(_crown(rng, middle, radius_m, detail=1, tufts=38))
    return join(lobes)


@lru_cache
def bush(variant: int) -> Mesh:
    """Return a bush of about 1.5 m, tintable; variants 0 to BUSH_VARIANTS - 1."""
    rng = np.random.default_rng([72, variant])
    lobes = []
    for _ in range(2):
        middle = np.array([*rng.uniform(-0.6, 0.6, 2), rng.uniform(0.35, 0.7)])
        lobes.append(_crown(rng, middle, rng.uniform(0.5, 0.9, 3), detail=1, tufts=25))
    return join(lobes)


@lru_cache
def far_tree(variant: int) -> Mesh:
    """Return a tree of about 8 m for the distance, tintable; variants 0 to FAR_VARIANTS - 1."""
    rng = np.random.default_rng([73, variant])
    low = _crown(rng, np.array([0.0, 0.0, 3.6]), np.array([2.4, 2.4, 3.4]), detail=1, tufts=0)
    high = _crown(rng, np.array([*rng.uniform(-1.0, 1.0, 2), 5.6]), np.array([1.6, 1.6, 2.2]), detail=1, tufts=12)
    return join([low, high])


def _crown(rng: np.random.Generator, middle_m: FloatArray, radius_m: FloatArray, *, detail: int, tufts: int) -> Mesh:
    """Return a lumpy ball, darker below, with tufts of leaves standing off it."""
    solid = trimesh.creation.icosphere(subdivisions=detail)
    outwards = np.array(solid.vertices)
    waves, phase = rng.normal(0.0, 3.2, (6, 3)), rng.uniform(0.0, 2 * np.pi, 6)
    bumps = 1.0 + 0.09 * np.cos(outwards @ waves.T + phase).sum(axis=1) + rng.normal(0.0, 0.05, len(outwards))
    vertices = outwards * np.asarray(radius_m) * bumps[:, None]
    shaded = trimesh.Trimesh(vertices, solid.faces, process=False)
    shade = np.clip(0.62 + 0.3 * outwards[:, 2] + 0.8 * (bumps - 1.0) + rng.normal(0.0, 0.1, len(outwards)), 0.2, 1.15)
    count = len(vertices)
    ball = Mesh(
        (vertices + middle_m).astype(np.float32),
        np.asarray(shaded.vertex_normals, dtype=np.float32),
        np.repeat(shade[:, None], 3, axis=1).astype(np.float32),
        np.ones(count, dtype=np.float32),
        np.full(count, Surface.FOLIAGE, dtype=np.uint8),
        np.asarray(solid.faces, dtype=np.uint32),
    )
    if tufts == 0:
        return ball
    return join([ball, _leaves(rng, vertices[rng.integers(count, size=tufts)] + middle_m, middle_m)])


def _leaves(rng: np.random.Generator, roots_m: FloatArray, middle_m: FloatArray) -> Mesh:
    """Return one small tilted patch at each root."""
    outwards = roots_m - middle_m
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    facing = outwards + rng.normal(0.0, 0.55, outwards.shape)
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    right = np.cross(facing, rng.normal(size=facing.shape))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    up = np.cross(facing, right)
    size_m = rng.uniform(0.12, 0.38, (len(roots_m), 1))
    centre = roots_m + outwards * rng.uniform(-0.05, 0.22, (len(roots_m), 1))
    corners = [centre + size_m * (a * right + b * up) for a, b in ((-1.0, -0.4), (0.3, -1.0), (1.0, 0.5), (-0.4, 1.0))]
    shade = np.clip(0.75 + 0.3 * outwards[:, 2] + rng.normal(0.0, 0.2, len(roots_m)), 0.25, 1.4)
    return panels(np.stack(corners, axis=1), np.repeat(shade[:, None], 3, axis=1), Surface.FOLIAGE, tintable=1.0)
