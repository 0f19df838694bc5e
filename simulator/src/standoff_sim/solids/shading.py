"""Shade solids: smooth where they are round, sharp at their creases and around their large flat sides.

As `trimesh.graph.smooth_shade` does it, in a tenth of its time: a site is made of hundreds of solids, and shading them
took half of what it takes to build one.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray

IndexArray = npt.NDArray[np.int64]

_LARGE = 0.1
"""Share of the whole surface above which a flat side keeps its own vertices, however blunt its edges are."""
_FLAT_RATIO = 5000.0
"""Two faces are one flat side where the circle through them is so many times larger than they are, squared."""
_SMALLEST_M2 = 1e-13
"""Of twice the area of a face that has a normal."""


def shade(vertices_m: FloatArray, faces: IndexArray, crease_deg: float) -> tuple[FloatArray, FloatArray, IndexArray]:
    """Part a solid's faces at its creases and give the vertices their normals.

    Args:
        vertices_m: (V, 3), shared by the faces around them.
        faces: (F, 3), counter-clockwise from outside.
        crease_deg: Edges that turn by more stay sharp.

    Returns:
        (W, 3) vertices, as many copies of each as there are patches around it; (W, 3) unit normals, zero where no
        face has an area; (F, 3) faces.
    """
    corners_m = vertices_m[faces]
    crosses = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 1])
    normals, double_m2 = _unit(crosses)
    patches = _patches(_adjacent(faces, len(vertices_m)), normals, double_m2, np.deg2rad(crease_deg))
    if patches is not None:
        order = np.argsort(patches, kind="stable")
        faces, normals, corners_m = faces[order], normals[order], corners_m[order]
        keys = patches[order, None] * len(vertices_m) + faces
        copies, numbers = np.unique(keys, return_inverse=True)
        vertices_m, faces = vertices_m[copies % len(vertices_m)], numbers.reshape(-1, 3)
    weighted = _angles(corners_m)[..., None] * normals[:, None]
    summed = [np.bincount(faces.ravel(), weighted[..., i].ravel(), len(vertices_m)) for i in range(3)]
    return vertices_m, _unit(np.stack(summed, axis=1))[0], faces


def _patches(adjacent: IndexArray, normals: FloatArray, double_m2: FloatArray, crease: float) -> IndexArray | None:
    """Return (F,) numbers of what is shaded as one, in the order in which trimesh has them; None: all is."""
    turns = np.arccos(np.clip(np.einsum("ij,ij->i", normals[adjacent[:, 0]], normals[adjacent[:, 1]]), -1.0, 1.0))
    flat = 4.0 * np.sin(turns) ** 2 * _FLAT_RATIO < 1.0
    sides = _components(adjacent[flat], len(normals))
    large = np.bincount(sides, double_m2, len(normals)) > _LARGE * double_m2.sum()
    large &= np.bincount(sides, minlength=len(normals)) > 1
    in_large = large[sides]
    smooth = adjacent[(turns < crease) & ~in_large[adjacent].any(axis=1)]
    if not len(smooth) and not in_large.any():
        return None
    patches = np.where(in_large, sides, _components(smooth, len(normals)))
    alone = np.bincount(patches, minlength=len(normals))[patches] == 1
    numbers: IndexArray = patches + len(normals) * (in_large + 2 * alone)
    return numbers


def _components(links: IndexArray, count: int) -> IndexArray:
    """Return for each of `count` nodes the smallest node that it is linked to, over any number of links.

    >>> _components(np.array([[3, 1], [4, 3]]), 5).tolist()
    [0, 1, 2, 1, 1]
    """
    roots: IndexArray = np.arange(count)
    while True:
        ends = roots[links]
        low, high = ends.min(axis=1), ends.max(axis=1)
        if (low == high).all():
            return roots
        np.minimum.at(roots, high, low)
        while ((further := roots[roots]) != roots).any():
            roots = further


def _adjacent(faces: IndexArray, vertices: int) -> IndexArray:
    """Return (A, 2) faces that share an edge which no third one has."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    keys = edges[:, 0] * vertices + edges[:, 1]
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    starts = starts[np.diff(starts, append=len(keys)) == 2]
    pairs: IndexArray = np.stack([order[starts], order[starts + 1]], axis=1) // 3
    two: IndexArray = pairs[pairs[:, 0] != pairs[:, 1]]
    return two


def _angles(corners_m: FloatArray) -> FloatArray:
    """Return (F, 3) angles of triangles at their corners."""
    first, _ = _unit(corners_m[:, 1] - corners_m[:, 0])
    second, _ = _unit(corners_m[:, 2] - corners_m[:, 0])
    third, _ = _unit(corners_m[:, 2] - corners_m[:, 1])
    at_first = np.arccos(np.clip(np.einsum("ij,ij->i", first, second), -1.0, 1.0))
    at_second = np.arccos(np.clip(-np.einsum("ij,ij->i", first, third), -1.0, 1.0))
    return np.stack([at_first, at_second, np.pi - at_first - at_second], axis=1)


def _unit(vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the vectors at length one, those next to nothing at none, and the lengths."""
    lengths: FloatArray = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    return vectors * np.where(lengths > _SMALLEST_M2, 1.0 / np.maximum(lengths, _SMALLEST_M2), 0.0)[:, None], lengths
