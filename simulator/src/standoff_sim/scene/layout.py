"""Where clutter lies: rows of stores, crowds around the work, things along the fence and in the gaps between.

Free ground is a raster. A thing takes the rectangle that its meshes cover, so that long things lie close together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
import shapely

from standoff.core.homography import FloatArray
from standoff_sim.props.prop import Prop
from standoff_sim.scene.scene import Batch, GroundSurface
from standoff_sim.solids.mesh import Mesh, rotated_xy

_CELL_M = 0.2
_MARGIN_M = 0.25
"""Half a cell's diagonal for the raster and as much for the samples: true rectangles never overlap."""
_TALL_M = 1.2
"""Lower things lean with the ground they lie on; taller ones stand upright and sink in."""
_STEEPEST = 0.22
_ROUGHEST_M = 0.45
"""Range of heights under a thing, after its own slope, that it may still stand on."""
_GAP_M = 0.04
"""Air that may show under the lowest ground."""
_SHIFT = 4
"""Bits of cv2's fractions of a pixel."""
_ZONE_SHARES = (0.3, 0.32, 0.1, 0.28)
_TIGHT = 1.4
"""Radius of a thing over the free radius of a gap that is tried: few things are round."""
_TRIES = 8
_NUDGES = np.array([0.4, 0.9, 1.5])
"""Steps to the side, in lengths of the thing, that are tried where there is no room."""


@dataclass(frozen=True, slots=True)
class _Spot:
    """A proposal: which prop, where, in which direction."""

    prop: int
    xy_m: FloatArray
    turn_rad: float


def lay_out(
    rng: np.random.Generator, props: Sequence[Prop], density: float, keep_clear: Sequence[shapely.Polygon],
    extent_m: tuple[float, float, float, float], ground: GroundSurface,
) -> tuple[Batch, ...]:  # fmt: skip
    """Strew props over a site.

    Args:
        rng: Decides everything.
        props: To choose from, by weight.
        density: Share 0..1 of the free ground that things shall cover; 0.15 is a busy site, and beyond about 0.25 no
            more room is found.
        keep_clear: Nothing comes into these: paths of actors, the reference object (site frame).
        extent_m: West, south, east, north of the area.
        ground: Things stand on it.

    Returns:
        One batch for each mesh, poses in the site frame.
    """
    yard = _Yard(extent_m, keep_clear)
    wanted_m2 = density * yard.free_m2()
    pieces: list[tuple[Batch, FloatArray]] = []
    for spot in _proposals(rng, props, yard, wanted_m2):
        if yard.taken_m2 >= wanted_m2:
            break
        if not yard.free(spot.xy_m):
            continue
        batches = props[spot.prop].make(rng)
        pose = _settle(rng, spot, batches, yard, ground)
        if pose is not None:
            pieces += [(batch, pose) for batch in batches]
    return _merged(pieces)


def _settle(
    rng: np.random.Generator, spot: _Spot, batches: Sequence[Batch], yard: _Yard, ground: GroundSurface
) -> FloatArray | None:
    """Find room at a spot or within a step of it, take it and return the pose; None without room."""
    low, high, top_m = _bounds(batches)
    local = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    for nudge_m in (0.0, *_NUDGES * float(np.max(high - low))):
        moved = replace(spot, xy_m=spot.xy_m + nudge_m * rng.uniform(-1.0, 1.0, 2)) if nudge_m else spot
        corners = _turned(local, moved)
        if yard.fits(corners):
            pose = _stand(moved, corners, top_m, ground)
            if pose is not None:
                yard.take(corners)
            return pose
    return None


@lru_cache(maxsize=4096)
def _lattice(along: int, across: int) -> tuple[FloatArray, FloatArray]:
    u, v = np.meshgrid(np.linspace(0.0, 1.0, along), np.linspace(0.0, 1.0, across))
    return u.reshape(-1, 1), v.reshape(-1, 1)


