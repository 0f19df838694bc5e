"""Triangles with colours and surfaces, and the solids that everything on the site is built from.

Local frame of an entity or prop: x forward, y left, z up, metres, origin on the ground under its middle.
Colours are linear albedo 0..1; `srgb` converts the numbers that people read off a colour picker.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import lru_cache
from typing import Self

import numpy as np
import numpy.typing as npt
import shapely
import trimesh

from standoff.core.homography import FloatArray
from standoff_sim.solids.shading import shade

Float32Array = npt.NDArray[np.float32]
_CREASE_DEG = 35.0


class Surface(IntEnum):
    """What a triangle is made of; the renderer gives each its roughness, metalness and fine pattern."""

    PAINT = 0
    STEEL = 1
    RUST = 2
    RUBBER = 3
    GLASS = 4
    CONCRETE = 5
    WOOD = 6
    FABRIC = 7
    SKIN = 8
    PLASTIC = 9
    FOLIAGE = 10
    SOIL = 11
    REFLECTIVE = 12
    """Retro-reflective tape of vests."""


Colour = tuple[float, float, float]


def srgb(code: str) -> Colour:
    """Convert "#rrggbb" to linear albedo.

    >>> srgb("#ffffff")
    (1.0, 1.0, 1.0)
    """
    encoded = np.array([int(code[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return float(linear[0]), float(linear[1]), float(linear[2])


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles of one rigid thing. Meshes are compared by identity: build once, place often.

    Attributes:
        vertices_m: (V, 3) local frame.
        normals: (V, 3) unit, outwards.
        albedo: (V, 3) linear.
        tintable: (V,) 0..1, how much of a `Batch`'s tint multiplies the albedo.
        surface: (V,) of `Surface`.
        triangles: (T, 3) indices, counter-clockwise from outside.
    """

    vertices_m: Float32Array
    normals: Float32Array
    albedo: Float32Array
    tintable: Float32Array
    surface: npt.NDArray[np.uint8]
    triangles: npt.NDArray[np.uint32]

    @classmethod
    def of(
        cls, solid: trimesh.Trimesh, colour: Colour | None, surface: Surface, crease_deg: float = _CREASE_DEG
    ) -> Self:
        """Take a solid of one colour; edges sharper than `crease_deg` stay sharp. colour None: the tint alone."""
        return cls.shaded(np.asarray(solid.vertices), np.asarray(solid.faces), colour, surface, crease_deg)

    @classmethod
    def shaded(
        cls, corners_m: FloatArray, faces: npt.NDArray[np.int64], colour: Colour | None, surface: Surface,
        crease_deg: float = _CREASE_DEG,
    ) -> Self:  # fmt: skip
        """Do as `of` with the solid's (V, 3) corners and (F, 3) faces."""
        vertices_m, normals, triangles = shade(corners_m, faces, crease_deg)
        return cls(
            vertices_m.astype(np.float32),
            normals.astype(np.float32),
            *_coat(len(vertices_m), colour, surface),
            triangles.astype(np.uint32),
        )

    def moved(self, pose: FloatArray) -> Mesh:
        """Return the mesh through a (4, 4) pose; scaling and mirroring are allowed."""
        linear = np.asarray(pose, dtype=np.float64)[:3, :3]
        vertices = self.vertices_m @ linear.T + np.asarray(pose)[:3, 3]
        normals = self.normals @ np.linalg.inv(linear)
        length = np.sqrt(np.einsum("ij,ij->i", normals, normals))
        # Vertices of faces without an area have no normal.
        normals /= np.where(length > 0.0, length, 1.0)[:, None]
        triangles = self.triangles if np.linalg.det(linear) > 0 else self.triangles[:, ::-1]
        return replace(
            self,
            vertices_m=vertices.astype(np.float32),
            normals=normals.astype(np.float32),
            triangles=np.ascontiguousarray(triangles),
        )

    def at(self, x_m: float, y_m: float, z_m: float) -> Mesh:
        """Return the mesh moved by an offset."""
        return replace(self, vertices_m=(self.vertices_m + np.array([x_m, y_m, z_m])).astype(np.float32))


