"""Buildings beyond the fence: grids of windows, flat or pitched roofs, sheds, a facade behind scaffolding."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.solids.mesh import Mesh, Surface, box, join, rotation, srgb
from standoff_sim.solids.panels import level, panels, upright


@dataclass(frozen=True, slots=True)
class House:
    """The kind of a building; its long side is along local x, its front faces local -y.

    Attributes:
        bays: Windows along the long and the short side.
        floors: Storeys.
        bay_m: Distance of windows.
        floor_m: Height of a storey.
        window: Share of a bay's width and of a storey's height that is glass.
        gabled: Pitched roof instead of a flat one.
        detailed: Every window; otherwise bands of glass, for the distance.
    """

    bays: tuple[int, int]
    floors: int
    bay_m: float = 3.0
    floor_m: float = 3.0
    window: tuple[float, float] = (0.5, 0.5)
    gabled: bool = False
    detailed: bool = True

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Length, depth and height of the walls."""
        return self.bays[0] * self.bay_m, self.bays[1] * self.bay_m, self.floors * self.floor_m + 0.8


FLATS = (
    House((8, 4), 5),
    House((12, 4), 6, window=(0.45, 0.5)),
    House((6, 5), 9, 3.2),
    House((10, 4), 4, 3.4, 3.2, (0.7, 0.55)),
    House((7, 5), 7, 3.6, 3.3, (0.9, 0.6)),
    House((14, 4), 3, 2.8, 3.1),
)
COTTAGES = (House((4, 3), 2, gabled=True), House((5, 3), 2, 2.8, 2.8, (0.4, 0.45), True), House((3, 3), 3, gabled=True))
SHEDS = (
    House((6, 4), 1, 6.0, 7.0, (0.25, 0.12)),
    House((9, 5), 1, 6.0, 9.0, (0.6, 0.08)),
    House((4, 3), 1, 5.0, 6.0, (0.3, 0.2), True),
)
WALLS = tuple(
    srgb(code)
    for code in ("#c9c0ae", "#b8a78c", "#d4cfc4", "#a58a70", "#9a9690", "#bfae97", "#8f5f4b", "#c4b9a6", "#8d939a")
)
"""Tints of walls: render, brick, panels."""


@lru_cache
def building(house: House, variant: int = 0) -> Mesh:
    """Return a building around the origin; its walls are tintable."""
    rng = np.random.default_rng([81, variant, house.bays[0], house.floors])
    length_m, depth_m, height_m = house.size_m
    parts = []
    for side in range(4):
        wide_m, far_m = (length_m, depth_m) if side % 2 == 0 else (depth_m, length_m)
        facade = _facade(rng, house, wide_m, house.bays[side % 2])
        parts.append(facade.at(0.0, -far_m / 2, 0.0).moved(rotation("z", 90.0 * side)))
    roof = _gable(length_m, depth_m, height_m) if house.gabled else _flat_roof(rng, length_m, depth_m, height_m)
    return join([*parts, roof])


def _facade(rng: np.random.Generator, house: House, wide_m: float, bays: int) -> Mesh:
    """Return a wall in the plane y = 0 that faces -y, with its windows a little in front of it."""
    height_m = house.size_m[2]
    wall = upright(np.array([[-wide_m / 2, 0.0]]), np.array([[wide_m, 0.0]]), np.zeros(1), np.array([height_m]))
    parts = [panels(wall, (1.0, 1.0, 1.0), Surface.CONCRETE, tintable=1.0)]
    columns = bays if house.detailed else 1
    share_x, share_z = house.window
    pitch_m = wide_m / columns
    column, floor = (grid.ravel() for grid in np.meshgrid(np.arange(columns), np.arange(house.floors)))
    glass_m = pitch_m * (share_x if house.detailed else 0.9)
    left = np.column_stack([-wide_m / 2 + (column + 0.5) * pitch_m - glass_m / 2, np.full(len(column), -0.05)])
    low = np.asarray((floor + 0.5 - 0.5 * share_z) * house.floor_m + 0.3, np.float64)
    high = low + share_z * house.floor_m
    width = np.column_stack([np.full(len(column), glass_m), np.zeros(len(column))])
    tone = rng.choice([0.03, 0.05, 0.09, 0.3], size=len(column), p=[0.4, 0.3, 0.2, 0.1])
    glass = tone[:, None] * np.array([0.9, 1.0, 1.1]) * rng.uniform(0.8, 1.2, (len(column), 1))
    parts.append(panels(upright(left, width, low, high), glass, Surface.GLASS))
    if house.detailed:
        frame = upright(left - np.array([0.12, -0.02]), width + np.array([0.24, 0.0]), low - 0.14, high + 0.1)
        parts.append(panels(frame, (0.55, 0.54, 0.5), Surface.PLASTIC, tintable=0.3))
    return join(parts)


