"""Every mesh of the scene in one pair of GPU buffers, and tables of the places where they stand.

All instances that a pass needs are drawn by one indirect call: nothing is done per instance in Python.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from standoff_sim.scene.scene import Batch
from standoff_sim.solids.mesh import Float32Array, Mesh

IntArray = npt.NDArray[np.int64]
_VERTEX_FLOATS = 12
_INSTANCE_FLOATS = 18
_FORGET_ABOVE_VERTICES = 4_000_000


def vertex_table(mesh: Mesh) -> Float32Array:
    """Return (V, 12) position, normal, albedo, tintable, surface, height above the mesh's lowest point."""
    height_m = mesh.vertices_m[:, 2] - mesh.vertices_m[:, 2].min(initial=np.inf)
    columns = (mesh.vertices_m, mesh.normals, mesh.albedo, mesh.tintable[:, None], mesh.surface[:, None])
    return np.hstack([*columns, height_m[:, None]]).astype(np.float32)


def split_closed(mesh: Mesh) -> tuple[npt.NDArray[np.uint32], int]:
    """Put the triangles of closed solids first: their inner sides can never be seen and need not be drawn.

    Returns:
        (T, 3) triangles in the new order and how many belong to solids all of whose edges have their opposite.
    """
    places = np.round(mesh.vertices_m * 1e5).astype(np.int64) + (1 << 20)
    _, welded = np.unique(places @ np.array([1 << 42, 1 << 21, 1]), return_inverse=True)
    corners = welded[mesh.triangles.astype(np.int64)]
    start, stop = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    count = int(welded.max(initial=-1)) + 1
    forth, back = start * count + stop, stop * count + start
    lonely = ~np.isin(forth, back)
    solids, solid = connected_components(coo_array((np.ones(len(start), bool), (start, stop)), (count, count)))
    open_solid = np.zeros(solids, bool)
    open_solid[solid[start[lonely]]] = True
    open_triangle = open_solid[solid[corners[:, 0]]]
    return mesh.triangles[np.argsort(open_triangle, kind="stable")], int((~open_triangle).sum())


class Arena:
    """Meshes in GPU memory, each uploaded once for as long as the renderer lives.

    Attributes:
        generation: Grows whenever the buffers are replaced.
        ranges: Of each mesh: first index, number of indices, how many of them are of closed solids, first vertex.
        spheres: Of each mesh: bounding sphere, local frame.
    """

    def __init__(self, context: Any) -> None:  # noqa: ANN401
        self._context = context
        self._meshes: dict[int, tuple[Mesh, int]] = {}
        self._vertices = context.buffer(reserve=4 * _VERTEX_FLOATS * (1 << 16))
        self._indices = context.buffer(reserve=4 * (1 << 18))
        self.generation = 0
        self._clear()

    def _clear(self) -> None:
        self._meshes.clear()
        self._vertex_count = self._index_count = 0
        self.ranges: list[tuple[int, int, int, int]] = []
        self.spheres: list[tuple[float, float, float, float]] = []

    @property
    def buffers(self) -> tuple[Any, Any]:
        """Vertices and indices; replaced whenever `generation` grows."""
        return self._vertices, self._indices

    def forget_if_large(self) -> None:
        """Drop all meshes when there are too many; whoever holds numbers of meshes must look them up again."""
        if self._vertex_count > _FORGET_ABOVE_VERTICES:
            self._clear()

    def number(self, mesh: Mesh) -> int:
        """Return the mesh's number, uploading it when it is new."""
        known = self._meshes.get(id(mesh))
        if known is None:
            known = mesh, self._upload(mesh)
            self._meshes[id(mesh)] = known
        return known[1]

    def _upload(self, mesh: Mesh) -> int:
        triangles, closed_count = split_closed(mesh)
        vertices, indices = vertex_table(mesh), np.ascontiguousarray(triangles, dtype=np.uint32)
        self._vertices = self._room(self._vertices, 4 * _VERTEX_FLOATS * self._vertex_count, vertices.nbytes)
        self._indices = self._room(self._indices, 4 * self._index_count, indices.nbytes)
        if vertices.size and indices.size:
            self._vertices.write(vertices.tobytes(), offset=4 * _VERTEX_FLOATS * self._vertex_count)
            self._indices.write(indices.tobytes(), offset=4 * self._index_count)
        self.ranges.append((self._index_count, indices.size, 3 * closed_count, self._vertex_count))
        low, high = mesh.vertices_m.min(axis=0, initial=np.inf), mesh.vertices_m.max(axis=0, initial=-np.inf)
        centre = (low + high) / 2
        radius = np.sqrt(((mesh.vertices_m - centre) ** 2).sum(axis=1).max(initial=0.0))
        self.spheres.append((*centre.tolist(), float(radius)))
        self._vertex_count += len(vertices)
        self._index_count += indices.size
        return len(self.spheres) - 1

    def _room(self, buffer: Any, used_bytes: int, more_bytes: int) -> Any:  # noqa: ANN401
        if used_bytes + more_bytes <= buffer.size:
            return buffer
        larger = self._context.buffer(reserve=2 * (used_bytes + more_bytes))
        if used_bytes:
            self._context.copy_buffer(larger, buffer, used_bytes)
        buffer.release()
        self.generation += 1
        return larger