def _coat(
    count: int, colour: Colour | None, surface: Surface
) -> tuple[Float32Array, Float32Array, npt.NDArray[np.uint8]]:
    """Return albedo, tintable and surface of vertices of one colour; None is the tint alone."""
    return (
        np.tile(np.array(colour or (1.0, 1.0, 1.0), dtype=np.float32), (count, 1)),
        np.full(count, colour is None, dtype=np.float32),
        np.full(count, surface, dtype=np.uint8),
    )


def join(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices_m) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.vertices_m for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.albedo for mesh in meshes]),
        np.concatenate([mesh.tintable for mesh in meshes]),
        np.concatenate([mesh.surface for mesh in meshes]),
        np.concatenate([mesh.triangles + np.uint32(start) for mesh, start in zip(meshes, starts, strict=True)]),
    )


def toned(mesh: Mesh, tone: float | FloatArray) -> Mesh:
    """Return the mesh lighter or darker by a factor, one for all or (V,); tinting still works on top of it."""
    factor = np.asarray(tone, dtype=np.float32).reshape(-1, 1)
    return replace(mesh, albedo=np.clip(mesh.albedo * factor, 0.0, 1.0 if mesh.tintable.any() else 0.85))


def grid_faces(rows: int, columns: int) -> npt.NDArray[np.int64]:
    """Return (T, 3) triangles over a grid of points numbered row by row, turning from rows to columns.

    >>> grid_faces(2, 2).tolist()
    [[0, 2, 3], [0, 3, 1]]
    """
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def translation(x_m: float, y_m: float, z_m: float) -> FloatArray:
    """Return the (4, 4) pose of an offset."""
    pose = np.eye(4)
    pose[:3, 3] = x_m, y_m, z_m
    return pose


def rotation(axis: str, angle_deg: float) -> FloatArray:
    """Return the (4, 4) right-handed rotation about "x", "y" or "z".

    >>> (rotation("z", 90.0) @ [1.0, 0.0, 0.0, 1.0]).round(6).tolist()
    [0.0, 1.0, 0.0, 1.0]
    """
    pose = np.eye(4)
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    sine, cosine = np.sin(np.deg2rad(angle_deg)), np.cos(np.deg2rad(angle_deg))
    pose[first, first] = pose[second, second] = cosine
    pose[first, second], pose[second, first] = -sine, sine
    return pose


def rotated_xy(points_m: FloatArray, angle_rad: float) -> FloatArray:
    """Return (..., 2) points turned counter-clockwise about the origin.

    >>> rotated_xy(np.array([[2.0, 0.0]]), np.pi / 2).round(6).tolist()
    [[0.0, 2.0]]
    """
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    turned: FloatArray = np.asarray(points_m) @ np.array([[cosine, sine], [-sine, cosine]])
    return turned


def crossed(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the cross product of two (3,) vectors: numpy's, bit for bit, at a tenth of its time.

    >>> crossed(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])).tolist()
    [0.0, 0.0, 1.0]
    """
    a, b, c = first.tolist()
    d, e, f = second.tolist()
    return np.array([b * f - c * e, c * d - a * f, a * e - b * d])


def scaling(x: float, y: float, z: float) -> FloatArray:
    """Return the (4, 4) pose that stretches along the axes."""
    return np.diag([x, y, z, 1.0])


def box(size_m: tuple[float, float, float], colour: Colour | None, surface: Surface = Surface.PAINT) -> Mesh:
    """Return a box standing on z = 0, centred in x and y."""
    sides_m2 = np.prod(size_m) / np.array(size_m)
    corners, normals, triangles = _shaded_box(*(bool(side) for side in sides_m2 > 0.2 * sides_m2.sum()))
    half_m = np.array(size_m) / 2.0
    return Mesh(
        (corners * half_m + (0.0, 0.0, half_m[2])).astype(np.float32), normals, *_coat(len(corners), colour, surface),
        triangles,
    )  # fmt: skip


@lru_cache
def _shaded_box(*large: bool) -> tuple[Float32Array, Float32Array, npt.NDArray[np.uint32]]:
    """Return corners of -1 and 1, normals and triangles of a box in the order in which `shade` has them.

    Most things on a site are boxes. Their order depends on which sides are more than a tenth of the box, and on nothing
    else: `large` across x, y and z.
    """
    sides_m2 = np.where(large, 1.0, 0.01)
    extents_m = np.sqrt(sides_m2.prod()) / sides_m2
    mesh = Mesh.of(trimesh.creation.box(extents=extents_m), None, Surface.PAINT)
    shared = np.sign(mesh.vertices_m), mesh.normals, mesh.triangles
    for array in shared:
        array.setflags(write=False)
    return shared


def cylinder(
    radius_m: float, length_m: float, colour: Colour | None, surface: Surface = Surface.STEEL, *,
    axis: str = "z", sections: int = 16,
) -> Mesh:  # fmt: skip
    """Return a cylinder centred at the origin along an axis."""
    corners, faces = _unit_cylinder(sections)
    turn = {"x": rotation("y", 90.0), "y": rotation("x", 90.0), "z": np.eye(4)}[axis][:3, :3]
    return Mesh.shaded((corners * (radius_m, radius_m, length_m)) @ turn.T, faces, colour, surface)


@lru_cache
def _unit_cylinder(sections: int) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return the corners and faces of a cylinder of radius 1 and length 1 about z, centred at the origin."""
    solid = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=sections)
    corners, faces = np.array(solid.vertices), np.array(solid.faces)
    corners.setflags(write=False)
    faces.setflags(write=False)
    return corners, faces


