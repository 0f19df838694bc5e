"""Circles on the ground as the camera sees them: ellipses, or parts of other conics near the camera's own plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from standoff.core import homography
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import GroundMap

_ANGLES = np.linspace(0.0, 2.0 * np.pi, 49)  # a chord is within a quarter of a per cent of the radius
_RING = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
_RING[-1] = _RING[0]
_PIECES, _BORDER_STEPS, _SIGHT_MARGIN = 12, 9, 0.05
_NEAREST_SHARE = 0.02  # of the centre's depth: what is cut away lies far outside the picture


def clip_in_front(target_to_source: FloatArray, polygon: FloatArray, nearest: float) -> FloatArray:
    """Cut off the part of a closed polygon whose projective denominator is below `nearest`.

    Args:
        target_to_source: (3, 3) signed homography that the polygon is going to be mapped through.
        polygon: (N, 2), closed without repeating its first point.
        nearest: Smallest denominator to keep, above 0.

    Returns:
        (M, 2) the polygon in front; M = 0 when there is none.

    >>> square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    >>> half = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    >>> clip_in_front(half, square, 1.0)
    array([[1., 0.],
           [2., 0.],
           [2., 2.],
           [1., 2.]])
    """
    return clip_half_plane(polygon, target_to_source[2] - np.array([0.0, 0.0, nearest]))


def clip_half_plane(polygon: FloatArray, line: FloatArray) -> FloatArray:
    """Cut off the part of a closed polygon (N, 2) where a x + b y + c is below 0; return what is left, (M, 2).

    Args:
        polygon: Closed without repeating its first point.
        line: (3,) a, b and c.
    """
    excess = polygon @ line[:2] + line[2]
    if (excess >= 0).all():
        return polygon
    if (excess < 0).all():
        return polygon[:0]
    kept: list[FloatArray] = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if excess[i] >= 0:
            kept.append(polygon[i])
        if (excess[i] >= 0) != (excess[j] >= 0):
            share = excess[i] / (excess[i] - excess[j])
            kept.append(polygon[i] + share * (polygon[j] - polygon[i]))
    return np.array(kept, dtype=np.float64).reshape(-1, 2)


def circle_outlines_px(ground: GroundMap, centres_m: FloatArray, radii_m: FloatArray) -> list[list[FloatArray]]:
    """Project circles on the ground into the picture.

    Args:
        ground: The map.
        centres_m: (N, 2) site frame; NaN for an unknown position.
        radii_m: (N,).

    Returns:
        For each circle the open polylines, (P, 2) picture points, that make up its outline: one that ends where
        it starts for a whole ellipse, none for an unknown position, behind the camera or where no lens sees.
    """
    ground_to_image = homography.invert(ground.image_to_ground)
    depths = _depths(ground_to_image, centres_m)
    nearest = _NEAREST_SHARE * depths
    rings_m = centres_m[:, None] + radii_m[:, None, None] * _RING
    whole: BoolArray = np.asarray((_depths(ground_to_image, rings_m) >= nearest[:, None]).all(axis=1))
    outlines_px = ground.to_image(rings_m.reshape(-1, 2))[0].reshape(rings_m.shape)
    outlines: list[list[FloatArray]] = []
    for i in range(len(centres_m)):
        outline_px = outlines_px[i]
        if not depths[i] > 0:
            outlines.append([])
            continue
        if not whole[i]:
            polygon = clip_in_front(ground_to_image, rings_m[i, :-1], nearest[i])
            outline_px = ground.to_image(np.vstack([polygon, polygon[:1]]))[0]
        outlines.append(_finite_runs(outline_px))
    return outlines


def _depths(ground_to_image: FloatArray, points_m: FloatArray) -> FloatArray:
    depths: FloatArray = points_m @ ground_to_image[2, :2] + ground_to_image[2, 2]
    return depths


def _finite_runs(points_px: FloatArray) -> list[FloatArray]:
    seen: BoolArray = np.asarray(np.isfinite(points_px).all(axis=1))
    if seen.all():
        return [points_px]
    runs = np.split(np.arange(len(seen)), np.flatnonzero(np.diff(seen)) + 1)
    return [points_px[run] for run in runs if len(run) > 1 and seen[run[0]]]


def outlines_in_sight_px(ground: GroundMap, rings_m: Sequence[FloatArray]) -> list[FloatArray]:
    """Project closed rings on the ground into the picture, without what lies far outside of it or behind the camera.

    Args:
        ground: The map.
        rings_m: (V, 2) each: corners in the site frame, the first one not repeated.

    Returns:
        For each ring (P, 2) picture points, closed without repeating the first, its sides bent as the lens bends them
        and cut off just outside the picture; P = 0 where none of it is in sight.
    """
    ground_to_image = homography.invert(ground.image_to_ground)
    low, high = _sight(ground)
    corners = np.array([low, (low[0], high[1]), (high[0], low[1]), high])
    # There and back the denominators are each other's inverse: no ground in sight is nearer than this.
    most = float(_depths(ground.image_to_ground, corners).max())
    outlines = []
    for ring_m in rings_m:
        part_m = clip_in_front(ground_to_image, ring_m, 0.5 / most) if most > 0 else ring_m[:0]
        outlines.append(clip_to_box(homography.apply(ground_to_image, part_m)[0], low, high))
    if ground.camera is None or not outlines:
        return outlines
    # All at once: a lens costs by the call.
    bent = [_in_pieces(outline_px) for outline_px in outlines]
    ends = np.cumsum([len(one) for one in bent])
    seen = np.split(ground.camera.distort(np.concatenate(bent)), ends[:-1])
    return [one[np.isfinite(one).all(axis=1)] for one in seen]


def clip_to_box(polygon: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return (M, 2) the part of a closed polygon (N, 2) between two corners (2,) of a box; M = 0: none."""
    for axis in (0, 1):
        for sign, limit in ((1.0, -low[axis]), (-1.0, high[axis])):
            line = np.array([0.0, 0.0, limit])
            line[axis] = sign
            if len(polygon):
                polygon = clip_half_plane(polygon, line)
    return polygon


def _sight(ground: GroundMap) -> tuple[FloatArray, FloatArray]:
    """Return the low and high corner of a box around the picture without lens distortion, and a little more."""
    size = np.array(ground.image_size_px, dtype=np.float64)
    share = np.linspace(0.0, 1.0, _BORDER_STEPS)
    level, ends = np.tile(share, 2), np.repeat([0.0, 1.0], _BORDER_STEPS)
    border = np.concatenate([np.column_stack([level, ends]), np.column_stack([ends, level])]) * (size - 1.0)
    border_px = ground.undistorted(border)
    low, high = np.nanmin(border_px, axis=0), np.nanmax(border_px, axis=0)
    margin_px = _SIGHT_MARGIN * (high - low)
    return low - margin_px, high + margin_px


def _in_pieces(polygon: FloatArray) -> FloatArray:
    """Return a closed polygon with points between its corners, so that a lens can bend its sides."""
    to_next = np.roll(polygon, -1, axis=0) - polygon
    share = np.arange(_PIECES)[:, None] / _PIECES
    points: FloatArray = (polygon[:, None] + share * to_next[:, None]).reshape(-1, 2)
    return points
