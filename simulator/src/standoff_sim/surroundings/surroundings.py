"""What lies beyond the site: streets with parked cars, buildings, trees, fields, skyline; and what shades it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
import numpy.typing as npt
import shapely
from shapely import affinity

from standoff.core.homography import FloatArray
from standoff_sim.ground.terrain import Terrain
from standoff_sim.props.materials import aged
from standoff_sim.scene.scene import NOTHING, PARKED, Batch, place
from standoff_sim.solids.mesh import Colour, Mesh, Surface, rotation, scaling, srgb, translation
from standoff_sim.surroundings.buildings import COTTAGES, FLATS, SHEDS, WALLS, House, building, scaffolding
from standoff_sim.surroundings.outskirts import CAR_VARIANTS, STREET_VARIANTS, lay_land, lay_street, parked_car
from standoff_sim.surroundings.vegetation import (
    BUSH_VARIANTS,
    FAR_VARIANTS,
    GREENS,
    TREE_VARIANTS,
    bush,
    far_tree,
    tree,
)

REACH_M = 400.0
_STREET_M = 8.0
_CARS = tuple(
    srgb(code) for code in ("#2c2c2e", "#77787b", "#bdbec0", "#dcdcda", "#7a2022", "#2c4770", "#c0bcae", "#5a655a")
)


class Setting(StrEnum):
    """Where the site is."""

    CITY = "city"
    SUBURB = "suburb"
    INDUSTRY = "industry"
    COUNTRY = "country"


@dataclass(slots=True)
class _Town:
    """Things placed so far, by mesh, and the ground that they take."""

    rng: np.random.Generator
    terrain: Terrain
    taken: list[shapely.Geometry] = field(default_factory=list)
    poses: dict[Mesh, list[FloatArray]] = field(default_factory=dict)
    tints: dict[Mesh, list[FloatArray]] = field(default_factory=dict)
    ids: dict[Mesh, int] = field(default_factory=dict)

    def put(self, mesh: Mesh, at_m: FloatArray, turn_deg: float, stretch: FloatArray, tint: FloatArray) -> None:
        """Stand a mesh on the ground."""
        height_m = float(self.terrain.height_at(at_m[None])[0])
        pose = translation(float(at_m[0]), float(at_m[1]), height_m) @ rotation("z", turn_deg) @ scaling(*stretch)
        self.poses.setdefault(mesh, []).append(pose)
        self.tints.setdefault(mesh, []).append(tint)

    def free(self, outline: shapely.Geometry) -> bool:
        """Take an outline if nothing is there yet."""
        if np.any(shapely.intersects(outline, np.array(self.taken))):
            return False
        self.taken.append(outline)
        return True

    def batches(self) -> tuple[Batch, ...]:
        """Return everything placed, one batch for each mesh."""
        return tuple(
            place(
                mesh, np.stack(poses), tint=np.stack(self.tints[mesh]), dust=0.25, entity_id=self.ids.get(mesh, NOTHING)
            )
            for mesh, poses in self.poses.items()
        )


@dataclass(frozen=True, slots=True)
class _Side:
    """One side of the site: along it and away from it.

    Attributes:
        index: 0 south, 1 east, 2 north, 3 west.
        half_m: Of the site: along the side, and from its middle to the side.
    """

    index: int
    half_m: tuple[float, float]

    @property
    def turn_deg(self) -> float:
        """Turn a thing so that its front (local -y) faces the site."""
        return 90.0 * self.index + 180.0

    def at(self, along_m: float, away_m: float) -> FloatArray:
        """Return (2,) a place beyond the side, from its middle to its left seen from outside."""
        turn = np.deg2rad(self.turn_deg)
        ahead, outwards = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        place_m: FloatArray = along_m * ahead + (self.half_m[1] + away_m) * outwards
        return place_m


@dataclass(frozen=True, slots=True)
class _Character:
    """What makes a setting.

    Attributes:
        land: Tones of the open land.
        surface: Of the open land.
        houses: Kinds of buildings in the rows near the site.
        built: Chance of a building at each place of a row.
        rows: Distances of the rows of buildings from the site's border.
        streets: Chance of a street along each side.
        trees: Number of scattered trees near, and far away.
        towers: Number of tall buildings far away.
    """

    land: tuple[str, ...]
    surface: Surface
    houses: tuple[House, ...]
    built: float
    rows: tuple[float, ...]
    streets: float
    trees: tuple[int, int]
    towers: int


_PAVED = ("#7d7a74", "#8d897f", "#6f7257", "#5f6b45", "#99927f")
_GREEN = ("#5d6a41", "#77804f", "#8b8459", "#a2966d", "#4f5f39", "#8a7a5f")
_CHARACTERS = {
    Setting.CITY: _Character(_PAVED, Surface.CONCRETE, FLATS, 0.9, (24.0, 62.0, 105.0, 160.0), 0.85, (25, 120), 12),
    Setting.SUBURB: _Character(_GREEN, Surface.FOLIAGE, COTTAGES, 0.75, (24.0, 52.0, 90.0), 0.7, (28, 140), 4),
    Setting.INDUSTRY: _Character(_PAVED, Surface.CONCRETE, SHEDS, 0.7, (30.0, 95.0, 170.0), 0.6, (20, 150), 3),
    Setting.COUNTRY: _Character(_GREEN, Surface.FOLIAGE, (*COTTAGES, SHEDS[2]), 0.08, (40.0, 120.0), 0.4, (32, 170), 0),
}


def make_surroundings(
    rng: np.random.Generator, terrain: Terrain, *, setting: Setting | None = None,
    shade_to_sun: FloatArray | None = None,
) -> tuple[Batch, ...]:  # fmt: skip
    """Build what lies between the site's border and the haze.

    Args:
        rng: Source of chance.
        terrain: Of the site; its border is at height 0.
        setting: Where the site is; None draws one.
        shade_to_sun: (3,) direction to the sun, if a tall building shall throw part of the site into shade.

    Returns:
        Batches without entity ids but for cars (`PARKED`), under 120 000 triangles in all.
    """
    settings = list(Setting)
    setting = setting or settings[int(rng.choice(len(settings), p=[0.35, 0.25, 0.2, 0.2]))]
    character = _CHARACTERS[setting]
    half = np.array(terrain.size_m) / 2
    town = _Town(rng, terrain, [shapely.box(*(-half - 1.0), *(half + 1.0))])
    sides = [_Side(i, (float(half[i % 2]), float(half[1 - i % 2]))) for i in range(4)]
    if shade_to_sun is not None:
        _shade(town, sides, np.asarray(shade_to_sun, dtype=np.float64))
    blocked = np.array(town.taken)
    for side in sides:
        if rng.random() < character.streets:
            _line_street(town, side, float(rng.uniform(7.0, 14.0)), blocked)
    for side in sides:
        for row, away_m in enumerate(character.rows):
            _line_houses(town, side, character, away_m, detailed=row == 0)
    for _ in range(character.towers):
        _raise_tower(town, sides[int(rng.integers(4))])
    for side in sides:
        if rng.random() < 0.5:
            _overgrow(town, side)
    _plant(town, tree, TREE_VARIANTS, character.trees[0], (4.0, 70.0))
    _plant(town, far_tree, FAR_VARIANTS, character.trees[1], (70.0, 0.9 * REACH_M))
    land = lay_land(rng, terrain.size_m, REACH_M, character.land, character.surface)
    return (place(land, np.eye(4), dust=0.0), *town.batches())


def _outline(centre_m: FloatArray, size_m: tuple[float, float], turn_deg: float) -> shapely.Geometry:
    flat = shapely.box(-size_m[0] / 2, -size_m[1] / 2, size_m[0] / 2, size_m[1] / 2)
    return affinity.translate(affinity.rotate(flat, turn_deg, origin=(0.0, 0.0)), *centre_m)


def _shade(town: _Town, sides: Sequence[_Side], to_sun: FloatArray) -> None:
    """Stand a tall building, sometimes scaffolded, towards the sun, so high that its shade crosses part of the site."""
    rng = town.rng
    outwards = [side.at(0.0, 1.0) - side.at(0.0, 0.0) for side in sides]
    side = sides[int(np.argmax([direction @ to_sun[:2] for direction in outwards]))]
    slope = to_sun[2] / max(float(np.hypot(*to_sun[:2])), 1e-3)
    shade_m = rng.uniform(0.3, 1.2) * side.half_m[1] + 12.0
    floors = 2 * int(np.clip(round(shade_m * slope / 6.0), 2, 12))
    house = House((int(rng.choice([10, 14, 18])), 5), floors)
    length_m, depth_m, height_m = house.size_m
    centre = side.at(float(rng.uniform(-0.5, 0.5)) * side.half_m[0], 5.0 + depth_m / 2)
    if not town.free(_outline(centre, (length_m, depth_m + 2.0), side.turn_deg)):
        return
    wall = np.array(WALLS[int(rng.integers(len(WALLS)))])
    town.put(building(house), centre, side.turn_deg, np.ones(3), wall)
    if rng.random() < 0.5:
        front = centre + (depth_m / 2) * (side.at(0.0, 0.0) - side.at(0.0, 1.0))
        net = np.array(srgb(("#3f6f58", "#c9c9c4", "#4f6f97", "#8a8f8c")[int(rng.integers(4))]))
        mesh = scaffolding(int(length_m), min(int(height_m), 40))
        town.put(mesh, front, side.turn_deg, np.ones(3), net)


def _line_street(town: _Town, side: _Side, away_m: float, blocked: npt.NDArray[np.object_]) -> None:
    """Run a street along a side and far beyond, unless blocked, with parked cars and a row of trees."""
    rng = town.rng
    centre = side.at(0.0, away_m)
    outline = _outline(centre, (2.2 * REACH_M, _STREET_M + 5.0), side.turn_deg)
    if np.any(shapely.intersects(outline, blocked)):
        return
    town.taken.append(outline)
    street = lay_street(2.0 * REACH_M, _STREET_M, int(rng.integers(STREET_VARIANTS)))
    # Streets cross: none may lie in the plane of another.
    town.put(street, centre, side.turn_deg, np.array([1.0, 1.0, 1.0 + 0.25 * side.index]), np.ones(3))
    busy = rng.uniform(0.1, 0.8)
    for along_m in np.arange(-150.0, 150.0, 5.8):
        for lane_m in (-3.0, 3.0):
            if rng.random() < busy:
                paint = np.array(_CARS[int(rng.integers(len(_CARS)))])
                at_m = side.at(float(along_m + rng.uniform(-0.4, 0.4)), away_m + lane_m + float(rng.normal(0.0, 0.08)))
                turn_deg = side.turn_deg + (180.0 if lane_m > 0 else 0.0) + float(rng.normal(0.0, 1.0))
                car = parked_car(int(rng.integers(CAR_VARIANTS)))
                town.put(car, at_m, turn_deg, np.ones(3), paint)
                town.ids[car] = PARKED
    if rng.random() < 0.6:
        for along_m in np.arange(-130.0, 130.0, rng.uniform(9.0, 16.0)):
            if rng.random() < 0.75:
                near = abs(along_m) < side.half_m[0]
                plant = tree(int(rng.integers(TREE_VARIANTS))) if near else far_tree(int(rng.integers(FAR_VARIANTS)))
                _stand(town, plant, side.at(float(along_m), away_m + 6.0), 0.75)


def _line_houses(town: _Town, side: _Side, character: _Character, away_m: float, *, detailed: bool) -> None:
    """Stand buildings side by side, fronts to the site."""
    rng = town.rng
    along_m = -side.half_m[0] - away_m
    while along_m < side.half_m[0] + away_m:
        house = character.houses[int(rng.integers(len(character.houses)))]
        length_m, depth_m, _ = house.size_m
        if rng.random() < character.built:
            centre = side.at(along_m + length_m / 2, away_m + depth_m / 2 + float(rng.normal(0.0, 1.0)))
            if town.free(_outline(centre, (length_m + 1.0, depth_m + 4.0), side.turn_deg)):
                stretch = np.array([1.0, 1.0, rng.uniform(0.85, 1.2)])
                mesh = building(house if detailed else replace(house, detailed=False), int(rng.integers(2)))
                town.put(mesh, centre, side.turn_deg, stretch, _vary(rng, WALLS))
        along_m += length_m + float(rng.choice([0.3, 4.0, 14.0]))


def _raise_tower(town: _Town, side: _Side) -> None:
    """Stand a tall building on the skyline."""
    rng = town.rng
    house = House((int(rng.choice([5, 8])), 5), int(rng.choice([10, 14, 18])), detailed=False)
    centre = side.at(float(rng.uniform(-220.0, 220.0)), float(rng.uniform(120.0, 300.0)))
    if town.free(_outline(centre, (house.size_m[0] + 4.0, house.size_m[1] + 4.0), side.turn_deg)):
        town.put(building(house), centre, side.turn_deg, np.array([1.0, 1.0, rng.uniform(0.8, 1.3)]), _vary(rng, WALLS))


def _overgrow(town: _Town, side: _Side) -> None:
    """Let bushes and trees stand in clusters along the site's own border."""
    rng = town.rng
    for _ in range(int(rng.integers(2, 6))):
        middle_m = float(rng.uniform(-1.0, 1.0)) * side.half_m[0]
        for _ in range(int(rng.integers(4, 16))):
            at_m = side.at(middle_m + float(rng.normal(0.0, 6.0)), float(rng.uniform(-4.0, 3.0)))
            _stand(town, bush(int(rng.integers(BUSH_VARIANTS))), at_m, 0.9)
        if rng.random() < 0.5:
            _stand(town, tree(int(rng.integers(TREE_VARIANTS))), side.at(middle_m, float(rng.uniform(-2.0, 3.0))), 0.8)