def profile(
    outline_xz_m: Sequence[tuple[float, float]], width_m: float, colour: Colour | None, surface: Surface = Surface.PAINT
) -> Mesh:
    """Return a plate seen from its left side: an outline in x and z, extruded along y, centred on y = 0."""
    solid = trimesh.creation.extrude_polygon(shapely.Polygon(outline_xz_m), width_m)
    solid.apply_transform(translation(0.0, width_m / 2, 0.0) @ rotation("x", 90.0))
    return Mesh.of(solid, colour, surface)


def slab(
    outline_xy_m: Sequence[tuple[float, float]], height_m: float, colour: Colour | None,
    surface: Surface = Surface.CONCRETE,
) -> Mesh:  # fmt: skip
    """Return a plate seen from above: an outline in x and y, from z = 0 up to `height_m`."""
    return Mesh.of(trimesh.creation.extrude_polygon(shapely.Polygon(outline_xy_m), height_m), colour, surface)


def tube(
    path_m: Sequence[Sequence[float]] | FloatArray, radius_m: float, colour: Colour | None,
    surface: Surface = Surface.STEEL, *, sections: int = 8,
) -> Mesh:  # fmt: skip
    """Return a round bar or hose along a (N, 3) path, a cylinder for each piece."""
    points = np.asarray(path_m, dtype=np.float64)
    corners, faces = _unit_cylinder(sections)
    pieces = []
    for start, along in zip(points[:-1], np.diff(points, axis=0), strict=True):
        turn = trimesh.geometry.align_vectors([0.0, 0.0, 1.0], along)[:3, :3]
        pieces.append((corners * (radius_m, radius_m, np.linalg.norm(along))) @ turn.T + start + along / 2)
    starts = len(corners) * np.arange(len(pieces))
    all_faces = (faces + starts[:, None, None]).reshape(-1, 3)
    # the edges of six sections turn by 60 degrees, and rounding must not decide which of them are sharp
    return Mesh.shaded(np.concatenate(pieces), all_faces, colour, surface, crease_deg=61.0)


def lathe(
    outline_rz_m: Sequence[tuple[float, float]], colour: Colour | None, surface: Surface = Surface.PLASTIC, *,
    sections: int = 20,
) -> Mesh:  # fmt: skip
    """Return a body of revolution about z from an outline of radius and height, bottom first."""
    return Mesh.of(trimesh.creation.revolve(np.array(outline_rz_m), sections=sections), colour, surface)


def ball(radius_m: tuple[float, float, float], colour: Colour | None, surface: Surface, *, detail: int = 2) -> Mesh:
    """Return an ellipsoid centred at the origin."""
    solid = trimesh.creation.icosphere(subdivisions=detail)
    solid.apply_scale(radius_m)
    return Mesh.of(solid, colour, surface, crease_deg=60.0)
