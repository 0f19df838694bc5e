"""Meshes cut into lumps: small convex solids whose outlines, together, are about the outline of the mesh.

What hides what can then be told without a depth buffer: lumps are so small that those whose middle is nearer to the
camera are in front.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
import numpy.typing as npt
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from standoff_sim.scene.scene import Batch
from standoff_sim.solids.mesh import Float32Array, Mesh

IntArray = npt.NDArray[np.int64]

LUMP_M = 1.1
"""Side of the cells that meshes are cut into."""
_CELLS_ALONG = 8
"""At most, along the longest side of a mesh: a building's lumps are larger."""
_WIRE_M = 0.1
"""What is thinner than this in two directions hides nothing that counts: bars, wires, tubes of scaffolds."""


@dataclass(frozen=True, slots=True, eq=False)
class Lumps:
    """Corners of convex solids, one solid after the other.

    Attributes:
        points_m: (N, 3).
        starts: (L,) where each solid's points begin.
    """

    points_m: Float32Array
    starts: IntArray

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Put the lumps of many things one after the other."""
        offsets = np.cumsum([0, *(len(part.points_m) for part in parts)])
        starts = [part.starts + offset for part, offset in zip(parts, offsets[:-1].tolist(), strict=True)]
        points_m = [np.empty((0, 3), np.float32), *(part.points_m for part in parts)]
        return cls(np.concatenate(points_m), np.concatenate([np.empty(0, np.int64), *starts]))

    @property
    def counts(self) -> IntArray:
        """Return (L,) numbers of points."""
        return np.diff(self.starts, append=len(self.points_m))

    def chosen(self, kept: IntArray | npt.NDArray[np.bool_]) -> Self:
        """Return some of the lumps, by number or by (L,) whether."""
        starts, counts = self.starts[kept], self.counts[kept]
        spans = zip(starts.tolist(), counts.tolist(), strict=True)
        parts = [self.points_m[start : start + count] for start, count in spans]
        return type(self)(np.concatenate([np.empty((0, 3), np.float32), *parts]), np.cumsum(counts) - counts)

    def moved(self, pose: Float32Array) -> Self:
        """Return the lumps through a (4, 4) pose."""
        return type(self)(self.points_m @ pose[:3, :3].T + pose[:3, 3], self.starts)


def lumps_of(batches: Sequence[Batch], *, wires: bool = True) -> Lumps:
    """Return the lumps of everything in the batches, in their frame; `wires` False leaves out what is thin."""
    return Lumps.joined([cut(batch.mesh, wires).moved(pose) for batch in batches for pose in batch.poses])


@lru_cache(maxsize=4096)
def cut(mesh: Mesh, wires: bool = True) -> Lumps:
    """Cut a mesh into cells of about `LUMP_M` and take the convex hull of what is in each.

    Args:
        mesh: Any.
        wires: Whether what is thin in two directions counts.
    """
    vertices_m, triangles = mesh.vertices_m.astype(np.float64), mesh.triangles.astype(np.int64)
    if not wires:
        triangles = _without_wires(vertices_m, triangles)
    if not len(triangles):
        return Lumps.joined([])
    longest_m = float(np.ptp(vertices_m[triangles.ravel()], axis=0).max())
    side_m = max(LUMP_M, longest_m / _CELLS_ALONG)
    if longest_m > 1.5 * side_m:
        vertices_m, triangles = trimesh.remesh.subdivide_to_size(vertices_m, triangles, 0.7 * side_m, max_iter=20)
        cells = np.floor(vertices_m[triangles].mean(axis=1) / side_m).astype(np.int64)
        _, cell = np.unique(cells, axis=0, return_inverse=True)
    else:
        cell = np.zeros(len(triangles), np.int64)
    return Lumps.joined([_hull(vertices_m[np.unique(triangles[cell.ravel() == k])]) for k in range(cell.max() + 1)])


def _hull(points_m: npt.NDArray[np.float64]) -> Lumps:
    # what is flat has no hull in space, and its own corners will do
    with suppress(QhullError):
        points_m = points_m[ConvexHull(points_m).vertices]
    return Lumps(points_m.astype(np.float32), np.zeros(1, np.int64))


def _without_wires(vertices_m: npt.NDArray[np.float64], triangles: IntArray) -> IntArray:
    """Return the triangles of those solids that are wide in two directions at least."""
    _, welded = np.unique(np.round(vertices_m, 4), axis=0, return_inverse=True)
    corners = welded.ravel()[triangles]
    count = int(corners.max(initial=-1)) + 1
    edges = np.concatenate([corners[:, :2], corners[:, 1:]])
    _, solid = connected_components(coo_array((np.ones(len(edges), bool), edges.T), (count, count)))
    owner = solid[corners[:, 0]]
    kept = [k for k in np.unique(owner) if _width_m(vertices_m[np.unique(triangles[owner == k])]) > _WIRE_M]
    return triangles[np.isin(owner, kept)]


def _width_m(points_m: npt.NDArray[np.float64]) -> float:
    """Return the second largest extent of points, along their own axes."""
    centred = points_m - points_m.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    return float(np.sort(np.ptp(centred @ axes.T, axis=0))[-2]) if len(axes) > 1 else 0.0