class _Yard:
    """Which ground is free: a raster, row 0 in the south."""

    def __init__(self, extent_m: tuple[float, float, float, float], keep_clear: Sequence[shapely.Polygon]) -> None:
        west, south, east, north = extent_m
        self._origin_m = np.array([west, south])
        self._size = np.maximum(((east - west) / _CELL_M, (north - south) / _CELL_M), 1.0).astype(np.intp)
        self._taken = np.zeros((self._size[1], self._size[0]), dtype=np.uint8)
        self.extent_m = extent_m
        self.taken_m2 = 0.0
        for area in keep_clear:
            if area.is_empty:  # cv2 refuses an outline without points
                continue
            outline = np.asarray(area.buffer(_MARGIN_M).exterior.coords)
            cv2.fillPoly(self._taken, [self._pixels(outline)], 1, shift=_SHIFT)

    def free_m2(self) -> float:
        """Return the area that nothing has taken yet."""
        return float(np.count_nonzero(self._taken == 0)) * _CELL_M**2

    def free(self, xy_m: FloatArray) -> bool:
        """Return whether a point (2,) lies in the yard and on nothing."""
        column, row = np.floor((xy_m - self._origin_m) / _CELL_M).astype(np.intp).tolist()
        inside = 0 <= column < self._size[0] and 0 <= row < self._size[1]
        return bool(inside and not self._taken[row, column])

    def fits(self, corners_m: FloatArray) -> bool:
        """Return whether a rectangle (4, 2) lies in the yard and on nothing."""
        corners = (corners_m - self._origin_m) / _CELL_M
        if corners.min() < 0.0 or (corners.max(axis=0) >= self._size).any():
            return False
        first, second = corners[1] - corners[0], corners[3] - corners[0]
        fine = int(2.0 * np.sqrt(first @ first)) + 2, int(2.0 * np.sqrt(second @ second)) + 2
        for u, v in (_lattice(4, 3), _lattice(*fine)):
            cells = (corners[0] + u * first + v * second).astype(np.intp)
            if self._taken[cells[:, 1], cells[:, 0]].any():
                return False
        return True

    def somewhere_m(self, rng: np.random.Generator) -> FloatArray:
        """Return (2,) a free place; anywhere when nothing is free."""
        for _ in range(_TRIES):
            xy_m = self._origin_m + rng.uniform(0.0, 1.0, 2) * self._size * _CELL_M
            if self.free(xy_m):
                break
        return np.asarray(xy_m)

    def gaps_m(self, rng: np.random.Generator, count: int) -> tuple[FloatArray, FloatArray]:
        """Return (count, 2) random places and (count,) how far each is from the nearest thing, 0 on things."""
        cells = rng.integers(0, self._size, (count, 2))
        room = cv2.distanceTransform(1 - self._taken, cv2.DIST_L2, 3)
        return self._origin_m + (cells + 0.5) * _CELL_M, room[cells[:, 1], cells[:, 0]].astype(np.float64) * _CELL_M

    def take(self, corners_m: FloatArray) -> None:
        """Mark a rectangle and the margin around it."""
        first, second = corners_m[1] - corners_m[0], corners_m[3] - corners_m[0]
        sides_m = np.linalg.norm(first), np.linalg.norm(second)
        self.taken_m2 += float(sides_m[0] * sides_m[1])
        out = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * _MARGIN_M
        grown = corners_m + out[:, :1] * first / sides_m[0] + out[:, 1:] * second / sides_m[1]
        cv2.fillConvexPoly(self._taken, self._pixels(grown), 1, shift=_SHIFT)

    def _pixels(self, outline_m: FloatArray) -> npt.NDArray[np.int32]:
        cells = (outline_m - self._origin_m) / _CELL_M - 0.5
        fixed: npt.NDArray[np.int32] = np.round(cells * 2**_SHIFT).astype(np.int32)
        return fixed


