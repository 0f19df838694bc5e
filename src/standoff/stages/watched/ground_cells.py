"""How tall a worker would appear on the ground in each cell of a picture, and how sure the place would be."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import numpy as np

from standoff.core import homography
from standoff.core.errors import GroundError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.map_error import factor, map_jacobian, picture_jacobian
from standoff.core.polygon import inside
from standoff.core.pose import view_from_homography
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

    Args:
        ground: The map.
        size_px: (width, height) of the picture.
        stature_m: Height of the worker.
    """
    points_px = ground.undistorted(cell_middles_px(size_px))
    places_m, is_ground = homography.apply(ground.image_to_ground, points_px)
    is_ground = is_ground & np.isfinite(points_px).all(axis=1)
    height_px, sigma_m = np.full(len(points_px), np.nan), np.full(len(points_px), np.nan)
    seen_px = points_px[is_ground]
    height_px[is_ground] = _heights_px(ground, seen_px, places_m[is_ground], stature_m)
    moved_m = map_jacobian(ground, seen_px) @ factor(ground.covariance)
    sigma_m[is_ground] = np.sqrt(homography.stretches(moved_m @ moved_m.transpose(0, 2, 1))[0])
    in_map = inside(ground.valid_px, points_px) if len(ground.valid_px) else is_ground
    return GroundCells(is_ground, in_map, height_px, sigma_m)


def _heights_px(ground: GroundMap, seen_px: FloatArray, places_m: FloatArray, stature_m: float) -> FloatArray:
    """Return how tall workers appear: from feet to head, and of what is deep what the angle of the view s leaves, D s.

    Without a camera the view is taken to be parallel, H sqrt(1 - s^2): right in the middle of the picture.
    """
    along_m, across_m = homography.stretches(picture_jacobian(ground, seen_px))
    sine = across_m / along_m
    upright_px = stature_m * np.sqrt(1.0 - sine**2) / across_m
    if ground.camera is not None:
        with suppress(GroundError):
            view = view_from_homography(ground.image_to_ground, ground.camera)
            feet, heads = (
                view.project(np.column_stack([places_m, np.full(len(places_m), z_m)])) for z_m in (0.0, stature_m)
            )
            upright_px = np.linalg.norm(heads - feet, axis=1)
    heights_px: FloatArray = upright_px + stature_m * _DEPTH_PER_STATURE * sine / across_m
    return heights_px
