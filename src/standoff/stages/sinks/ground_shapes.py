"""Circles on the ground as the camera sees them: ellipses, or parts of other conics near the camera's own plane."""

from __future__ import annotations

import numpy as np

from standoff.core import homography
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import GroundMap

_ANGLES = np.linspace(0.0, 2.0 * np.pi, 49)  # a chord is within a quarter of a per cent of the radius
_RING = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
_RING[-1] = _RING[0]
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
    excess = polygon @ target_to_source[2, :2] + target_to_source[2, 2] - nearest
    if (excess >= 0).all():
        return polygon
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
