"""Heights of the ground: gentle 1/f relief, then roads, heaps, ruts, pits, slabs and level patches on it."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
import scipy.fft
import shapely

from standoff.core.homography import FloatArray
from standoff_sim.ground.terrain_plan import FlatPatch, Heap, Path, Pit, Slab, TerrainPlan
from standoff_sim.solids.mesh import Float32Array

_WALL_RUN_M = 0.42
"""The diagonal of a cell: a steeper wall would show the grid's teeth."""
_BLEND_M = 2.5
_BORDER_M = 3.0
_RUT_DEPTH_M = 0.09
_GAUGE_M = 2.0


def make_relief(rng: np.random.Generator, plan: TerrainPlan) -> Float32Array:
    """Return (ny, nx) heights; 0 along the border, where the surroundings take over."""
    shape = grid_shape(plan)
    x_m, y_m = _axes(plan, shape)
    height = _spectral(rng, shape, plan.cell_m, plan)
    _roll_roads(height, plan)
    for heap in plan.heaps:
        _tip(rng, height, heap, (x_m, y_m))
    _press_ruts(height, plan)
    for pit in plan.pits:
        _dig(height, pit, (x_m, y_m))
    for slab in plan.slabs:
        _cast(height, slab, (x_m, y_m))
    inwards_m = np.minimum.outer(np.minimum(y_m - y_m[0], y_m[-1] - y_m), np.minimum(x_m - x_m[0], x_m[-1] - x_m))
    height *= _smooth(inwards_m / _BORDER_M)
    for patch in plan.patches:
        _level(height, patch, (x_m, y_m))
    return np.ascontiguousarray(height, dtype=np.float32)


def grid_shape(plan: TerrainPlan) -> tuple[int, int]:
    """Return rows and columns of the height samples.

    >>> grid_shape(TerrainPlan(extent_m=(60.0, 30.0), cell_m=0.5))
    (61, 121)
    """
    columns, rows = (round(side / plan.cell_m) + 1 for side in plan.extent_m)
    return rows, columns


def surface_size_m(plan: TerrainPlan) -> tuple[float, float]:
    """Return the size from the first to the last sample, east-west and north-south: whole cells.

    >>> surface_size_m(TerrainPlan(extent_m=(60.2, 30.0), cell_m=0.5))
    (60.0, 30.0)
    """
    rows, columns = grid_shape(plan)
    return (columns - 1) * plan.cell_m, (rows - 1) * plan.cell_m