def _flat_roof(rng: np.random.Generator, length_m: float, depth_m: float, height_m: float) -> Mesh:
    """Return a roof behind a parapet, with plant, hatches and a lift head."""
    half = np.array([length_m, depth_m]) / 2
    tone = srgb(("#8b8780", "#6a6763", "#a9a59c", "#55524e")[int(rng.integers(4))])
    parts = [panels(level(-half[0], -half[1], half[0], half[1], height_m - 0.5), tone, Surface.CONCRETE)]
    for side in range(4):
        wide_m, far_m = (length_m, depth_m) if side % 2 == 0 else (depth_m, length_m)
        rim = box((wide_m, 0.3, 0.55), None, Surface.CONCRETE).at(0.0, -far_m / 2 + 0.15, height_m - 0.5)
        parts.append(rim.moved(rotation("z", 90.0 * side)))
    for _ in range(int(rng.integers(2, 7))):
        size = (float(rng.uniform(0.8, 3.5)), float(rng.uniform(0.8, 2.5)), float(rng.uniform(0.5, 2.4)))
        at = rng.uniform(-0.35, 0.35, 2) * (length_m, depth_m)
        grey = float(rng.uniform(0.2, 0.5))
        parts.append(box(size, (grey, grey, grey), Surface.STEEL).at(float(at[0]), float(at[1]), height_m - 0.5))
    return join(parts)


def _gable(length_m: float, depth_m: float, height_m: float) -> Mesh:
    """Return a pitched roof with its gables."""
    x, y, eaves, ridge = length_m / 2, depth_m / 2, height_m, height_m + 0.36 * depth_m
    over = 0.5
    slopes = [
        [
            [-x - over, -y - over, eaves - 0.3],
            [x + over, -y - over, eaves - 0.3],
            [x + over, 0, ridge],
            [-x - over, 0, ridge],
        ],
        [
            [x + over, y + over, eaves - 0.3],
            [-x - over, y + over, eaves - 0.3],
            [-x - over, 0, ridge],
            [x + over, 0, ridge],
        ],
    ]
    gables = [
        [[x, -y, eaves], [x, y, eaves], [x, 0, ridge - 0.1], [x, 0, ridge - 0.1]],
        [[-x, y, eaves], [-x, -y, eaves], [-x, 0, ridge - 0.1], [-x, 0, ridge - 0.1]],
    ]
    tiles = panels(np.array(slopes), srgb("#7d5140"), Surface.CONCRETE, tintable=0.25)
    return join([tiles, panels(np.array(gables), (1.0, 1.0, 1.0), Surface.CONCRETE, tintable=1.0)])


@lru_cache
def scaffolding(length_m: int, height_m: int) -> Mesh:
    """Return a scaffold along local x, 1.2 m deep, its back to the wall at y = 0, with torn netting in front."""
    rng = np.random.default_rng([83, length_m, height_m])
    tube, board = srgb("#8c8d8c"), srgb("#8f7a5a")
    parts = []
    for x in np.arange(-length_m / 2, length_m / 2 + 0.1, 2.5):
        parts += [box((0.06, 0.06, height_m + 1.0), tube, Surface.STEEL).at(float(x), y, 0.0) for y in (-0.15, -1.2)]
    for z in np.arange(2.0, height_m + 0.1, 2.0):
        parts.append(box((length_m, 0.9, 0.06), board, Surface.WOOD).at(0.0, -0.65, float(z)))
        parts += [box((length_m, 0.05, 0.05), tube, Surface.STEEL).at(0.0, -1.2, float(z) + r) for r in (0.5, 1.0)]
    count = int(length_m / 2.5)
    nets = []
    for level_index in range(int(height_m / 2)):
        hung = np.nonzero(rng.random(count) < 0.55)[0]
        start = np.column_stack([-length_m / 2 + 2.5 * hung, np.full(len(hung), -1.27)])
        low = np.full(len(hung), 2.0 * level_index)
        nets.append(upright(start, np.tile([2.5, 0.0], (len(hung), 1)), low, low + 2.0))
    netting: FloatArray = np.concatenate(nets)
    return join([*parts, panels(netting, (0.8, 0.8, 0.8), Surface.FABRIC, tintable=1.0)])
