"""What the ground of a site shall be like: soil, relief, pits, heaps, slabs, roads and tracks, as plain numbers.

All positions are in the site frame, metres; the terrain is centred on its origin.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import shapely

Point = tuple[float, float]
Path = tuple[Point, ...]

_EXTENT_M = (20.0, 400.0)
_CELLS = 1600
_STEEPEST_HEAP = 0.9
"""Height over radius: loose material does not stand steeper than about 42 degrees."""


class Soil(StrEnum):
    """What the open ground consists of."""

    BROWN_EARTH = "brown earth"
    RED_CLAY = "red clay"
    GREY_GRAVEL = "grey gravel"
    OCHRE_SAND = "pale ochre sand"
    WET_MUD = "dark wet mud"
    CONCRETE = "concrete yard"
    MIXED = "mixed"


@dataclass(frozen=True, slots=True)
class FlatPatch:
    """Ground that is level: under the reference object, or where machines work.

    Attributes:
        centre_m: Of the circle.
        radius_m: Level up to here; blends into the relief beyond.
        height_m: Of the level; None takes the mean of the relief there.
        firmness: 1 exactly level, 0.5 half of the relief is left.
    """

    centre_m: Point
    radius_m: float
    height_m: float | None = None
    firmness: float = 1.0


@dataclass(frozen=True, slots=True)
class Pit:
    """An excavation with steep walls.

    Attributes:
        outline_m: Polygon of its upper edge.
        depth_m: Of the floor below the ground around it.
    """

    outline_m: Path
    depth_m: float


@dataclass(frozen=True, slots=True)
class Heap:
    """Spoil, sand or gravel tipped on the ground.

    Attributes:
        centre_m: Of its foot.
        radius_m: Of its foot.
        height_m: Of its top above the ground.
        soil: What it consists of; None is the same as the ground.
    """

    centre_m: Point
    radius_m: float
    height_m: float
    soil: Soil | None = None


@dataclass(frozen=True, slots=True)
class Slab:
    """Concrete on the ground.

    Attributes:
        outline_m: Polygon.
        rise_m: Of its top above the mean ground below it.
        joint_m: Distance of joints; 0 has none.
        dirt: 0 freshly cast .. 1 hardly recognisable under soil.
    """

    outline_m: Path
    rise_m: float = 0.1
    joint_m: float = 5.0
    dirt: float = 0.4


@dataclass(frozen=True, slots=True)
class TerrainPlan:
    """Everything that decides the ground, before chance fills in the detail.

    Attributes:
        extent_m: East-west and north-south size.
        cell_m: Distance of height samples.
        soil: Of the open ground.
        relief_m: Standard deviation of the gentle 1/f relief.
        roughness: 0 rolled .. 1 freshly dug, for relief below about 3 m of length.
        moisture: 0 dusty .. 1 after rain.
        puddles: Share of the open ground under water, 0..0.2.
        grass: 0 none .. 1 wide green and dead margins.
        patches: Level ground; stronger than everything else.
        pits: Excavations.
        heaps: Heaps.
        slabs: Concrete areas.
        roads: Middle lines of haul roads.
        road_width_m: Of each haul road.
        ruts: Deep wheel tracks, in the relief as well as in the picture.
        tracks: Where tyres and crawlers left their print.
    """

    extent_m: tuple[float, float] = (120.0, 120.0)
    cell_m: float = 0.3
    soil: Soil = Soil.BROWN_EARTH
    relief_m: float = 0.1
    roughness: float = 0.4
    moisture: float = 0.3
    puddles: float = 0.01
    grass: float = 0.3
    patches: tuple[FlatPatch, ...] = ()
    pits: tuple[Pit, ...] = ()
    heaps: tuple[Heap, ...] = ()
    slabs: tuple[Slab, ...] = ()
    roads: tuple[Path, ...] = ()
    road_width_m: float = 6.0
    ruts: tuple[Path, ...] = ()
    tracks: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        self._check_numbers()
        self._check_circles()
        for pit in self.pits:
            if pit.depth_m <= 0.0:
                raise ValueError(f"a pit's depth must be positive, not {pit.depth_m}")
        for outline in [*(pit.outline_m for pit in self.pits), *(slab.outline_m for slab in self.slabs)]:
            self._check_outline(outline)
        if any(len(path) < 2 for path in (*self.roads, *self.ruts, *self.tracks)):
            raise ValueError("a road, rut or track needs two points or more")

    def _check_numbers(self) -> None:
        low, high = _EXTENT_M
        if not all(low <= side <= high for side in self.extent_m):
            raise ValueError(f"extent_m must be {low:g} to {high:g} m a side, not {self.extent_m}")
        if not (0.05 <= self.cell_m <= 2.0 and max(self.extent_m) / self.cell_m <= _CELLS):
            raise ValueError(f"cell_m must be 0.05 to 2 m and give at most {_CELLS} cells a side, not {self.cell_m}")
        if self.road_width_m <= 0.0:
            raise ValueError(f"road_width_m must be positive, not {self.road_width_m}")
        for name, most in {"relief_m": 2.0, "roughness": 1.0, "moisture": 1.0, "puddles": 0.2, "grass": 1.0}.items():
            if not 0.0 <= getattr(self, name) <= most:
                raise ValueError(f"{name} must be 0 to {most:g}, not {getattr(self, name)}")

    def _check_circles(self) -> None:
        for patch in self.patches:
            if patch.radius_m <= 0.0 or not 0.0 <= patch.firmness <= 1.0 or not self._reaches(patch.centre_m):
                raise ValueError(f"a patch needs a centre on the terrain, a radius and a firmness of 0 to 1: {patch}")
        for heap in self.heaps:
            if not 0.0 < heap.height_m <= _STEEPEST_HEAP * heap.radius_m or not self._reaches(heap.centre_m):
                raise ValueError(
                    f"a heap must be on the terrain and at most {_STEEPEST_HEAP:g} of its radius high: {heap}"
                )

    def _reaches(self, point_m: Point) -> bool:
        half = np.array(self.extent_m) / 2
        return bool(np.all(np.abs(point_m) <= half))

    def _check_outline(self, outline_m: Path) -> None:
        if len(outline_m) < 3 or not shapely.Polygon(outline_m).is_valid:
            raise ValueError(f"an outline must be a simple polygon of three corners or more, not {outline_m}")
        if not all(self._reaches(corner) for corner in outline_m):
            raise ValueError(f"an outline must lie on the terrain of {self.extent_m} m, not {outline_m}")