def _axes(plan: TerrainPlan, shape: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    rows, columns = shape
    half_x_m, half_y_m = (columns - 1) * plan.cell_m / 2, (rows - 1) * plan.cell_m / 2
    return np.linspace(-half_x_m, half_x_m, columns), np.linspace(-half_y_m, half_y_m, rows)


def _smooth(share: FloatArray) -> FloatArray:
    clipped = np.clip(share, 0.0, 1.0)
    smooth: FloatArray = clipped * clipped * (3.0 - 2.0 * clipped)
    return smooth


def _spectral(
    rng: np.random.Generator, shape: tuple[int, int], cell_m: float, plan: TerrainPlan
) -> npt.NDArray[np.float64]:
    """Shape white noise in the frequency domain: waves of 5 to 60 m as 1/f, and the roughness of worked soil."""
    padded = [scipy.fft.next_fast_len(side + 16, real=True) for side in shape]
    white = scipy.fft.rfft2(rng.standard_normal(padded))
    waves_per_m = np.hypot.outer(scipy.fft.fftfreq(padded[0], cell_m), scipy.fft.rfftfreq(padded[1], cell_m))
    bands = []
    for slope, longest_m, shortest_m in ((1.7, 60.0, 2.5), (0.8, 3.0, 0.5)):
        fall = np.maximum(waves_per_m, 1.0 / longest_m) ** -slope * np.exp(-((waves_per_m * shortest_m) ** 2))
        fall[0, 0] = 0.0
        band = scipy.fft.irfft2(white * fall, s=padded)[: shape[0], : shape[1]]
        bands.append(band / band.std())
    relief: npt.NDArray[np.float64] = plan.relief_m * bands[0] + 0.035 * plan.roughness * bands[1]
    return relief


def _strip(plan: TerrainPlan, shape: tuple[int, int], paths: tuple[Path, ...], width_m: float) -> Float32Array:
    """Return (ny, nx) 0..1: the share of a cell that strips of a width along paths cover."""
    fine = 3
    mask = np.zeros((shape[0] * fine, shape[1] * fine), np.uint8)
    half = np.array(surface_size_m(plan)) / 2
    lines = [
        np.round((((np.array(path) + half) / plan.cell_m + 0.5) * fine - 0.5) * 16).astype(np.int32) for path in paths
    ]
    cv2.polylines(mask, lines, False, 255, max(1, round(width_m / plan.cell_m * fine)), cv2.LINE_AA, 4)
    return np.asarray(cv2.resize(mask, shape[::-1], interpolation=cv2.INTER_AREA), np.float32) / np.float32(255.0)


def beside(path: Path, offset_m: float) -> Path:
    """Return the path shifted to its left by a distance.

    >>> beside(((0.0, 0.0), (10.0, 0.0)), 1.0)
    ((0.0, 1.0), (10.0, 1.0))
    """
    points = np.array(path, dtype=np.float64)
    along = np.gradient(points, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    shifted = points + offset_m * np.column_stack([-along[:, 1], along[:, 0]])
    return tuple((float(x), float(y)) for x, y in shifted)


def _roll_roads(height: npt.NDArray[np.float64], plan: TerrainPlan) -> None:
    if not plan.roads:
        return
    weight = cv2.GaussianBlur(
        _strip(plan, (height.shape[0], height.shape[1]), plan.roads, plan.road_width_m), None, 3.0
    )
    rolled = cv2.GaussianBlur(height, None, 2.5 / plan.cell_m) - 0.05
    height += 0.9 * weight * (rolled - height)


def _press_ruts(height: npt.NDArray[np.float64], plan: TerrainPlan) -> None:
    if not plan.ruts:
        return
    wheels = tuple(beside(path, side * _GAUGE_M / 2) for path in plan.ruts for side in (-1.0, 1.0))
    pressed = _strip(plan, (height.shape[0], height.shape[1]), wheels, 0.6)
    berm = cv2.GaussianBlur(pressed, None, 0.5 / plan.cell_m)
    height += _RUT_DEPTH_M * (0.9 * berm - cv2.GaussianBlur(pressed, None, 0.15 / plan.cell_m))


def _window(low_m: FloatArray, high_m: FloatArray, axes: tuple[FloatArray, FloatArray]) -> tuple[slice, slice]:
    """Return rows and columns of the samples inside a box."""
    columns, rows = (slice(*np.searchsorted(axis, (low_m[i], high_m[i]))) for i, axis in enumerate(axes))
    return rows, columns


def _tip(
    rng: np.random.Generator, height: npt.NDArray[np.float64], heap: Heap, axes: tuple[FloatArray, FloatArray]
) -> None:
    """Add overlapping loads, each a blunt cone with gullies washed into its sides."""
    centre = np.array(heap.centre_m)
    window = _window(centre - heap.radius_m, centre + heap.radius_m, axes)
    x_m, y_m = np.meshgrid(axes[0][window[1]], axes[1][window[0]])
    raised = np.zeros_like(x_m)
    for load in range(int(rng.integers(1, 5))):
        share = 1.0 if load == 0 else rng.uniform(0.5, 0.8)
        away = rng.uniform(0.0, 1.0 - share) * heap.radius_m if load else 0.0
        turn = rng.uniform(0.0, 2 * np.pi)
        dx, dy = x_m - centre[0] - away * np.cos(turn), y_m - centre[1] - away * np.sin(turn)
        around = np.arctan2(dy, dx)
        waves = np.array([2, 3, 5, 9, 14])
        ragged = np.sum(
            np.array([0.10, 0.06, 0.05, 0.03, 0.025])[:, None, None]
            * np.cos(waves[:, None, None] * around + rng.uniform(0, 2 * np.pi, 5)[:, None, None]),
            axis=0,
        )
        reach = np.hypot(dx, dy) / (share * heap.radius_m) * (1.26 + ragged)
        blunt = (1.0 - np.sqrt(reach**2 + 0.01)) / 0.9
        raised = np.maximum(raised, share * heap.height_m * np.clip(blunt, 0.0, None))
    height[window] += raised


def _depth_inside(
    outline_m: Path, axes: tuple[FloatArray, FloatArray]
) -> tuple[tuple[slice, slice], npt.NDArray[np.float64]]:
    """Return the window of samples around a polygon and their distances to its edge, positive inside."""
    polygon = shapely.Polygon(outline_m)
    shapely.prepare(polygon)
    west, south, east, north = polygon.bounds
    reach_m = 1.0
    window = _window(np.array([west, south]) - reach_m, np.array([east, north]) + reach_m, axes)
    x_m, y_m = np.meshgrid(axes[0][window[1]], axes[1][window[0]])
    away_m = shapely.distance(polygon.exterior, shapely.points(x_m, y_m))
    return window, np.where(shapely.contains_xy(polygon, x_m, y_m), away_m, -away_m)


def _dig(height: npt.NDArray[np.float64], pit: Pit, axes: tuple[FloatArray, FloatArray]) -> None:
    window, inside_m = _depth_inside(pit.outline_m, axes)
    before = height[window]
    edge = np.abs(inside_m) < 0.5
    around_m = before[edge].mean() if edge.any() else before.mean()
    floor = around_m - pit.depth_m + 0.4 * (before - around_m)
    wall = np.clip(inside_m / _WALL_RUN_M + 0.5, 0.0, 1.0)
    height[window] = np.minimum(before, before + wall * (floor - before))


def _cast(height: npt.NDArray[np.float64], slab: Slab, axes: tuple[FloatArray, FloatArray]) -> None:
    window, inside_m = _depth_inside(slab.outline_m, axes)
    before = height[window]
    top_m = (before[inside_m > 0].mean() if (inside_m > 0).any() else before.mean()) + slab.rise_m
    share = np.clip(inside_m / _WALL_RUN_M + 0.7, 0.0, 1.0)
    height[window] = before + share * (top_m - before)


def _level(height: npt.NDArray[np.float64], patch: FlatPatch, axes: tuple[FloatArray, FloatArray]) -> None:
    centre = np.array(patch.centre_m)
    reach_m = patch.radius_m + _BLEND_M
    window = _window(centre - reach_m, centre + reach_m, axes)
    away_m = np.hypot.outer(axes[1][window[0]] - centre[1], axes[0][window[1]] - centre[0])
    before = height[window]
    level_m = before[away_m <= max(patch.radius_m, away_m.min())].mean() if patch.height_m is None else patch.height_m
    weight = patch.firmness * _smooth((reach_m - away_m) / _BLEND_M)
    height[window] = before + weight * (level_m - before)
