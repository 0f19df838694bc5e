"""What of a look at the ground is shown: lines, rings and places, in the picture and on the plan."""

from __future__ import annotations

from typing import Final

import contourpy
import numpy as np

from standoff.config import ReferenceSettings
from standoff.core.classes import CLASSES
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.lengths import LengthUnit
from standoff.core.map_error import map_jacobian
from standoff.core.pose import view_from_homography
from standoff.core.protocols import AnyGround
from standoff.core.types import GroundMap, GroundPositions, Tracks, WatchedGround
from standoff.core.watched_ground import REASONS
from standoff.drawing.ground_window import GroundWindow, camera_up, seen_ground_m, window_around
from standoff.service.setup.answers import Contour, Entity, Plan, Point, Watched
from standoff.service.setup.draft import SAME_S, Draft

_LEVELS_M: Final = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
_CONTOUR_CELLS: Final = 64
_PLAN_PX: Final = 560
_TURNS: Final = np.linspace(0.0, 2.0 * np.pi, 49)
_CIRCLE: Final = np.column_stack([np.cos(_TURNS), np.sin(_TURNS)])
_EDGE_STEPS: Final = 16


def window_of(ground: GroundMap) -> GroundWindow | None:
    """Return how the ground that the picture shows lies on the plan; None where it shows none."""
    points_m = seen_ground_m(ground)
    return window_around(points_m, (_PLAN_PX, _PLAN_PX), camera_up(ground)) if len(points_m) else None


def plan_of(window: GroundWindow | None) -> Plan | None:
    """Return what the page is told of that."""
    if window is None:
        return None
    width, height = window.size_px
    return Plan(width_px=width, height_px=height, m_per_px=window.m_per_px, to_plan=window.ground_to_window.tolist())


def camera_height(ground: GroundMap, unit: LengthUnit) -> str:
    """Return how high the camera is above the ground, for people; empty where the map does not tell."""
    if ground.camera is None:
        return ""
    try:
        return unit.length(float(view_from_homography(ground.image_to_ground, ground.camera).position_m[2]))
    except GroundError:
        return ""


def solid_px(reference: ReferenceSettings | None, ground: GroundMap, top_px: FloatArray) -> list[list[Point]]:
    """Return the outline of the reference's top as seen, of its foot as the map has it, and the edges between."""
    if reference is None or len(top_px) < 3:
        return []
    foot_px = np.array(ring_px(ground, reference.shape().corners_m, steps=1))
    lines = [pixels_of(np.concatenate([top_px, top_px[:1]]))]
    if len(foot_px) == len(top_px) + 1 and (reference.height_m or 0.0) > 0.0:
        lines.append(pixels_of(foot_px))
        lines += [pixels_of(np.array(edge)) for edge in zip(top_px, foot_px[:-1], strict=True)]
    return lines


def off_px(draft: Draft, top_px: FloatArray, time_s: float) -> float | None:
    """Return how far clicked corners are from those that were found, at most; None where they are of other pictures."""
    clicked = np.array(draft.reference.corners_px)
    if draft.ground != "reference" or len(top_px) != len(clicked) or abs(draft.reference.time_s - time_s) > SAME_S:
        return None
    away = np.linalg.norm(clicked[:, None] - top_px[None], axis=2)
    return float(away.min(axis=1).max())


def contours_of(ground: GroundMap, size_px: tuple[int, int], unit: LengthUnit) -> list[Contour]:
    """Return the lines in the picture along which a place is equally sure, worse beyond them."""
    columns = np.linspace(0.0, size_px[0] - 1.0, _CONTOUR_CELLS)
    rows = np.linspace(0.0, size_px[1] - 1.0, _CONTOUR_CELLS * size_px[1] // size_px[0])
    at_px = np.stack(np.meshgrid(columns, rows), axis=2).reshape(-1, 2)
    _, on_ground = ground.to_ground(at_px)
    by_map = map_jacobian(ground, ground.undistorted(at_px))
    covariance = by_map @ ground.covariance @ by_map.transpose(0, 2, 1)
    half = (covariance[:, 0, 0] + covariance[:, 1, 1]) / 2.0
    apart = np.hypot((covariance[:, 0, 0] - covariance[:, 1, 1]) / 2.0, covariance[:, 0, 1])
    sigma_m = np.sqrt(half + apart)
    # Beyond the horizon nothing is sure; a number so large that every line ends before it.
    sigma_m = np.where(on_ground & np.isfinite(sigma_m), sigma_m, 1e3).reshape(len(rows), len(columns))
    lines = contourpy.contour_generator(columns, rows, np.log(sigma_m))
    found = ((level, lines.lines(float(np.log(level)))) for level in _LEVELS_M)
    return [
        Contour(sigma_m=level, text=unit.limit(level), lines_px=[pixels_of(np.array(line)) for line in parts])
        for level, parts in found
        if len(parts)
    ]


def watched_of(watched: WatchedGround) -> Watched | None:
    """Return which ground is watched, cell by cell; None where nobody judged."""
    if not watched.judged:
        return None
    rows, columns = watched.cells.shape
    return Watched(rows=rows, columns=columns, cells=watched.cells.tolist(), reasons=list(REASONS), share=watched.share)


def entities_of(tracks: Tracks, positions: GroundPositions, ground: AnyGround) -> list[Entity]:
    """Return who is seen, with the circle of each as it is in the picture."""
    entities = []
    for row in range(len(tracks)):
        is_placed = bool(positions.valid[row])
        circle: list[Point] = []
        if is_placed and isinstance(ground, GroundMap):
            circle = ring_px(ground, positions.xy_m[row] + positions.radius_m[row] * _CIRCLE[:-1], steps=1)
        left, top, right, bottom = tracks.xyxy_px[row].tolist()
        entities.append(
            Entity(
                kind=CLASSES[tracks.class_id[row]].name,
                score=float(tracks.score[row]),
                box_px=(left, top, right, bottom),
                at_m=place_of(positions.xy_m[row]) if is_placed else None,
                circle_px=circle,
            )
        )
    return entities


def ring_px(ground: GroundMap, ring_m: FloatArray, steps: int = _EDGE_STEPS) -> list[Point]:
    """Return a closed ring on the ground as it is in the picture; its sides bend where the lens does."""
    after = np.roll(ring_m, -1, axis=0)
    shares = np.arange(steps) / steps
    points_m = (ring_m[:, None] + shares[None, :, None] * (after - ring_m)[:, None]).reshape(-1, 2)
    points_px, seen = ground.to_image(np.concatenate([points_m, points_m[:1]]))
    return pixels_of(points_px[seen])


def pixels_of(points_px: FloatArray) -> list[Point]:
    """Return (N, 2) points as the page is told them."""
    return [(round(x, 2), round(y, 2)) for x, y in points_px.tolist()]


def place_of(point: FloatArray) -> tuple[float, float]:
    """Return (2,) one place as the page is told it."""
    return float(point[0]), float(point[1])