def _proposals(rng: np.random.Generator, props: Sequence[Prop], yard: _Yard, wanted_m2: float) -> Iterator[_Spot]:
    """Propose spots zone by zone, several times as many as there will be room for."""
    weights = np.array([prop.weight for prop in props])
    radii_m = np.array([prop.radius_m for prop in props])
    chances = weights / weights.sum()
    typical_m2 = float(chances @ radii_m**2) + 1.0
    left = int(_TRIES * wanted_m2 / typical_m2) + 40
    site = _SiteGrid(chances, radii_m, yard, float(rng.uniform(0.0, np.pi)))
    while left > 0:
        zone = _ZONES[int(rng.choice(len(_ZONES), p=_ZONE_SHARES))]
        spots = zone(rng, site)
        left -= len(spots)
        yield from spots


@dataclass(frozen=True, slots=True)
class _SiteGrid:
    """What all zones share: chance and size of each prop, the free ground, the direction of the building."""

    chances: FloatArray
    radii_m: FloatArray
    yard: _Yard
    axis_rad: float

    def choose(self, rng: np.random.Generator, count: int) -> npt.NDArray[np.intp]:
        """Return (count,) props by weight."""
        return rng.choice(len(self.chances), size=count, p=self.chances)


def _store(rng: np.random.Generator, site: _SiteGrid) -> list[_Spot]:
    """Rows of the same things side by side, rows of a few kinds behind each other, parallel to the building."""
    centre_m = site.yard.somewhere_m(rng)
    across_rad = site.axis_rad + (np.pi / 2 if rng.uniform() < 0.5 else 0.0)
    along = np.array([-np.sin(across_rad), np.cos(across_rad)])
    back = np.array([np.cos(across_rad), np.sin(across_rad)])
    spots, depth_m = [], 0.0
    for kind in site.choose(rng, int(rng.integers(2, 5))):
        radius_m = site.radii_m[kind]
        step_m = radius_m * rng.uniform(0.7, 1.3) + 0.5
        for number in range(int(rng.integers(2, 8))):
            jitter_m = rng.normal(0.0, 0.15, 2)
            spot = centre_m + along * (number * step_m + jitter_m[0]) + back * (depth_m + radius_m + jitter_m[1])
            chosen = int(kind) if rng.uniform() < 0.85 else int(site.choose(rng, 1)[0])
            spots.append(_Spot(chosen, spot, across_rad + float(rng.normal(0.0, 0.06))))
        depth_m += 2.0 * radius_m + rng.uniform(0.3, 1.5)
    return spots


def _work(rng: np.random.Generator, site: _SiteGrid) -> list[_Spot]:
    """A crowd of anything around a place of work, most of it square to the building."""
    count = int(rng.integers(8, 26))
    xy = site.yard.somewhere_m(rng) + rng.normal(0.0, rng.uniform(2.0, 6.0), (count, 2))
    turns = site.axis_rad + np.pi / 2 * rng.integers(0, 4, count) + rng.normal(0.0, 0.12, count)
    turns = np.where(rng.uniform(size=count) < 0.3, rng.uniform(0.0, 2 * np.pi, count), turns)
    return _spots(site.choose(rng, count), xy, turns)


def _along_fence(rng: np.random.Generator, site: _SiteGrid) -> list[_Spot]:
    """Things put away along one side of the area."""
    west, south, east, north = site.yard.extent_m
    count, inset_m = int(rng.integers(5, 15)), 0.5 + rng.uniform(0.0, 1.5)
    kinds = site.choose(rng, count)
    inset = inset_m + site.radii_m[kinds]
    side = int(rng.integers(4))
    run = rng.uniform((south, west)[side % 2], (north, east)[side % 2], count)
    offset = (west + inset, south + inset, east - inset, north - inset)[side]
    xy = np.column_stack([offset, run] if side % 2 == 0 else [run, offset])
    turns = np.full(count, np.pi / 2 if side % 2 == 0 else 0.0) + rng.normal(0.0, 0.1, count)
    return _spots(kinds, xy, turns)


