"""How tall a worker would appear on the ground in each cell of a picture, and how sure the place would be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from standoff.core import homography
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.map_error import factor, map_jacobian, picture_jacobian
from standoff.core.polygon import inside
from standoff.core.types import GroundMap
from standoff.core.watched_ground import cell_middles_px

_DEPTH_PER_STATURE: Final = 0.22


@dataclass(frozen=True, slots=True, eq=False)
class GroundCells:
    """What a map says of the middle of each cell, (N,) row by row.

    Attributes:
        is_ground: The line of sight meets the ground.
        in_map: The map is trusted there.
        height_px: Of a standing worker's box, in the picture; NaN where there is no ground.
        sigma_m: Standard error of the place along its worst direction, from the map alone; NaN likewise.
    """

    is_ground: BoolArray
    in_map: BoolArray
    height_px: FloatArray
    sigma_m: FloatArray


def ground_cells(ground: GroundMap, size_px: tuple[int, int], stature_m: float) -> GroundCells:
    """Ask a map about every cell.

    Of a worker H metres tall and D deep who is seen at an angle whose sine is s, H sqrt(1 - s^2) + D s metres across
    the view are in the box, as in `standoff.stages.locate.class_prior`.

    Args:
        ground: The map.
        size_px: (width, height) of the picture.
        stature_m: Height of the worker.
    """
    points_px = ground.undistorted(cell_middles_px(size_px))
    _, is_ground = homography.apply(ground.image_to_ground, points_px)
    is_ground = is_ground & np.isfinite(points_px).all(axis=1)
    height_px, sigma_m = np.full(len(points_px), np.nan), np.full(len(points_px), np.nan)
    seen_px = points_px[is_ground]
    along_m, across_m = np.linalg.svd(picture_jacobian(ground, seen_px), compute_uv=False).T
    sine = across_m / along_m
    height_px[is_ground] = stature_m * (np.sqrt(1.0 - sine**2) + _DEPTH_PER_STATURE * sine) / across_m
    moved_m = map_jacobian(ground, seen_px) @ factor(ground.covariance)
    sigma_m[is_ground] = np.linalg.svd(moved_m, compute_uv=False)[:, 0]
    in_map = inside(ground.valid_px, points_px) if len(ground.valid_px) else is_ground
    return GroundCells(is_ground, in_map, height_px, sigma_m)
