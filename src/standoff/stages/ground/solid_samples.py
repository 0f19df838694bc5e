"""Which edges of a solid a camera sees, and points along them: loops over a dozen edges, compiled.

A solid is an upright prism: `corners` (N, 2) of its outline, counter-clockwise, and a height in m. The eye that sees it
is told as by `projection.eye_of`.
"""

from __future__ import annotations

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.core.compiled import compiled
from standoff.stages.ground.projection import seen

_STEP_PX = 1.5
_TRIM_PX = 3.0
"""Corners are rounded by every lens, and by every bricklayer."""

_MIN_LENGTH_PX = 9.0
_NARROW_PX = 3.0
"""The upper and the lower edge of a side that shows narrower than this are one edge of the picture, not two."""

_PARALLEL_COSINE, _OVERLAP = 0.9, 0.8
"""Edges run beside each other if they are this parallel and overlap by a fifth of their lengths."""


@compiled
def find_visible(
    corners: FloatArray,
    height_m: float,
    position_m: FloatArray,
    rotation: FloatArray,
    matrix: FloatArray,
    distortion: FloatArray,
    first_fold_r2: float,
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return what `solid.visible_edges` does."""
    count = len(corners)
    strip_px = _strip_widths(corners, height_m, position_m, rotation, matrix, distortion, first_fold_r2)
    faces, narrow = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    for k in range(count):
        after = (k + 1) % count
        along_x, along_y = corners[after, 0] - corners[k, 0], corners[after, 1] - corners[k, 1]
        faces[k] = (position_m[0] - corners[k, 0]) * along_y - (position_m[1] - corners[k, 1]) * along_x > 0.0
        narrow[k] = faces[k] and strip_px[k] < _NARROW_PX
    edges, doubt_px = np.empty((3 * count, 2, 3)), np.zeros(3 * count)
    lower_side = np.full(3 * count, -1)
    for k in range(count):
        edges[k, 0, :2], edges[k, 1, :2] = corners[k], corners[(k + 1) % count]
        edges[k, :, 2] = 0.5 if narrow[k] else 1.0
        doubt_px[k] = strip_px[k] / 2.0 if narrow[k] else 0.0
    found = count
    for k in range(count):
        if faces[k] and not narrow[k]:
            edges[found, 0, :2], edges[found, 1, :2] = corners[k], corners[(k + 1) % count]
            edges[found, :, 2] = 0.0
            lower_side[found] = k
            found += 1
    for k in range(count):
        if faces[k] or faces[k - 1]:
            edges[found, 0, :2], edges[found, 1, :2] = corners[k], corners[k]
            edges[found, 0, 2], edges[found, 1, 2] = 1.0, 0.0
            found += 1
    return edges[:found], doubt_px[:found], lower_side[:found]


@compiled
def _strip_widths(
    corners: FloatArray,
    height_m: float,
    position_m: FloatArray,
    rotation: FloatArray,
    matrix: FloatArray,
    distortion: FloatArray,
    first_fold_r2: float,
) -> FloatArray:
    """Return (N,) how far apart the middles of the upper and the lower edge of each side appear, across the edge."""
    count = len(corners)
    places = np.empty((3 * count, 3))
    for k in range(count):
        places[k, :2] = corners[k]
        places[count + k, :2] = places[2 * count + k, :2] = (corners[k] + corners[(k + 1) % count]) / 2.0
        places[k, 2] = places[count + k, 2] = height_m
        places[2 * count + k, 2] = 0.0
    pixels = seen(places, position_m, rotation, matrix, distortion, first_fold_r2)
    widths = np.empty(count)
    for k in range(count):
        along, drop = pixels[(k + 1) % count] - pixels[k], pixels[count + k] - pixels[2 * count + k]
        widths[k] = abs(drop[1] * along[0] - drop[0] * along[1]) / np.sqrt(along[0] ** 2 + along[1] ** 2)
    return widths


@compiled
def put_samples(
    corners: FloatArray,
    height_m: float,
    position_m: FloatArray,
    rotation: FloatArray,
    matrix: FloatArray,
    distortion: FloatArray,
    first_fold_r2: float,
) -> tuple[
    FloatArray, FloatArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray
]:
    """Return what `solid.EdgeSamples` holds, in its order."""
    edges, doubt_px, lower_side = find_visible(
        corners, height_m, position_m, rotation, matrix, distortion, first_fold_r2
    )
    ends_m = edges.copy().reshape(-1, 3)
    ends_m[:, 2] *= height_m
    ends_px = seen(ends_m, position_m, rotation, matrix, distortion, first_fold_r2).reshape(-1, 2, 2)
    count = len(edges)
    normal, length_px = np.empty((count, 2)), np.empty(count)
    counts = np.zeros(count, dtype=np.int64)
    for k in range(count):
        x, y = ends_px[k, 1, 0] - ends_px[k, 0, 0], ends_px[k, 1, 1] - ends_px[k, 0, 1]
        length_px[k] = np.sqrt(x * x + y * y)
        normal[k, 0], normal[k, 1] = -y / length_px[k], x / length_px[k]
        if np.isfinite(length_px[k]) and length_px[k] >= _MIN_LENGTH_PX:
            counts[k] = int(max((length_px[k] - 2.0 * _TRIM_PX) / _STEP_PX, 3.0))
    free_px = _free_reach(ends_px, normal, length_px, edges[:, 0, 2] == edges[:, 1, 2])
    samples = counts.sum()
    places, edge = np.empty((samples, 3)), np.empty(samples, dtype=np.int64)
    across, reach_px = np.empty((samples, 2)), np.empty(samples)
    n = 0
    for k in range(count):
        trim = _TRIM_PX / length_px[k]
        for within in range(counts[k]):
            share = trim + (1.0 - 2.0 * trim) * (within + 0.5) / counts[k]
            places[n] = edges[k, 0] + share * (edges[k, 1] - edges[k, 0])
            edge[n], across[n], reach_px[n] = k, normal[k], free_px[k]
            n += 1
        if counts[k] == 0:
            length_px[k] = 0.0
    xy_m, z_share = places[:, :2].copy(), places[:, 2].copy()
    places[:, 2] *= height_m
    points_px = seen(places, position_m, rotation, matrix, distortion, first_fold_r2)
    return xy_m, z_share, edge, points_px, across, reach_px, length_px, doubt_px, lower_side


@compiled
def _free_reach(ends_px: FloatArray, normal: FloatArray, length_px: FloatArray, level: BoolArray) -> FloatArray:
    """Return (E,) half the distance from each edge to the nearest level one beside it, in px; inf if there is none.

    Upright edges are too short to hem in others, and edges that follow each other in one line do not hem each other in.
    """
    count = len(ends_px)
    reach = np.full(count, np.inf)
    for k in range(count):
        for other in range(count):
            if other == k or not level[other]:
                continue
            x = (ends_px[other, 0, 0] + ends_px[other, 1, 0] - ends_px[k, 0, 0] - ends_px[k, 1, 0]) / 2.0
            y = (ends_px[other, 0, 1] + ends_px[other, 1, 1] - ends_px[k, 0, 1] - ends_px[k, 1, 1]) / 2.0
            parallel = abs(normal[k, 0] * normal[other, 0] + normal[k, 1] * normal[other, 1]) > _PARALLEL_COSINE
            lengthwise = abs(x * normal[k, 1] - y * normal[k, 0])
            if parallel and lengthwise < _OVERLAP * (length_px[k] + length_px[other]) / 2.0:
                reach[k] = min(reach[k], abs(x * normal[k, 0] + y * normal[k, 1]) / 2.0)
    return reach
