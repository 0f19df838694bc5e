"""The ways that people take about a site who keep off the ground of machines."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from scipy.sparse.csgraph import dijkstra

from standoff.core.homography import BoolArray, FloatArray

_ROUND_M = 0.3
"""Corners lie so far outside of what is avoided, so that a way along them does not touch it."""
_CORNERS_A_QUARTER = 4
_KNOT_M = 2.0
_APART_M = 1e-3
_TURNS_BACK = -0.9999
"""The cosine of a turn that no rounding of its corner makes a way of."""
_HALVINGS = 2


class Footpaths:
    """The shortest ways around what people avoid.

    Corners of what is avoided that see each other make a graph; ways lead along it.

    Args:
        avoided: Nobody walks over this.
    """

    def __init__(self, avoided: shapely.Geometry) -> None:
        self._avoided = avoided
        shapely.prepare(self._avoided)
        outer = avoided.buffer(_ROUND_M, quad_segs=_CORNERS_A_QUARTER).simplify(_ROUND_M / 2.0)
        corners = shapely.get_coordinates(outer)
        self._corners_m: FloatArray = corners[self.are_free(corners)]
        self._lengths_m = self._seen(self._corners_m, self._corners_m)

    def are_free(self, points_m: FloatArray) -> BoolArray:
        """Tell (N,) which points (N, 2) are not avoided."""
        free: BoolArray = ~shapely.intersects(self._avoided, shapely.points(points_m))
        return free

    def way(self, start_m: FloatArray, end_m: FloatArray) -> FloatArray | None:
        """Return (K, 2) points of the shortest way, with rounded corners; None where there is none.

        An end on avoided ground is left, or reached, over the nearest point outside.

        Args:
            start_m: (2,).
            end_m: (2,).
        """
        ends = np.array([self._nearest_free(start_m), self._nearest_free(end_m)])
        nodes = np.concatenate([ends, self._corners_m])
        lengths_m = np.zeros((len(nodes), len(nodes)))
        lengths_m[2:, 2:] = self._lengths_m
        lengths_m[:2] = self._seen(ends, nodes)
        lengths_m[2:, :2] = lengths_m[:2, 2:].T
        total_m, before = dijkstra(lengths_m, indices=[0], return_predecessors=True)
        if not np.isfinite(total_m[0, 1]):
            return None
        visited = [1]
        while visited[-1] != 0:
            visited.append(int(before[0, visited[-1]]))
        points = [start_m, *nodes[visited[::-1]], end_m]
        return rounded(np.array(points))

    def _nearest_free(self, point_m: FloatArray) -> FloatArray:
        if self.are_free(point_m[None])[0]:
            return point_m
        outside = self._avoided.buffer(_ROUND_M).boundary
        line_m = shapely.get_coordinates(shapely.shortest_line(shapely.Point(point_m), outside))
        return np.asarray(line_m[1])

    def _seen(self, starts_m: FloatArray, ends_m: FloatArray) -> FloatArray:
        """Return (N, M) how far points are from those that they see; 0, which is no edge, from others."""
        ends = np.broadcast_to(ends_m, (len(starts_m), *ends_m.shape))
        starts = np.broadcast_to(starts_m[:, None], ends.shape)
        sights = shapely.linestrings(np.stack([starts, ends], axis=2))
        lengths: FloatArray = np.linalg.norm(starts - ends, axis=2)
        seen: FloatArray = np.where(shapely.intersects(self._avoided, sights), 0.0, lengths)
        return seen


def rounded(points_m: FloatArray) -> FloatArray:
    """Return a way (K, 2) as people walk it: corners cut, a point every two metres at least.

    Source:
        Chaikin, An algorithm for high-speed curve generation, 1974.
    """
    points_m = _divided(_without_spurs(points_m))
    for _ in range(_HALVINGS if len(points_m) > 2 else 0):
        quarter, most = 0.75 * points_m[:-1] + 0.25 * points_m[1:], 0.25 * points_m[:-1] + 0.75 * points_m[1:]
        inner = np.stack([quarter, most], axis=1).reshape(-1, 2)
        points_m = np.concatenate([points_m[:1], inner[1:-1], points_m[-1:]])
    return points_m


def _without_spurs(points_m: FloatArray) -> FloatArray:
    """Leave out what is there twice, and where a way goes only to come back, as out of a circle and into it again."""
    kept: list[FloatArray] = []
    for point_m in points_m:
        while len(kept) > 1 and _turns_back(kept[-2], kept[-1], point_m):
            kept.pop()
        if not kept or np.linalg.norm(point_m - kept[-1]) > _APART_M:
            kept.append(point_m)
    return np.array(kept)


def _turns_back(before_m: FloatArray, at_m: FloatArray, after_m: FloatArray) -> bool:
    there, back = at_m - before_m, after_m - at_m
    return bool(there @ back < _TURNS_BACK * np.linalg.norm(there) * np.linalg.norm(back))


def _divided(points_m: FloatArray) -> FloatArray:
    """Add points on long legs, so that rounding cuts no more than a corner."""
    pieces = [points_m[:1]]
    for start_m, end_m in pairwise(points_m):
        count = max(1, int(np.ceil(np.linalg.norm(end_m - start_m) / _KNOT_M)))
        pieces.append(start_m + (end_m - start_m) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(pieces)