def _gaps(rng: np.random.Generator, site: _SiteGrid) -> list[_Spot]:
    """Things left in gaps that they just fit into, in any direction."""
    count = int(rng.integers(15, 35))
    xy, clearance_m = site.yard.gaps_m(rng, count)
    chances = np.where(site.radii_m <= _TIGHT * clearance_m[:, None], site.chances, 0.0).cumsum(axis=1)
    fits = chances[:, -1] > 0.0
    drawn = rng.uniform(0.0, 1.0, count)[:, None] * chances[:, -1:]
    kinds = (chances <= drawn).sum(axis=1)
    turns = np.where(rng.uniform(size=count) < 0.5, rng.uniform(0.0, 2 * np.pi, count), site.axis_rad)
    return _spots(kinds[fits], xy[fits], turns[fits])


def _spots(props: npt.NDArray[np.intp], xy_m: FloatArray, turns_rad: FloatArray) -> list[_Spot]:
    return [_Spot(int(prop), xy, float(turn)) for prop, xy, turn in zip(props, xy_m, turns_rad, strict=True)]


_ZONES = (_store, _work, _along_fence, _gaps)


@lru_cache(maxsize=4096)
def _box(mesh: Mesh) -> FloatArray:
    """Return (8, 4) homogeneous corners of a mesh's bounding box, local frame."""
    ends = np.stack([mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)]).astype(np.float64)
    pick = np.indices((2, 2, 2)).reshape(3, 8).T
    return np.column_stack([ends[pick, np.arange(3)], np.ones(8)])


def _bounds(batches: Sequence[Batch]) -> tuple[FloatArray, FloatArray, float]:
    """Return least and greatest (2,) x and y of all instances, and the highest point."""
    corners = np.concatenate(
        [(_box(batch.mesh) @ batch.poses[:, :3].transpose(0, 2, 1)).reshape(-1, 3) for batch in batches]
    )
    low, high = corners.min(axis=0), corners.max(axis=0)
    return low[:2], high[:2], float(high[2])


def _turned(local_m: FloatArray, spot: _Spot) -> FloatArray:
    return rotated_xy(local_m, spot.turn_rad) + spot.xy_m


def _stand(spot: _Spot, corners_m: FloatArray, top_m: float, ground: GroundSurface) -> FloatArray | None:
    """Return the pose on the ground, or None where it is too steep or too rough.

    Low things take the slope under them, tall ones stand upright; both sink in until no part hangs visibly over.
    """
    u, v = _lattice(3, 3)
    first, second = corners_m[1] - corners_m[0], corners_m[3] - corners_m[0]
    offset = corners_m[0] + u * first + v * second - spot.xy_m
    height_m = ground.height_at(offset + spot.xy_m)
    # the least-squares plane over a symmetric lattice: along each side alone
    tilt = first * (height_m @ (u - 0.5)) / (first @ first) + second * (height_m @ (v - 0.5)) / (second @ second)
    tilt /= float(((u - 0.5) ** 2).sum())
    slope = np.array([0.0, 0.0]) if top_m > _TALL_M else tilt
    below = height_m - offset @ slope
    if tilt @ tilt > _STEEPEST**2 or np.ptp(below) > _ROUGHEST_M:
        return None
    up = np.array([-slope[0], -slope[1], 1.0]) / np.sqrt(1.0 + slope @ slope)
    forward = np.array([np.cos(spot.turn_rad), np.sin(spot.turn_rad), 0.0])
    forward -= up * (forward @ up)
    forward /= np.linalg.norm(forward)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = forward, np.cross(up, forward), up
    pose[:3, 3] = *spot.xy_m, min(float(np.median(below)), float(below.min()) + _GAP_M)
    return pose


def _merged(pieces: Sequence[tuple[Batch, FloatArray]]) -> tuple[Batch, ...]:
    """Return one batch for each mesh: every batch is a draw call."""
    groups: dict[int, list[tuple[Batch, FloatArray]]] = {}
    for batch, pose in pieces:
        groups.setdefault(id(batch.mesh), []).append((batch, pose))
    return tuple(
        replace(
            group[0][0],
            poses=np.concatenate([pose @ batch.poses for batch, pose in group]).astype(np.float32),
            tint=np.concatenate([batch.tint for batch, _ in group]),
            dust=np.concatenate([batch.dust for batch, _ in group]),
        )
        for group in groups.values()
    )