@dataclass(frozen=True, slots=True, eq=False)
class Instances:
    """Meshes in their places.

    Attributes:
        kind: (N,) twice the mesh's number in the arena, one more where the pose mirrors.
        rows: (N, 18) as the shaders read them: three rows of the pose, tint, dust, entity id, a random number.
        centre_m: (N, 3) of the bounding sphere, site frame.
        radius_m: (N,) of the bounding sphere.
    """

    kind: IntArray
    rows: Float32Array
    centre_m: Float32Array
    radius_m: Float32Array

    @classmethod
    def of(cls, batches: Sequence[Batch], arena: Arena) -> Self:
        """Look up and if need be upload the meshes, and lay the places out in one table."""
        batches = [batch for batch in batches if len(batch.poses) and len(batch.mesh.triangles)]
        if not batches:
            return cls(
                np.empty(0, np.int64),
                np.empty((0, _INSTANCE_FLOATS), np.float32),
                np.empty((0, 3), np.float32),
                np.empty(0, np.float32),
            )
        counts = [len(batch.poses) for batch in batches]
        mesh = np.repeat([arena.number(batch.mesh) for batch in batches], counts)
        poses = np.concatenate([batch.poses for batch in batches])
        rows = np.empty((len(poses), _INSTANCE_FLOATS), np.float32)
        rows[:, :12] = poses[:, :3].reshape(-1, 12)
        rows[:, 12:15] = np.concatenate([batch.tint for batch in batches])
        rows[:, 15] = np.concatenate([batch.dust for batch in batches])
        rows[:, 16] = np.repeat([batch.entity_id for batch in batches], counts)
        # Not from the place, which moves, nor from the mesh's number, which depends on the scenes before.
        first = np.repeat([len(batch.mesh.vertices_m) * 0.381 for batch in batches], counts)
        rows[:, 17] = (first + np.concatenate([np.arange(count) for count in counts]) * 0.618) % 1.0
        spheres = np.array(arena.spheres, dtype=np.float32)[mesh]
        linear = poses[:, :3, :3]
        centre = np.einsum("nij,nj->ni", linear, spheres[:, :3]) + poses[:, :3, 3]
        stretch = np.sqrt((linear**2).sum(axis=1).max(axis=1))
        return cls(2 * mesh + (np.linalg.det(linear) < 0), rows, centre, spheres[:, 3] * stretch)

    def __len__(self) -> int:
        return len(self.kind)

    def __getitem__(self, chosen: npt.NDArray[np.bool_] | IntArray) -> Self:
        return type(self)(self.kind[chosen], self.rows[chosen], self.centre_m[chosen], self.radius_m[chosen])

    def __add__(self, other: Instances) -> Self:
        return type(self)(
            np.concatenate([self.kind, other.kind]),
            np.concatenate([self.rows, other.rows]),
            np.concatenate([self.centre_m, other.centre_m]),
            np.concatenate([self.radius_m, other.radius_m]),
        )

    def nearest_first(self, eye_m: npt.NDArray[np.float64]) -> Self:
        """Sort by mesh, the mesh with the nearest instance first: what is in front then hides what is behind."""
        if not len(self):
            return self
        away_m = np.sqrt(((self.centre_m - eye_m.astype(np.float32)) ** 2).sum(axis=1)) - self.radius_m
        nearest_m = np.full(int(self.kind.max()) + 1, np.inf, np.float32)
        np.minimum.at(nearest_m, self.kind, away_m)
        return self[np.lexsort((away_m, self.kind, nearest_m[self.kind]))]


