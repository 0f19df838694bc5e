"""Fences along a path: mesh panels on concrete feet, printed banners, hoarding, barriers, tape; and gates."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.props.materials import aged
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.bars import bars, blotches, corrugated, grid
from standoff_sim.solids.mesh import Colour, Mesh, Surface, box, cylinder, join, profile, rotation, srgb, translation

FENCE_KINDS = ("mesh", "banner", "hoarding", "barrier", "tape")
_KIND_SHARES = (0.45, 0.25, 0.13, 0.1, 0.07)
_PANEL_M = {"mesh": 3.5, "banner": 3.5, "hoarding": 2.5, "barrier": 2.0, "tape": 4.0}
_ZINC = srgb("#9a9d9e")
_FOOT = srgb("#7d786f")
_BANNERS = 6
_CLOTHS = tuple(
    srgb(code)
    for code in ("#1f5fa8", "#d9dad6", "#2f7d4a", "#b3282d", "#e0a21b", "#2d3a4a", "#d8d2c0", "#5a8fc0", "#d2691e")
)
_BOARDS = tuple(srgb(code) for code in ("#d6d5cf", "#2f5f8f", "#3f7a55", "#9fa4a6", "#8a6b45", "#c9b68a", "#6f7a80"))


def make_fence(
    rng: np.random.Generator, path_xy_m: FloatArray, height_at: Callable[[FloatArray], FloatArray], kind: str = ""
) -> tuple[Batch, ...]:
    """Build a fence over the ground, of one kind all along.

    Args:
        rng: Decides what `kind` leaves open; panels stand a little crooked, some are missing.
        path_xy_m: (N, 2) corners, site frame.
        height_at: Ground height (M,) under (M, 2).
        kind: One of `FENCE_KINDS`; empty: any.

    Returns:
        Batches in the site frame.
    """
    kind = kind or str(rng.choice(FENCE_KINDS, p=_KIND_SHARES))
    poses = _stand(rng, np.asarray(path_xy_m, dtype=np.float64), height_at, _PANEL_M[kind])
    if kind != "tape":
        poses = poses[rng.random(len(poses)) > 0.03]
    if len(poses) == 0:
        return ()
    dust = rng.uniform(0.1, 0.6, len(poses))
    grey = np.tile(rng.uniform(0.75, 1.05), (len(poses), 3)) * rng.uniform(0.9, 1.0, (len(poses), 1))
    if kind == "hoarding":
        board = aged(rng, _BOARDS, (0.85, 1.0), len(poses))
        return (place(_board(), poses, tint=board, dust=dust),)
    if kind == "barrier":
        return (place(_barrier(), poses, tint=grey * np.array(srgb("#a8a49a")), dust=dust),)
    if kind == "tape":
        return (place(_tape(int(rng.integers(2))), poses, dust=dust),)
    panels = place(_mesh_panel(), poses, tint=grey, dust=dust)
    return (panels, *(_banners(rng, poses) if kind == "banner" else ()))


def make_gate(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a vehicle gate of two mesh leaves, each open by some angle."""
    batches = []
    for sign in (-1.0, 1.0):
        open_deg = float(rng.choice([0.0, 4.0, 60.0, 95.0]))
        hinge = translation(sign * 4.0, 0.0, 0.0) @ rotation("z", -sign * open_deg)
        mirrored = hinge if sign < 0 else hinge @ rotation("z", 180.0)
        batches.append(place(_gate_leaf(), mirrored, dust=rng.uniform(0.1, 0.5)))
    return tuple(batches)


