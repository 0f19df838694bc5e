"""Which edges of a solid a camera sees, and points along them: loops over a dozen edges, compiled.

A solid is an upright prism: `corners` (N, 2) of its outline, counter-clockwise, and a height in m. The eye that sees it
is told as by `projection.eye_of`.
"""

from __future__ import annotations

import numpy as np

from standoff.core.compiled import compiled
from standoff.core.homography import FloatArray
from standoff.core.types import IntArray
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
        level = 0.5 if narrow[k] else 1.0
        _put_edge(edges, k, corners, k, level, (k + 1) % count, level)
        if narrow[k]:
            doubt_px[k] = strip_px[k] / 2.0
    found = count
    for k in range(count):
        if faces[k] and not narrow[k]:
            _put_edge(edges, found, corners, k, 0.0, (k + 1) % count, 0.0)
            lower_side[found] = k
            found += 1
    for k in range(count):
        if faces[k] or faces[k - 1]:
            _put_edge(edges, found, corners, k, 1.0, k, 0.0)
            found += 1
    return edges[:found], doubt_px[:found], lower_side[:found]


@compiled
def _put_edge(
    edges: FloatArray, at: int, corners: FloatArray, start: int, start_share: float, end: int, end_share: float
) -> None:
    for axis in range(2):
        edges[at, 0, axis], edges[at, 1, axis] = corners[start, axis], corners[end, axis]
    edges[at, 0, 2], edges[at, 1, 2] = start_share, end_share


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
        for axis in range(2):
            middle = (corners[k, axis] + corners[(k + 1) % count, axis]) / 2.0
            places[k, axis], places[count + k, axis], places[2 * count + k, axis] = corners[k, axis], middle, middle
        places[k, 2], places[count + k, 2], places[2 * count + k, 2] = height_m, height_m, 0.0
    pixels = seen(places, position_m, rotation, matrix, distortion, first_fold_r2)
    widths = np.empty(count)
    for k in range(count):
        after, high, low = (k + 1) % count, count + k, 2 * count + k
        along_x, along_y = pixels[after, 0] - pixels[k, 0], pixels[after, 1] - pixels[k, 1]
        drop_x, drop_y = pixels[high, 0] - pixels[low, 0], pixels[high, 1] - pixels[low, 1]
        widths[k] = abs(drop_y * along_x - drop_x * along_y) / np.sqrt(along_x**2 + along_y**2)
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
) -> tuple[FloatArray, FloatArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray]:
    """Return what `solid.EdgeSamples` holds, in its order."""
    edges, doubt_px, lower_side = find_visible(
        corners, height_m, position_m, rotation, matrix, distortion, first_fold_r2
    )
    count = len(edges)
    ends_m = np.empty((2 * count, 3))
    for k in range(2 * count):
        ends_m[k, 0], ends_m[k, 1] = edges[k // 2, k % 2, 0], edges[k // 2, k % 2, 1]
        ends_m[k, 2] = edges[k // 2, k % 2, 2] * height_m
    ends_px = seen(ends_m, position_m, rotation, matrix, distortion, first_fold_r2)
    normal, length_px = np.empty((count, 2)), np.empty(count)
    counts = np.zeros(count, dtype=np.int64)
    samples = 0
    for k in range(count):
        x, y = ends_px[2 * k + 1, 0] - ends_px[2 * k, 0], ends_px[2 * k + 1, 1] - ends_px[2 * k, 1]
        length_px[k] = np.sqrt(x * x + y * y)
        normal[k, 0], normal[k, 1] = -y / length_px[k], x / length_px[k]
        if np.isfinite(length_px[k]) and length_px[k] >= _MIN_LENGTH_PX:
            counts[k] = int(max((length_px[k] - 2.0 * _TRIM_PX) / _STEP_PX, 3.0))
        samples += counts[k]
    free_px = _free_reach(ends_px, normal, length_px, edges)
    xy_m, z_share, edge = np.empty((samples, 2)), np.empty(samples), np.empty(samples, dtype=np.int64)
    places, across, reach_px = np.empty((samples, 3)), np.empty((samples, 2)), np.empty(samples)
    n = 0
    for k in range(count):
        trim = _TRIM_PX / length_px[k]
        for within in range(counts[k]):
            share = trim + (1.0 - 2.0 * trim) * (within + 0.5) / counts[k]
            for axis in range(2):
                xy_m[n, axis] = edges[k, 0, axis] + share * (edges[k, 1, axis] - edges[k, 0, axis])
                places[n, axis], across[n, axis] = xy_m[n, axis], normal[k, axis]
            z_share[n] = edges[k, 0, 2] + share * (edges[k, 1, 2] - edges[k, 0, 2])
            places[n, 2], edge[n], reach_px[n] = z_share[n] * height_m, k, free_px[k]
            n += 1
        if counts[k] == 0:
            length_px[k] = 0.0
    points_px = seen(places, position_m, rotation, matrix, distortion, first_fold_r2)
    return xy_m, z_share, edge, points_px, across, reach_px, length_px, doubt_px, lower_side


@compiled
def _free_reach(ends_px: FloatArray, normal: FloatArray, length_px: FloatArray, edges: FloatArray) -> FloatArray:
    """Return (E,) half the distance from each edge to the nearest level one beside it, in px; inf if there is none.

    Upright edges are too short to hem in others, and edges that follow each other in one line do not hem each other in.
    """
    count = len(edges)
    reach = np.full(count, np.inf)
    for k in range(count):
        for other in range(count):
            if other == k or edges[other, 0, 2] != edges[other, 1, 2]:
                continue
            x = (ends_px[2 * other, 0] + ends_px[2 * other + 1, 0] - ends_px[2 * k, 0] - ends_px[2 * k + 1, 0]) / 2.0
            y = (ends_px[2 * other, 1] + ends_px[2 * other + 1, 1] - ends_px[2 * k, 1] - ends_px[2 * k + 1, 1]) / 2.0
            parallel = abs(normal[k, 0] * normal[other, 0] + normal[k, 1] * normal[other, 1]) > _PARALLEL_COSINE
            lengthwise = abs(x * normal[k, 1] - y * normal[k, 0])
            if parallel and lengthwise < _OVERLAP * (length_px[k] + length_px[other]) / 2.0:
                reach[k] = min(reach[k], abs(x * normal[k, 0] + y * normal[k, 1]) / 2.0)
    return reach