def draw_commands(instances: Instances, arena: Arena) -> tuple[npt.NDArray[np.uint32], int]:
    """Return (D, 5) indirect draw commands for instances in which equal kinds are neighbours.

    The first commands, as many as the second result says, are of closed solids.
    """
    if not len(instances):
        return np.empty((0, 5), np.uint32), 0
    starts = np.flatnonzero(np.diff(instances.kind, prepend=-1))
    kind = instances.kind[starts]
    first, count, closed, vertex = np.array(arena.ranges)[kind // 2].T
    closed = np.where(kind % 2, 0, closed)
    placed = np.diff(starts, append=len(instances))
    solid = np.stack([closed, placed, first, vertex, starts], axis=1)[closed > 0]
    rest = np.stack([count - closed, placed, first + closed, vertex, starts], axis=1)[count > closed]
    return np.concatenate([solid, rest]).astype(np.uint32), len(solid)


class InstanceDrawer:
    """Draws instances with one program; its own instance buffer grows as needed."""

    _VERTEX = "3f 3f 4f 2f", ("position", "normal", "albedo", "surface_height")
    _INSTANCE = "4f 4f 4f 4f 2f/i", ("pose_x", "pose_y", "pose_z", "tint_dust", "id_seed")

    def __init__(self, context: Any, program: Any) -> None:  # noqa: ANN401
        self._context, self.program = context, program
        self._rows = context.buffer(reserve=4 * _INSTANCE_FLOATS * 1024)
        self._commands = context.buffer(reserve=20 * 256)
        self._array: Any = None
        self._generation = -1

    def draw(self, instances: Instances, arena: Arena) -> None:
        """Draw into the framebuffer in use; equal kinds must be neighbours."""
        commands, solids = draw_commands(instances, arena)
        if not len(commands):
            return
        if instances.rows.nbytes > self._rows.size:
            self._rows.release()
            self._rows = self._context.buffer(reserve=2 * instances.rows.nbytes)
            self._generation = -1
        if commands.nbytes > self._commands.size:
            self._commands.release()
            self._commands = self._context.buffer(reserve=2 * commands.nbytes)
        self._rows.write(np.ascontiguousarray(instances.rows).data)
        self._commands.write(commands.data)
        if self._generation != arena.generation:
            self._bind(arena)
        if solids:
            self._context.enable(self._context.CULL_FACE)
            self._array.render_indirect(self._commands, count=solids)
            self._context.disable(self._context.CULL_FACE)
        if solids < len(commands):
            self._array.render_indirect(self._commands, count=len(commands) - solids, first=solids)

    def _bind(self, arena: Arena) -> None:
        vertices, indices = arena.buffers
        used = []
        for buffer, (layout, names) in ((vertices, self._VERTEX), (self._rows, self._INSTANCE)):
            kept = [name if name in self.program else None for name in names]
            parts, _, divisor = layout.partition("/")
            padded = [part if name else f"{4 * int(part[0])}x" for part, name in zip(parts.split(), kept, strict=True)]
            used.append((buffer, " ".join(padded) + ("/" + divisor if divisor else ""), *filter(None, kept)))
        if self._array is not None:
            self._array.release()
        self._array = self._context.vertex_array(self.program, used, indices)
        self._generation = arena.generation