def make_barriers(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a short row of concrete or red and white plastic barriers."""
    count = int(rng.integers(1, 6))
    shift = (np.arange(count) - (count - 1) / 2) * 2.04
    poses = np.stack([translation(x, rng.normal(0, 0.05), 0.0) @ rotation("z", rng.normal(0, 4)) for x in shift])
    if rng.random() < 0.5:
        tint = np.array(srgb("#a8a49a")) * rng.uniform(0.8, 1.1, (count, 1))
    else:
        pair = np.array([srgb("#c23a22"), srgb("#dad7d0")]) if rng.random() < 0.7 else np.array([srgb("#d98a1c")] * 2)
        tint = pair[np.arange(count) % 2] * rng.uniform(0.85, 1.0, (count, 1))
    return (place(_barrier(), poses, tint=tint, dust=rng.uniform(0.2, 0.6)),)


def _stand(
    rng: np.random.Generator, path_m: FloatArray, height_at: Callable[[FloatArray], FloatArray], panel_m: float
) -> FloatArray:
    """Return (N, 4, 4) poses of panels, local x along the path, sheared so that both ends touch the ground."""
    starts, stops = [], []
    for first, last in pairwise(path_m):
        count = max(1, round(float(np.linalg.norm(last - first)) / panel_m))
        share = np.linspace(0.0, 1.0, count + 1)[:, None]
        points = first + (last - first) * share
        points[1:-1] += rng.normal(0.0, 0.05, (max(count - 1, 0), 2))
        starts.append(points[:-1])
        stops.append(points[1:])
    start, stop = np.concatenate(starts), np.concatenate(stops)
    z_start, z_stop = height_at(start), height_at(stop)
    along = stop - start
    reach = np.linalg.norm(along, axis=1)
    forward = along / reach[:, None]
    lean = rng.normal(0.0, 0.025, len(along))
    poses = np.zeros((len(along), 4, 4))
    poses[:, :2, 0] = along / panel_m
    poses[:, 2, 0] = (z_stop - z_start) / panel_m
    poses[:, 0, 1], poses[:, 1, 1] = -forward[:, 1], forward[:, 0]
    poses[:, :2, 2] = poses[:, :2, 1] * lean[:, None]
    poses[:, 2, 2] = 1.0
    poses[:, :2, 3] = (start + stop) / 2
    poses[:, 2, 3] = (z_start + z_stop) / 2
    poses[:, 3, 3] = 1.0
    return poses


def _banners(rng: np.random.Generator, poses: FloatArray) -> tuple[Batch, ...]:
    cloth = np.array(_CLOTHS[int(rng.integers(len(_CLOTHS)))])
    covered = np.flatnonzero(rng.random(len(poses)) < rng.uniform(0.3, 1.0))
    prints = (
        rng.integers(_BANNERS, size=len(covered))
        if rng.random() < 0.4
        else np.full(len(covered), rng.integers(_BANNERS))
    )
    batches = []
    for variant in np.unique(prints):
        chosen = poses[covered[prints == variant]]
        tint = cloth * rng.uniform(0.8, 1.0, (len(chosen), 1))
        batches.append(place(_banner(int(variant)), chosen, tint=tint, dust=rng.uniform(0.1, 0.5, len(chosen))))
    return tuple(batches)


@lru_cache(maxsize=1)
def _mesh_panel() -> Mesh:
    x, top = 1.7, 2.0
    frame = [((-x, 0.0, 0.12), (-x, 0.0, top)), ((x, 0.0, 0.12), (x, 0.0, top)), ((-x, 0.0, top), (x, 0.0, top))]
    frame.append(((-x, 0.0, 0.18), (x, 0.0, 0.18)))
    wires = [((wire, 0.0, 0.18), (wire, 0.0, top)) for wire in np.linspace(-x, x, 16)[1:-1]]
    wires += [((-x, 0.0, z), (x, 0.0, z)) for z in np.linspace(0.18, top, 7)[1:-1]]
    zinc = tuple(np.array(_ZINC) / 0.9)
    colour = (zinc[0], zinc[1], zinc[2])
    parts = [_tintable(bars(np.array(frame), 0.042, colour)), _tintable(bars(np.array(wires), 0.011, colour))]
    foot = profile([(-0.11, 0.0), (0.11, 0.0), (0.09, 0.13), (-0.09, 0.13)], 0.7, _FOOT, Surface.CONCRETE)
    return join([*parts, foot.at(-1.75, 0.0, 0.0)])


@lru_cache(maxsize=_BANNERS)
def _banner(variant: int) -> Mesh:
    rng = np.random.default_rng([34, variant])
    columns, rows = 15, 4
    x, z = np.meshgrid(np.linspace(-1.68, 1.68, columns), np.linspace(0.25, 1.95, rows))
    sag = 0.05 * np.sin(np.linspace(0, 6 * np.pi, columns) + rng.uniform(0, 6)) * np.linspace(1, 0.4, rows)[:, None]
    front = grid(np.stack([x, sag - 0.07, z], axis=-1), None, Surface.FABRIC, shade=blotches(rng, x.shape, low=0.85))
    back = grid(np.stack([-x, sag[:, ::-1] - 0.066, z], axis=-1).copy(), (0.8, 0.8, 0.8), Surface.FABRIC)
    parts = [front, _tintable(back)]
    ink: Colour = ((0.75, 0.75, 0.73), srgb("#20262c"), srgb("#c8a020"))[variant % 3]
    left_m = rng.uniform(-1.4, -0.9)
    parts.append(box((rng.uniform(0.3, 0.6), 0.01, rng.uniform(0.3, 0.7)), ink, Surface.FABRIC).at(left_m, -0.13, 0.8))
    for line in range(int(rng.integers(1, 4))):
        length_m = rng.uniform(0.7, 1.7)
        stroke = box((length_m, 0.01, rng.uniform(0.1, 0.28)), ink, Surface.FABRIC)
        parts.append(stroke.at(left_m + 0.45 + length_m / 2, -0.13, 1.45 - 0.4 * line))
    return join(parts)


@lru_cache(maxsize=1)
def _board() -> Mesh:
    rng = np.random.default_rng(35)
    sheet = corrugated(2.5, 2.1, 0.25, 0.03)
    shade = blotches(rng, sheet.shape[:2], low=0.85)
    posts = [((x, 0.09, 0.0), (x, 0.09, 2.1)) for x in (-1.2, 0.0)]
    braces = [((x, 0.06, 1.5), (x, 1.0, 0.05)) for x in (-1.2,)]
    rails = [((-1.25, 0.075, z), (1.25, 0.075, z)) for z in (0.5, 1.7)]
    return join(
        [
            grid(sheet, None, Surface.PAINT, shade=shade).at(0.0, 0.0, 0.05),
            grid(sheet, None, Surface.PAINT, shade=0.8 * shade).moved(
                translation(0, 0.01, 0.05) @ rotation("z", 180.0)
            ),
            bars(np.array([*posts, *braces, *rails]), 0.08, srgb("#8a7048"), Surface.WOOD),
            box((2.5, 0.08, 0.06), None).at(0.0, 0.0, 2.12),
        ]
    )


@lru_cache(maxsize=1)
def _barrier() -> Mesh:
    half = [(0.3, 0.0), (0.3, 0.08), (0.14, 0.33), (0.09, 0.81)]
    section = profile([*half, *((-x, z) for x, z in reversed(half))], 1.98, None, Surface.CONCRETE)
    slots = [box((0.3, 0.62, 0.1), srgb("#4a463f"), Surface.CONCRETE).at(x, 0.0, 0.0) for x in (-0.6, 0.6)]
    return join([section.moved(rotation("z", 90.0)), *slots])


@lru_cache(maxsize=2)
def _tape(variant: int) -> Mesh:
    colours = ((srgb("#c8281e"), srgb("#dedbd4")), (srgb("#e0b81c"), srgb("#1c1b19")))[variant]
    x = np.linspace(-2.0, 2.0, 17)
    droop = 0.95 - 0.14 * (1 - (x / 2.0) ** 2)
    pieces = np.stack([np.column_stack([x, 0 * x, droop])[:-1], np.column_stack([x, 0 * x, droop])[1:]], axis=1)
    post = cylinder(0.025, 1.1, srgb("#7c5a34"), Surface.WOOD, sections=6).at(-2.0, 0.0, 0.5)
    strips = [bars(pieces[k::2], 0.012, colours[k], Surface.PLASTIC, depth_m=0.08) for k in range(2)]
    return join([*strips, post, cylinder(0.14, 0.06, srgb("#2a2a29"), Surface.RUBBER).at(-2.0, 0.0, 0.03)])


@lru_cache(maxsize=1)
def _gate_leaf() -> Mesh:
    edge = [((0.1, 0.0, z), (3.9, 0.0, z)) for z in (0.15, 1.1, 2.0)]
    edge += [((x, 0.0, 0.15), (x, 0.0, 2.0)) for x in (0.1, 2.0, 3.9)]
    wires = [((x, 0.0, 0.15), (x, 0.0, 2.0)) for x in np.linspace(0.1, 3.9, 22)]
    return join(
        [
            bars(np.array(edge), 0.06, srgb("#6f7476"), Surface.PAINT),
            bars(np.array(wires), 0.012, _ZINC),
            cylinder(0.09, 2.3, srgb("#6f7476"), Surface.PAINT, sections=10).at(0.0, 0.0, 1.15),
            box((0.6, 0.6, 0.3), _FOOT, Surface.CONCRETE),
            box((0.9, 0.03, 0.6), srgb("#d8b21e")).at(2.9, -0.02, 1.2),
        ]
    )


def _tintable(mesh: Mesh) -> Mesh:
    mesh.tintable[:] = 1.0
    return mesh
