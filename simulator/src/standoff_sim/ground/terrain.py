"""The ground of a site: heights that are exactly known, and how they look from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff_sim.ground.relief import make_relief
from standoff_sim.ground.soils import paint_ground
from standoff_sim.ground.terrain_plan import TerrainPlan
from standoff_sim.solids.mesh import Float32Array


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """A `standoff_sim.scene.scene.Ground` made from a plan.

    Attributes:
        plan: What it was made from.
        origin_xy_m: (2,) site coordinates of height sample [0, 0] (the south-west corner).
        cell_m: Distance of height samples.
        height_m: (ny, nx), row index north, column east; each cell is split from south-west to north-east.
        albedo: (h, w, 3) uint8 sRGB, red first, row 0 in the south; darker where the ground is damp.
        wetness: (h, w) uint8, 0 dry .. 255 standing water.
    """

    plan: TerrainPlan
    origin_xy_m: FloatArray
    cell_m: float
    height_m: Float32Array
    albedo: npt.NDArray[np.uint8]
    wetness: npt.NDArray[np.uint8]

    @property
    def size_m(self) -> tuple[float, float]:
        """East-west and north-south size of the triangulated surface."""
        rows, columns = self.height_m.shape
        return (columns - 1) * self.cell_m, (rows - 1) * self.cell_m

    def inside(self, xy_m: FloatArray) -> npt.NDArray[np.bool_]:
        """Return (N,) whether points (N, 2) are on the terrain, its border included."""
        offset = np.asarray(xy_m, dtype=np.float64).reshape(-1, 2) - self.origin_xy_m
        on_it: npt.NDArray[np.bool_] = np.all((offset >= 0.0) & (offset <= self.size_m), axis=1)
        return on_it

    def height_at(self, xy_m: FloatArray) -> FloatArray:
        """Return (N,) heights of the triangulated surface under (N, 2); the border's height outside."""
        height, east, north, across, up = self._plane(xy_m)
        return height + east * across + north * up

    def _plane(self, xy_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return, for each point, its cell's south-west height, its place in the cell, and the rise across a cell."""
        place = (np.asarray(xy_m, dtype=np.float64).reshape(-1, 2) - self.origin_xy_m) / self.cell_m
        rows, columns = self.height_m.shape
        place = np.clip(place, 0.0, (columns - 1, rows - 1))
        column, row = np.minimum(place.astype(np.intp), (columns - 2, rows - 2)).T
        east, north = place[:, 0] - column, place[:, 1] - row
        south_west, south_east, north_west, north_east = (
            self.height_m[row + north_of, column + east_of].astype(np.float64)
            for north_of, east_of in ((0, 0), (0, 1), (1, 0), (1, 1))
        )
        south = east >= north
        across = np.where(south, south_east - south_west, north_east - north_west)
        up = np.where(south, north_east - south_east, north_west - south_west)
        return south_west, east, north, across, up


def make_terrain(rng: np.random.Generator, plan: TerrainPlan) -> Terrain:
    """Shape and paint the ground of a plan; the same generator state gives the same ground bit for bit."""
    height_m = make_relief(rng, plan)
    albedo, wetness = paint_ground(rng, plan, height_m)
    rows, columns = height_m.shape
    origin_xy_m = -np.array([columns - 1, rows - 1]) * plan.cell_m / 2
    for array in (origin_xy_m, height_m, albedo, wetness):
        array.setflags(write=False)
    return Terrain(plan, origin_xy_m, plan.cell_m, height_m, albedo, wetness)