def _plant(town: _Town, mesh_of: Callable[[int], Mesh], variants: int, count: int, away_m: tuple[float, float]) -> None:
    """Scatter trees in clumps outside the site, where nothing else is."""
    rng = town.rng
    half = np.array(town.terrain.size_m) / 2
    taken = np.array(town.taken)
    clumps = rng.uniform(-half - away_m[1], half + away_m[1], (max(count // 5, 1) * 3, 2))
    beyond_m = np.max(np.abs(clumps) - half, axis=1)
    clumps = clumps[beyond_m > away_m[0]][: max(count // 5, 1)]
    for clump in clumps:
        for at_m in clump + rng.normal(0.0, 5.0, (5, 2)):
            if not np.any(shapely.intersects(shapely.Point(at_m).buffer(2.0), taken)):
                _stand(town, mesh_of(int(rng.integers(variants))), at_m, 1.0)


def _stand(town: _Town, plant: Mesh, at_m: FloatArray, size: float) -> None:
    rng = town.rng
    stretch = size * rng.uniform(0.65, 1.35) * rng.uniform(0.88, 1.12, 3)
    town.put(plant, at_m, float(rng.uniform(0.0, 360.0)), stretch, _vary(rng, GREENS))


def _vary(rng: np.random.Generator, tints: Sequence[Colour]) -> FloatArray:
    """Return one of the tints, a little lighter or darker."""
    (tint,) = aged(rng, tints, (0.8, 1.15))
    return np.asarray(tint)
