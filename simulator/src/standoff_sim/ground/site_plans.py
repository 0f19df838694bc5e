"""Plausible grounds for each kind of site: where its pits, slabs, heaps, roads and tracks are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
import shapely
from shapely import affinity

from standoff.core.homography import FloatArray
from standoff_sim.ground.terrain_plan import FlatPatch, Heap, Path, Pit, Slab, Soil, TerrainPlan

_MARGIN_M = 6.0
_KEPT_MARGIN_M = 1.0
_TRIES = 12


class SiteStyle(StrEnum):
    """What is being built."""

    EARTHWORKS = "earthworks"
    FOUNDATIONS = "foundations"
    STRUCTURE = "structure"
    ROAD = "road"
    YARD = "yard"


@dataclass(slots=True)
class _Sketch:
    """A plan in the making, and the ground that is taken already."""

    rng: np.random.Generator
    half_m: FloatArray
    taken: shapely.Geometry
    pits: list[Pit] = field(default_factory=list)
    heaps: list[Heap] = field(default_factory=list)
    slabs: list[Slab] = field(default_factory=list)
    roads: list[Path] = field(default_factory=list)
    ruts: list[Path] = field(default_factory=list)
    tracks: list[Path] = field(default_factory=list)

    def claim(self, outline: shapely.Polygon, margin_m: float) -> bool:
        """Take ground if all of it is free and on the site."""
        bounds = np.abs(np.array(outline.bounds)).reshape(2, 2).max(axis=0)
        if np.any(bounds > self.half_m - _MARGIN_M) or outline.intersects(self.taken):
            return False
        self.taken = self.taken.union(outline.buffer(margin_m))
        return True

    def spot(self) -> FloatArray:
        """Return a place on the site."""
        return self.rng.uniform(-self.half_m + _MARGIN_M, self.half_m - _MARGIN_M)


def random_plan(
    rng: np.random.Generator, style: SiteStyle | None = None, *, patches: Sequence[FlatPatch] = (),
    ways: Sequence[shapely.Geometry] = (), extent_m: tuple[float, float] = (120.0, 120.0),
) -> TerrainPlan:  # fmt: skip
    """Draw a ground for a kind of site.

    Args:
        rng: Source of chance.
        style: Of the site; None draws one.
        patches: Level ground that the plan shall have; nothing is dug, heaped or cast on it.
        ways: Where machines and people go; nothing is dug, heaped or cast there either.
        extent_m: East-west and north-south size.
    """
    styles = list(SiteStyle)
    style = style or styles[int(rng.choice(len(styles), p=[0.28, 0.24, 0.2, 0.14, 0.14]))]
    kept = [shapely.Point(patch.centre_m).buffer(patch.radius_m + _KEPT_MARGIN_M) for patch in patches]
    kept += [way.buffer(_KEPT_MARGIN_M) for way in ways]
    sketch = _Sketch(rng, np.array(extent_m) / 2, shapely.union_all(kept))
    # Most sites lie along their streets; along the height samples, too, walls of pits are straight.
    turn_deg = float(rng.uniform(0.0, 90.0)) if rng.random() < 0.2 else 0.0
    draw = {
        SiteStyle.EARTHWORKS: _earthworks,
        SiteStyle.FOUNDATIONS: _foundations,
        SiteStyle.STRUCTURE: _structure,
        SiteStyle.ROAD: _road,
        SiteStyle.YARD: _yard,
    }[style]
    plan = draw(sketch, turn_deg)
    _drive(sketch, int(rng.integers(18, 40)), 0.0 if style is SiteStyle.YARD else 0.16)
    moisture = float(rng.beta(1.6, 2.2))
    return replace(
        plan,
        extent_m=extent_m,
        moisture=moisture,
        puddles=float(np.clip(rng.normal(0.018 * moisture, 0.008), 0.0, 0.05)),
        patches=tuple(patches),
        pits=tuple(sketch.pits),
        heaps=tuple(sketch.heaps),
        slabs=tuple(sketch.slabs),
        roads=tuple(sketch.roads),
        ruts=tuple(sketch.ruts),
        tracks=tuple(sketch.tracks),
    )


def _earthworks(sketch: _Sketch, turn_deg: float) -> TerrainPlan:
    rng = sketch.rng
    _haul(sketch, int(rng.integers(1, 3)))
    for _ in range(int(rng.integers(0, 3))):
        _excavate(sketch, rng.uniform(9.0, 24.0), rng.uniform(0.8, 3.5))
    if rng.random() < 0.4:
        _trench(sketch, turn_deg)
    _tip_heaps(sketch, int(rng.integers(4, 13)))
    return TerrainPlan(
        soil=_draw_soil(rng),
        relief_m=float(rng.uniform(0.06, 0.22)),
        roughness=float(rng.uniform(0.3, 1.0)),
        grass=float(rng.uniform(0.0, 0.8)),
        road_width_m=float(rng.uniform(4.5, 8.0)),
    )


def _foundations(sketch: _Sketch, turn_deg: float) -> TerrainPlan:
    """Lay out a grid of footings with trenches between some of them."""
    rng = sketch.rng
    pitch_m, side_m = rng.uniform(5.0, 8.5, 2), rng.uniform(1.8, 3.4)
    rows, columns = rng.integers(3, 8, 2)
    middle, depth_m = rng.uniform(-0.3, 0.3, 2) * sketch.half_m, float(rng.uniform(0.5, 1.6))
    for row in range(rows):
        for column in range(columns):
            at = (np.array([column, row]) - np.array([columns - 1, rows - 1]) / 2) * pitch_m
            footing = shapely.box(-side_m / 2, -side_m / 2, side_m / 2, side_m / 2)
            if rng.random() < 0.35 and column + 1 < columns:
                footing = footing.union(shapely.box(0.0, -0.45, pitch_m[0] - side_m / 2 - 0.5, 0.45))
            placed = affinity.rotate(affinity.translate(footing, *at), turn_deg, origin=(0.0, 0.0))
            placed = affinity.translate(placed, *middle)
            if rng.random() < 0.85 and sketch.claim(placed, 0.3):
                sketch.pits.append(Pit(_corners(placed), depth_m * float(rng.uniform(0.85, 1.1))))
    _haul(sketch, 1)
    _tip_heaps(sketch, int(rng.integers(3, 9)))
    return TerrainPlan(
        soil=_draw_soil(rng),
        relief_m=float(rng.uniform(0.03, 0.12)),
        roughness=float(rng.uniform(0.2, 0.8)),
        grass=float(rng.uniform(0.0, 0.5)),
    )


def _structure(sketch: _Sketch, turn_deg: float) -> TerrainPlan:
    """Cast large slabs, beside pits with vertical walls."""
    rng = sketch.rng
    for _ in range(int(rng.integers(1, 4))):
        _cast_slab(sketch, rng.uniform(12.0, 34.0, 2), turn_deg, float(rng.uniform(0.05, 0.5)))
    for _ in range(int(rng.integers(1, 3))):
        _dig_square(sketch, rng.uniform(7.0, 20.0, 2), turn_deg)
    if rng.random() < 0.6:
        _trench(sketch, turn_deg)
    _haul(sketch, 1)
    _tip_heaps(sketch, int(rng.integers(2, 7)))
    return TerrainPlan(
        soil=_draw_soil(rng),
        relief_m=float(rng.uniform(0.03, 0.1)),
        roughness=float(rng.uniform(0.2, 0.7)),
        grass=float(rng.uniform(0.0, 0.3)),
    )


def _road(sketch: _Sketch, turn_deg: float) -> TerrainPlan:
    """Run a wide gravel formation across the site, a trench and heaps along it."""
    rng = sketch.rng
    reach_m = float(np.hypot(*sketch.half_m))
    line = np.array([[x, 6.0 * np.sin(x / 40.0)] for x in np.linspace(-reach_m, reach_m, 24)])
    line += np.array([0.0, rng.uniform(-8.0, 8.0)])
    spin = np.deg2rad(turn_deg)
    line = line @ np.array([[np.cos(spin), np.sin(spin)], [-np.sin(spin), np.cos(spin)]])
    sketch.roads.append(_path(line))
    for shift_m in rng.uniform(-4.0, 4.0, 5):
        sketch.tracks.append(_path(line + np.array([0.0, shift_m])))
    width_m = float(rng.uniform(8.0, 14.0))
    sketch.taken = sketch.taken.union(shapely.LineString(line).buffer(width_m / 2))
    _trench(sketch, turn_deg)
    _tip_heaps(sketch, int(rng.integers(4, 10)))
    return TerrainPlan(
        soil=Soil(rng.choice([Soil.GREY_GRAVEL, Soil.OCHRE_SAND, Soil.BROWN_EARTH, Soil.RED_CLAY])),
        relief_m=float(rng.uniform(0.08, 0.25)),
        roughness=float(rng.uniform(0.2, 0.6)),
        grass=float(rng.uniform(0.2, 0.9)),
        road_width_m=width_m,
    )


def _yard(sketch: _Sketch, turn_deg: float) -> TerrainPlan:
    rng = sketch.rng
    for _ in range(int(rng.integers(2, 6))):
        _cast_slab(sketch, rng.uniform(6.0, 26.0, 2), turn_deg, 0.03)
    _tip_heaps(sketch, int(rng.integers(1, 6)))
    return TerrainPlan(
        soil=Soil(rng.choice([Soil.CONCRETE, Soil.GREY_GRAVEL, Soil.CONCRETE, Soil.OCHRE_SAND])),
        relief_m=float(rng.uniform(0.02, 0.06)),
        roughness=float(rng.uniform(0.0, 0.3)),
        grass=float(rng.uniform(0.0, 0.5)),
    )


def _draw_soil(rng: np.random.Generator) -> Soil:
    soils = (Soil.BROWN_EARTH, Soil.OCHRE_SAND, Soil.GREY_GRAVEL, Soil.RED_CLAY, Soil.WET_MUD, Soil.MIXED)
    return soils[int(rng.choice(len(soils), p=[0.26, 0.28, 0.18, 0.08, 0.05, 0.15]))]


def _corners(outline: shapely.Polygon) -> Path:
    return _path(np.array(outline.exterior.coords)[:-1])


def _path(points_m: FloatArray) -> Path:
    return tuple((float(x), float(y)) for x, y in points_m)


def _excavate(sketch: _Sketch, radius_m: float, depth_m: float) -> None:
    """Dig an irregular pit with a deeper part inside."""
    rng = sketch.rng
    for _ in range(_TRIES):
        angles = np.linspace(0.0, 2 * np.pi, 9, endpoint=False) + rng.uniform(0.0, 2 * np.pi)
        radii = radius_m * rng.uniform(0.75, 1.0, 9)
        outline = shapely.Polygon(sketch.spot() + radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)]))
        if sketch.claim(outline, 1.5):
            sketch.pits.append(Pit(_corners(outline), float(depth_m) / 2))
            inner = affinity.scale(outline, 0.72, 0.72, origin=outline.exterior.coords[0])
            sketch.pits.append(Pit(_corners(affinity.scale(inner, 0.93, 0.93)), float(depth_m) / 2))
            return


def _dig_square(sketch: _Sketch, size_m: FloatArray, turn_deg: float) -> None:
    """Dig a pit for a cellar: right angles, vertical walls."""
    rng = sketch.rng
    for _ in range(_TRIES):
        outline = affinity.translate(affinity.rotate(shapely.box(0.0, 0.0, *size_m), turn_deg), *sketch.spot())
        if sketch.claim(outline, 1.5):
            sketch.pits.append(Pit(_corners(outline), float(rng.uniform(1.5, 4.0))))
            return


def _trench(sketch: _Sketch, turn_deg: float) -> None:
    rng = sketch.rng
    for _ in range(_TRIES):
        length_m, width_m = rng.uniform(12.0, 50.0), rng.uniform(0.9, 2.0)
        outline = affinity.rotate(
            shapely.box(-length_m / 2, -width_m / 2, length_m / 2, width_m / 2), turn_deg + 90 * rng.integers(2)
        )
        outline = affinity.translate(outline, *sketch.spot())
        if sketch.claim(outline, 1.0):
            sketch.pits.append(Pit(_corners(outline), float(rng.uniform(0.8, 2.2))))
            return


def _cast_slab(sketch: _Sketch, size_m: FloatArray, turn_deg: float, rise_m: float) -> None:
    rng = sketch.rng
    for _ in range(_TRIES):
        outline = affinity.rotate(shapely.box(*(-size_m / 2), *(size_m / 2)), turn_deg)
        outline = affinity.translate(outline, *sketch.spot())
        if sketch.claim(outline, 0.5):
            joint_m = float(rng.choice([0.0, 3.0, 5.0, 6.0]))
            sketch.slabs.append(Slab(_corners(outline), rise_m, joint_m, float(rng.beta(2.0, 2.5))))
            return


def _tip_heaps(sketch: _Sketch, count: int) -> None:
    """Tip heaps, some alone and some in rows, some of another material."""
    rng = sketch.rng
    materials = (None, None, Soil.OCHRE_SAND, Soil.GREY_GRAVEL, Soil.BROWN_EARTH, Soil.RED_CLAY)
    while count > 0:
        row = min(count, int(rng.choice([1, 1, 2, 4])))
        count -= row
        radius_m = float(rng.uniform(1.6, 6.0))
        soil = materials[int(rng.integers(len(materials)))]
        start, step = sketch.spot(), rng.normal(size=2)
        step *= 1.35 * radius_m / np.linalg.norm(step)
        for load in range(row):
            centre = start + load * step
            if sketch.claim(shapely.Point(centre).buffer(radius_m), -0.3 * radius_m):
                height_m = radius_m * float(rng.uniform(0.35, 0.62))
                sketch.heaps.append(Heap((float(centre[0]), float(centre[1])), radius_m, height_m, soil))


def _haul(sketch: _Sketch, count: int) -> None:
    """Lead roads from the border across the site, around what is taken as far as chance finds a way."""
    rng = sketch.rng
    for _ in range(count):
        best: tuple[float, FloatArray] | None = None
        for _ in range(_TRIES):
            turn = rng.uniform(0.0, 2 * np.pi)
            ends = np.array([[np.cos(turn), np.sin(turn)], [-np.cos(turn), -np.sin(turn)]]) * sketch.half_m
            line = _bend(rng, ends, 14.0)
            crossed = float(shapely.LineString(line).buffer(3.0).intersection(sketch.taken).area)
            if best is None or crossed < best[0]:
                best = crossed, line
        if best is not None and best[0] < 60.0:
            sketch.roads.append(_path(best[1]))
            sketch.taken = sketch.taken.union(shapely.LineString(best[1]).buffer(3.0))


def _bend(rng: np.random.Generator, ends_m: FloatArray, sway_m: float) -> FloatArray:
    """Return 16 points of a gentle S between two ends."""
    at = np.linspace(0.0, 1.0, 16)[:, None]
    ahead = ends_m[1] - ends_m[0]
    side = np.array([-ahead[1], ahead[0]]) / np.linalg.norm(ahead)
    sway = rng.normal(0.0, sway_m) * np.sin(np.pi * at) + rng.normal(0.0, sway_m / 2) * np.sin(2 * np.pi * at)
    line: FloatArray = ends_m[0] + at * ahead + sway * side
    return line


def _drive(sketch: _Sketch, count: int, rutted: float) -> None:
    """Leave tracks between places of the site, some of them as deep ruts, none through a pit."""
    rng = sketch.rng
    dug = shapely.union_all([shapely.Polygon(pit.outline_m).buffer(1.5) for pit in sketch.pits])
    heaped = shapely.union_all([shapely.Point(heap.centre_m).buffer(heap.radius_m) for heap in sketch.heaps])
    kept = shapely.union_all([dug, heaped])
    for _ in range(count):
        line = _bend(rng, np.stack([1.3 * sketch.spot(), sketch.spot()]), 5.0)
        if shapely.LineString(line).intersects(kept):
            continue
        (sketch.ruts if rng.random() < rutted else sketch.tracks).append(_path(line))
