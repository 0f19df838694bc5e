"""An excavator from mesh files in place of the procedural one: a COLLADA or glTF file for each rigid part.

Colours come from the file's texture, a colour a face, so that lettering is blanked; whatever has the paint's hue takes
the drawn livery instead. Rams and bucket linkage are built between the pivots that the layout names.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.etree.ElementTree import ParseError

import collada.common  # type: ignore[import-untyped]
import cv2
import numpy as np
import numpy.typing as npt
import trimesh

from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff_sim.machines.digging import DiggingArm, Link
from standoff_sim.machines.excavator import LIMITS, Excavator, finished, rest_of
from standoff_sim.machines.excavator_arm import RamMount, mount_rams
from standoff_sim.machines.machine_parts import Point, beam, rectangle
from standoff_sim.machines.paint import SOILS, Painted, draw_livery, weather
from standoff_sim.solids.loose_material import soil_heap
from standoff_sim.solids.mesh import Mesh, Surface, join, rotation, srgb, translation

PARTS = ("crawler", "body", "boom", "arm", "bucket")
SUFFIXES = (".dae", ".glb", ".gltf")
BUDGET = 12_000
"""Triangles of all parts; finer meshes are thinned out."""

_PAINT = -1
_CELLS_M = (1e-4, 0.015, 0.02, 0.03, 0.04, 0.055, 0.075, 0.1, 0.14, 0.2)
_PAINT_HUE = (6, 28)
"""OpenCV's hue, 0..179: red-orange to yellow."""
_UNREADABLE = (
    ValueError, LookupError, TypeError, AttributeError, OSError, ParseError, json.JSONDecodeError,
    collada.common.DaeError,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class MeshLayout:
    """Where the parts of a set of mesh files are joined, metres; each file has its own frame, x forward, z up.

    Attributes:
        prefix: Of the file names: prefix, part, suffix.
        swing_m: Swing axis in the crawler's file.
        foot_m: Boom foot in the body's file.
        arm_m: The arm's pivot in the boom's file.
        bucket_m: The bucket's pivot in the arm's file.
        boom_ram_m: Barrel pivots of the boom's rams in the body's file (y is their distance from the middle).
        boom_pin_xz_m: Where they hold the boom, boom's link frame (x from foot to arm pivot).
        arm_ram_xz_m: Barrel pivot of the arm's ram, boom's link frame.
        arm_pin_xz_m: Its rod's pivot, arm's link frame (x to the bucket's pivot).
        bucket_ram_xz_m: Barrel pivot of the bucket's ram, arm's link frame.
        rocker_xz_m: The rocker's pivot, arm's link frame.
        rocker_m: Length of the rocker.
        tie_m: Length of the tie.
        ear_xz_m: Where the tie holds the bucket, bucket's link frame (x to the tooth tips).
    """

    prefix: str
    swing_m: Point
    foot_m: Point
    arm_m: Point
    bucket_m: Point
    boom_ram_m: Point
    boom_pin_xz_m: tuple[float, float]
    arm_ram_xz_m: tuple[float, float]
    arm_pin_xz_m: tuple[float, float]
    bucket_ram_xz_m: tuple[float, float]
    rocker_xz_m: tuple[float, float]
    rocker_m: float
    tie_m: float
    ear_xz_m: tuple[float, float]


ZX200 = MeshLayout(
    prefix="zx200-",
    swing_m=(0.10787, -0.034301, 1.1206),
    foot_m=(0.22767, -0.040187, 0.83669),
    arm_m=(4.7878, 0.010957, 2.9959),
    bucket_m=(1.8954, -0.023546, 2.1809),
    boom_ram_m=(0.72, 0.36, 0.20),
    boom_pin_xz_m=(2.27, 0.96),
    arm_ram_xz_m=(3.38, 1.16),
    arm_pin_xz_m=(-0.80, 0.36),
    bucket_ram_xz_m=(0.42, 0.70),
    rocker_xz_m=(2.45, 0.05),
    rocker_m=0.56,
    tie_m=0.60,
    ear_xz_m=(-0.05, 0.47),
)
"""Of the layout that pwri-opera's zx200 description has; pins that it does not name were measured on its meshes."""


@dataclass(frozen=True, slots=True, eq=False)
class _Soup:
    """Triangles with a colour each."""

    corners_m: FloatArray
    """(T, 3, 3)"""
    colour: npt.NDArray[np.uint8]
    """(T, 3) RGB"""


def load_excavator(folder: Path, rng: np.random.Generator, layout: MeshLayout = ZX200) -> Excavator:
    """Build an excavator from the mesh files in a folder; it is used like any other.

    Args:
        folder: With one file for each of `PARTS`, and their texture `bake.png` unless the files name another.
        rng: Draws colours and wear.
        layout: File names and pivots.

    Raises:
        DataError: A part is missing, unreadable or empty.
    """
    paths = tuple(_find(folder, layout.prefix, part) for part in PARTS)
    texture = folder / "bake.png"
    stamps = tuple(path.stat().st_mtime_ns for path in (*paths, *([texture] if texture.is_file() else [])))
    built = _assemble(paths, texture, layout, stamps)
    livery = draw_livery(rng)
    dust = livery.dust
    tints = {
        Link.UNDERCARRIAGE: livery.frame, Link.UPPER: livery.body, Link.BOOM: livery.boom, Link.ARM: livery.boom,
        Link.BUCKET: livery.tool, Link.ROCKER: livery.boom, Link.TIE: livery.boom,
    }  # fmt: skip
    return finished(
        Excavator(
            linkage=built.linkage,
            skins={link: (Painted(mesh, tints[link], dust),) for link, mesh in built.meshes.items()},
            soil=Painted(built.soil, weather(rng, srgb(SOILS[rng.integers(len(SOILS))])), 0.0),
            rams=built.rams,
            ram_tint=livery.boom,
            gear=None,
            footprint_m=built.footprint_m,
            height_m=0.0,
            joints=LIMITS,
            rest=rest_of(built.linkage),
        )
    )


def _find(folder: Path, prefix: str, part: str) -> Path:
    for suffix in SUFFIXES:
        path = folder / f"{prefix}{part}{suffix}"
        if path.is_file():
            return path
    raise DataError(
        expected=f"the excavator's part '{part}' in {folder}, as {prefix}{part} with one of {', '.join(SUFFIXES)}",
        found="no such file",
        fix="add the file, or leave the folder out to get a procedural excavator",
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Built:
    linkage: DiggingArm
    meshes: Mapping[Link, Mesh]
    soil: Mesh
    rams: tuple[RamMount, ...]
    footprint_m: FloatArray


@lru_cache(maxsize=4)
def _assemble(paths: tuple[Path, ...], texture: Path, layout: MeshLayout, stamps: tuple[int, ...]) -> _Built:
    """Bring each part into its link's frame; `stamps` tell one state of the files from another."""
    image = cv2.imread(str(texture)) if texture.is_file() else None
    soups = dict(zip(PARTS, (_read(path, image) for path in paths), strict=True))
    crawler = soups["crawler"].corners_m.reshape(-1, 3)
    low, high = crawler.min(axis=0), crawler.max(axis=0)
    to_ground = -np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
    swing = np.array(layout.swing_m) + to_ground
    tip_m, tip_deg = _tip(soups["bucket"])
    boom_m, boom_deg = _polar(layout.arm_m)
    arm_m, arm_deg = _polar(layout.bucket_m)
    into_link = {
        "crawler": (Link.UNDERCARRIAGE, translation(*to_ground)),
        "body": (Link.UPPER, translation(0.0, 0.0, swing[2])),
        "boom": (Link.BOOM, rotation("y", boom_deg)),
        "arm": (Link.ARM, rotation("y", arm_deg)),
        "bucket": (Link.BUCKET, rotation("y", tip_deg)),
    }
    linkage = DiggingArm(
        swing_xy_m=(float(swing[0]), float(swing[1])),
        foot_m=(layout.foot_m[0], layout.foot_m[1], layout.foot_m[2] + float(swing[2])),
        boom_m=boom_m,
        arm_m=arm_m,
        bucket_m=tip_m,
        rocker_xz_m=layout.rocker_xz_m,
        rocker_m=layout.rocker_m,
        tie_m=layout.tie_m,
        ear_xz_m=layout.ear_xz_m,
        arm_y_m=layout.arm_m[1],
        bucket_y_m=layout.bucket_m[1],
    )
    cell_m = next(
        (cell for cell in _CELLS_M if sum(_count(soup, cell) for soup in soups.values()) <= BUDGET), _CELLS_M[-1]
    )
    meshes = {link: _mesh(soups[part], cell_m).moved(pose) for part, (link, pose) in into_link.items()}
    width_m = np.ptp(soups["bucket"].corners_m[..., 1])
    meshes[Link.ROCKER] = join(
        [beam((0.0, y_m, 0.0), (layout.rocker_m, y_m, 0.0), (0.07, 0.12), None) for y_m in (-0.24, 0.24)]
    )
    meshes[Link.TIE] = beam((0.0, 0.0, 0.0), (layout.tie_m, 0.0, 0.0), (0.26, 0.12), None)
    heap = soil_heap(0.72 * tip_m, 0.9 * float(width_m), 0.2 * tip_m, None)
    return _Built(
        linkage,
        meshes,
        heap.moved(translation(0.5 * tip_m, 0.0, 0.1 * tip_m) @ rotation("x", 180.0)),
        _rams(linkage, layout),
        rectangle(float(high[0] - low[0]), float(high[1] - low[1])),
    )


def _rams(linkage: DiggingArm, layout: MeshLayout) -> tuple[RamMount, ...]:
    x_m, beside_m, z_m = layout.boom_ram_m
    floor_m = linkage.foot_m[2] - layout.foot_m[2]

    def flat(xz_m: tuple[float, float]) -> Point:
        return xz_m[0], 0.0, xz_m[1]

    plans = (
        (Link.UPPER, (x_m, layout.foot_m[1], z_m + floor_m), Link.BOOM, flat(layout.boom_pin_xz_m),
         (-beside_m, beside_m)),
        (Link.BOOM, flat(layout.arm_ram_xz_m), Link.ARM, flat(layout.arm_pin_xz_m), (0.0,)),
        (Link.ARM, flat(layout.bucket_ram_xz_m), Link.TIE, (0.0, 0.0, 0.0), (0.0,)),
    )  # fmt: skip
    return mount_rams(linkage, plans, LIMITS, 0.085)


def _polar(pivot_m: Point) -> tuple[float, float]:
    """Return distance and elevation of a pivot in the xz plane."""
    return float(np.hypot(pivot_m[0], pivot_m[2])), float(np.rad2deg(np.arctan2(pivot_m[2], pivot_m[0])))


def _tip(bucket: _Soup) -> tuple[float, float]:
    """Return distance and elevation of the teeth: what is farthest from the bucket's pivot, within 1 cm."""
    corners_m = bucket.corners_m.reshape(-1, 3)
    away_m = np.hypot(corners_m[:, 0], corners_m[:, 2])
    farthest = corners_m[away_m > away_m.max() - 0.01].mean(axis=0)
    return _polar((float(farthest[0]), 0.0, float(farthest[2])))


def _read(path: Path, image: npt.NDArray[np.uint8] | None) -> _Soup:
    """Read all triangles of a file with the colour that texture or material gives each."""
    try:
        pieces = [piece for piece in trimesh.load_scene(path).dump() if isinstance(piece, trimesh.Trimesh)]
    except _UNREADABLE as error:
        raise DataError(
            expected=f"a COLLADA or glTF mesh in {path}", found=f"{type(error).__name__}: {error}",
            fix="export the part again, or leave the folder out to get a procedural excavator",
        ) from error  # fmt: skip
    if not sum(len(piece.faces) for piece in pieces):
        raise DataError(expected=f"triangles in {path}", found="none", fix="export the part again as a mesh")
    return _Soup(
        np.concatenate([np.asarray(piece.triangles, dtype=np.float64) for piece in pieces]),
        np.concatenate([_face_colour(piece, image) for piece in pieces]),
    )


def _face_colour(piece: trimesh.Trimesh, image: npt.NDArray[np.uint8] | None) -> npt.NDArray[np.uint8]:
    """Return (T, 3) RGB: the texture in the middle of each face, else the file's own colours."""
    visual = piece.visual
    uv, material = getattr(visual, "uv", None), getattr(visual, "material", None)
    if image is None or uv is None:
        if material is None:
            own = visual.face_colors
        else:
            own = material.main_color if uv is None else visual.to_color().face_colors
        return np.broadcast_to(np.asarray(own, dtype=np.uint8)[..., :3], (len(piece.faces), 3))
    middle = np.asarray(uv)[piece.faces].mean(axis=1) % 1.0
    height_px, width_px = image.shape[:2]
    column = np.minimum((middle[:, 0] * width_px).astype(int), width_px - 1)
    row = np.minimum(((1.0 - middle[:, 1]) * height_px).astype(int), height_px - 1)
    return np.ascontiguousarray(image[row, column, ::-1])


def _shades(soup: _Soup) -> npt.NDArray[np.int64]:
    """Return (T,) of few colours: 8 levels a channel as one number, _PAINT for whatever has the paint's hue."""
    hue, saturation, value = cv2.cvtColor(soup.colour[None], cv2.COLOR_RGB2HSV)[0].T
    painted = (hue >= _PAINT_HUE[0]) & (hue <= _PAINT_HUE[1]) & (saturation > 110) & (value > 90)
    shades: npt.NDArray[np.int64] = np.where(painted, _PAINT, (soup.colour >> 5).astype(np.int64) @ [64, 8, 1])
    return shades


def _clustered(soup: _Soup, cell_m: float) -> tuple[FloatArray, npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Merge vertices that share a cell, drop triangles that collapse; return (V, 3), (T, 3) and shades (T,)."""
    points_m = soup.corners_m.reshape(-1, 3)
    cells = np.round(points_m / cell_m).astype(np.int64)
    _, index, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    merged_m = np.column_stack([np.bincount(index, points_m[:, axis]) for axis in range(3)]) / counts[:, None]
    faces = index.reshape(-1, 3)
    first, second, third = faces.T
    whole = (first != second) & (second != third) & (third != first)
    _, kept = np.unique(np.sort(faces[whole], axis=1), axis=0, return_index=True)
    return merged_m, faces[whole][kept], _shades(soup)[whole][kept]


def _count(soup: _Soup, cell_m: float) -> int:
    return len(_clustered(soup, cell_m)[1])


def _mesh(soup: _Soup, cell_m: float) -> Mesh:
    vertices_m, faces, shades = _clustered(soup, cell_m)
    pieces = []
    for shade in np.unique(shades):
        solid = trimesh.Trimesh(vertices_m, faces[shades == shade], process=False)
        solid.remove_unreferenced_vertices()
        level = (16 + 32 * np.array([shade >> 6, (shade >> 3) & 7, shade & 7])).tolist()
        colour = None if shade == _PAINT else srgb("#{:02x}{:02x}{:02x}".format(*level))
        pieces.append(Mesh.of(solid, colour, Surface.PAINT))
    return join(pieces)
