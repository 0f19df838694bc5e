"""What hides what in a picture, without a renderer: lumps drawn as convex outlines, far ones first.

An approximation, and how far it goes: what is visible as a whole has the box of its projected corners, cut at the
picture's edge, to a fraction of a pixel. What is partly hidden is off by the roundness of its lumps: a lump is convex,
hides and is hidden as its middle is near or far, and has no holes. What is under the ground is raised to it. Bars,
wires, what is lower than a hand above the ground, and hills hide nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.camera import Camera
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.pose import View
from standoff_sim.clip.truth import Sight
from standoff_sim.scene.moment import EntityState, Moment
from standoff_sim.scene.scene import NOTHING, Batch, GroundSurface, Scene
from standoff_sim.solids.lumps import IntArray, Lumps, lumps_of

_WIDEST_PX = 1280
"""Wider pictures are drawn smaller by a whole factor."""
_SUB_BITS = 4
_LOW_M = 0.12
"""Lumps that end below this above the ground, or are flatter, hide nothing."""
_SMALL_M, _LARGE_M = 0.15, 12.0
"""Radii of lumps that count; what is larger is a street or a field."""
_AWAY_M = 150.0
_EDGE_PX = 1.5
"""A visible part whose edge is this near to that of the silhouette ends where the whole ends."""
_BEHIND_ALL_M = 1e6
_VEHICLE_M = 6.0
_LENS_SHARE = 0.06
"""Of the picture's width, by which a lens moves what is in the picture, at most."""
_FAR_OUT_PX = 2e4
_CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)

_SOMETHING = 0xFFFE
"""In the picture of ids: what hides entities and is none."""

Polygon = npt.NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class _Still:
    """Lumps that stand still, with balls around them.

    Attributes:
        lumps: Site frame.
        centre_m: (L, 3).
        radius_m: (L,).
    """

    lumps: Lumps
    centre_m: FloatArray
    radius_m: FloatArray

    @classmethod
    def of(cls, batches: Sequence[Batch], ground: GroundSurface) -> _Still:
        """Take what is large, near and high enough to hide somebody."""
        lumps = lumps_of(batches, wires=False)
        if not len(lumps.starts):
            return cls(lumps, np.empty((0, 3)), np.empty(0))
        low = np.minimum.reduceat(lumps.points_m, lumps.starts, axis=0).astype(np.float64)
        high = np.maximum.reduceat(lumps.points_m, lumps.starts, axis=0).astype(np.float64)
        centre_m, radius_m = (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2
        above_m = np.minimum(high[:, 2] - ground.height_at(centre_m[:, :2]), high[:, 2] - low[:, 2])
        sized = (radius_m > _SMALL_M) & (radius_m < _LARGE_M)
        kept = (above_m > _LOW_M) & sized & (np.abs(centre_m[:, :2]).max(axis=1) < _AWAY_M)
        return cls(lumps.chosen(kept), centre_m[kept], radius_m[kept])

    def before(self, view: View, boxes_px: FloatArray, farthest_m: float) -> Lumps:
        """Return the lumps that may be in front of what (N, 4) boxes show, at most so far away."""
        away_m = np.linalg.norm(self.centre_m - view.position_m, axis=1)
        near = np.flatnonzero(away_m < farthest_m)
        centre_px, radius_m = view.project_pinhole(self.centre_m[near]), self.radius_m[near]
        reach_px = view.camera.matrix[0, 0] * radius_m / np.maximum(away_m[near] - radius_m, 0.5)
        reach_px = (reach_px * 1.2 + _LENS_SHARE * view.camera.width_px)[:, None]
        low_px, high_px = centre_px - reach_px, centre_px + reach_px
        meets = np.zeros(len(near), bool)
        for x1, y1, x2, y2 in boxes_px.tolist():
            across = (high_px[:, 0] > x1) & (low_px[:, 0] < x2)
            meets |= across & (high_px[:, 1] > y1) & (low_px[:, 1] < y2)
        return self.lumps.chosen(near[meets])


class _Thing(NamedTuple):
    """What is to be drawn: an entity's id or NOTHING, its lumps, the ground's height under it."""

    entity_id: int
    lumps: Lumps
    ground_m: float


@dataclass(frozen=True, slots=True, eq=False)
class _Outline:
    """Projected lumps of one thing; polygons are convex, in steps of 1 / 2**_SUB_BITS drawn pixels.

    Attributes:
        entity_id: Or NOTHING.
        above: What shows above the ground.
        whole: The same with what is under the ground.
        order_m: Of each polygon; larger is drawn earlier.
        above_px: (4,) box of what is above the ground; NaN as in `Sight.full_px`.
        full_px: (4,) as of `Sight`.
    """

    entity_id: int
    above: list[Polygon]
    whole: list[Polygon]
    order_m: FloatArray
    above_px: FloatArray
    full_px: FloatArray


class Outlines:
    """Tells how the entities of a scene show.

    Args:
        scene: Whose.
    """

    def __init__(self, scene: Scene) -> None:
        camera: Camera = scene.flight.view(0.0).camera
        self._size_px = np.array([camera.width_px, camera.height_px])
        self._factor = max(1, round(camera.width_px / _WIDEST_PX))
        self._props = _Still.of([batch for batch in scene.props if batch.entity_id == NOTHING], scene.ground)
        self._parked = {batch.entity_id: lumps_of([batch]) for batch in scene.parked}
        self._parked_m = np.array([batch.poses[0, :3, 3] for batch in scene.parked], np.float64).reshape(-1, 3)
        reference = scene.reference
        self._carpet = reference.entity_id if reference is not None and reference.height_m < _LOW_M else NOTHING

    def sights(self, moment: Moment) -> list[tuple[EntityState, Sight]]:
        """Return every body, and the parked vehicles that show, with how they show."""
        view = moment.view
        showing = self._may_show(view)
        parked = [body for body, shows in zip(moment.parked, showing, strict=True) if shows]
        things = [_Thing(body.entity_id, lumps_of(body.batches), float(body.centre_m[2])) for body in moment.bodies]
        things += [_Thing(body.entity_id, self._parked[body.entity_id], -np.inf) for body in parked]
        outlines = self._outlined(things, view)
        ids = self._draw([*outlines, *self._hiding(moment, outlines)])
        sights = [self._sight(outline, ids) for outline in outlines]
        bodies = zip((*moment.bodies, *parked), sights, strict=True)
        count = len(moment.bodies)
        return [pair for k, pair in enumerate(bodies) if k < count or pair[1].visible_px]

    def _may_show(self, view: View) -> BoolArray:
        """Return which parked vehicles may be in the picture."""
        away_m = np.linalg.norm(self._parked_m - view.position_m, axis=1)
        margin_px = _VEHICLE_M * view.camera.matrix[0, 0] / np.maximum(away_m, _VEHICLE_M)
        margin_px = (margin_px + _LENS_SHARE * view.camera.width_px)[:, None]
        centre_px = view.project_pinhole(self._parked_m)
        return np.asarray(((centre_px > -margin_px) & (centre_px < self._size_px + margin_px)).all(axis=1))

    def _hiding(self, moment: Moment, outlines: Sequence[_Outline]) -> list[_Outline]:
        """Return what else may stand before the entities: props, loads, covers of the reference object."""
        boxes_px = np.array([self._inside(outline.above_px) for outline in outlines]).reshape(-1, 4)
        boxes_px = boxes_px[np.isfinite(boxes_px).all(axis=1)]
        farthest_m = max((float(outline.order_m.max(initial=0.0)) for outline in outlines), default=0.0)
        carried = [batch for body in moment.bodies for batch in body.carried]
        lumps = [lumps_of([*carried, *moment.loose]), self._props.before(moment.view, boxes_px, farthest_m)]
        return self._outlined([_Thing(NOTHING, Lumps.joined(lumps), -np.inf)], moment.view)

    def _inside(self, box_px: FloatArray) -> FloatArray:
        """Return a box cut at the picture's edge; NaN when nothing is left."""
        low, high = np.maximum(box_px[:2], -0.5), np.minimum(box_px[2:], self._size_px - 0.5)
        return np.concatenate([low, high]) if (low < high).all() else np.full(4, np.nan)

    def _outlined(self, things: Sequence[_Thing], view: View) -> list[_Outline]:
        """Project all lumps at once and take the convex outline of each that is in front of the camera."""
        lumps = Lumps.joined([thing.lumps for thing in things])
        sizes = [len(thing.lumps.points_m) for thing in things]
        ground_m = np.repeat([thing.ground_m for thing in things], sizes)
        under = lumps.points_m[:, 2] < ground_m
        full_px = view.project(lumps.points_m.astype(np.float64))
        above_px = full_px.copy()
        above_px[under] = view.project(np.column_stack([lumps.points_m[under, :2], ground_m[under]]))
        away_m = np.linalg.norm(lumps.points_m - view.position_m, axis=1)
        outlines, first = [], 0
        for thing, size in zip(things, sizes, strict=True):
            own = slice(first, first + size)
            first = own.stop
            outlines.append(self._outline(thing, full_px[own], above_px[own], away_m[own], bool(under[own].any())))
        return outlines

    def _outline(
        self, thing: _Thing, full_px: FloatArray, above_px: FloatArray, away_m: FloatArray, dug_in: bool
    ) -> _Outline:
        starts, counts = thing.lumps.starts, thing.lumps.counts
        if not len(starts):
            return _Outline(thing.entity_id, [], [], np.empty(0), np.full(4, np.nan), np.full(4, np.nan))
        shown = np.logical_and.reduceat(np.isfinite(full_px + above_px).all(axis=1), starts)
        order_m = np.add.reduceat(away_m, starts)[shown] / counts[shown]
        if thing.entity_id == self._carpet != NOTHING:
            order_m += _BEHIND_ALL_M
        above = self._polygons(above_px, starts[shown], counts[shown])
        whole = self._polygons(full_px, starts[shown], counts[shown]) if dug_in else above
        return _Outline(thing.entity_id, above, whole, order_m, _box(above_px), _box(full_px))

    def _polygons(self, points_px: FloatArray, starts: IntArray, counts: IntArray) -> list[Polygon]:
        drawn_px = np.clip((points_px + 0.5) / self._factor - 0.5, -_FAR_OUT_PX, _FAR_OUT_PX)
        steps = np.round(np.nan_to_num(drawn_px) * (1 << _SUB_BITS)).astype(np.int32)
        spans = zip(starts.tolist(), counts.tolist(), strict=True)
        return [cv2.convexHull(steps[start : start + count])[:, 0] for start, count in spans]

    def _draw(self, outlines: Sequence[_Outline]) -> npt.NDArray[np.uint16]:
        """Return the picture of ids, far lumps drawn first."""
        width, height = np.ceil(self._size_px / self._factor).astype(int).tolist()
        ids = np.zeros((height, width), np.uint16)
        polygons = [(polygon, outline.entity_id) for outline in outlines for polygon in outline.above]
        order_m = np.concatenate([np.empty(0), *(outline.order_m for outline in outlines)])
        for k in np.argsort(-order_m, kind="stable").tolist():
            polygon, entity_id = polygons[k]
            cv2.fillConvexPoly(ids, polygon, entity_id or _SOMETHING, cv2.LINE_8, _SUB_BITS)
        return ids

    def _sight(self, outline: _Outline, ids: npt.NDArray[np.uint16]) -> Sight:
        nothing = Sight(np.full(4, np.nan), outline.full_px, 0, 0.0)
        if not outline.above:
            return nothing
        (left, top), (right, bottom) = self._window(outline.above)
        alone = self._untouched(outline, ids[max(top, 0) : bottom, max(left, 0) : right], right - left, bottom - top)
        if alone is None:
            alone = self._silhouette(outline.above)
        dug_in = outline.whole is not outline.above
        whole = alone if not dug_in else self._silhouette(outline.whole)
        own_ids = ids[max(top, 0) : top + alone.shape[0], max(left, 0) : left + alone.shape[1]]
        seen = own_ids == outline.entity_id
        inside = alone[max(-top, 0) :, max(-left, 0) :][: seen.shape[0], : seen.shape[1]] > 0
        if not seen.any():
            return nothing
        count, whole_count = np.count_nonzero(seen), np.count_nonzero(whole)
        # a polygon is filled with its border, half of whose pixels lie outside
        outside = 0.5 * (whole_count - np.count_nonzero(cv2.erode(whole, _CROSS, borderValue=0)))
        visible_px = max(1, round(count * (1.0 - outside / whole_count) * self._factor**2))
        seen_px, inside_px = _extent(seen), _extent(inside)
        exact_px = self._inside(outline.above_px)
        measured_px = (seen_px + np.maximum([left, top, left, top], 0)) * self._factor - 0.5
        ends = (np.abs(seen_px - inside_px) <= _EDGE_PX) & np.isfinite(exact_px)
        edges_px = np.where(ends, exact_px, measured_px)
        # Where hardly a pixel shows, an exact edge may lie beyond a measured one.
        crossed = np.tile(edges_px[:2] >= edges_px[2:], 2)
        box_px = np.where(crossed, measured_px, edges_px)
        return Sight(box_px, outline.full_px, visible_px, min(1.0, count / whole_count))

    def _untouched(
        self, outline: _Outline, own_ids: npt.NDArray[np.uint16], width: int, height: int
    ) -> npt.NDArray[np.uint8] | None:
        """Read a silhouette off the picture of ids where nothing else is near; None where something is."""
        if own_ids.shape != (height, width) or outline.whole is not outline.above:
            return None
        alone = own_ids == outline.entity_id
        return alone.astype(np.uint8) if np.count_nonzero(alone) == np.count_nonzero(own_ids) else None

    def _window(self, polygons: Sequence[Polygon]) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return column and row of the first pixel around polygons and of the one after the last.

        It ends one picture's size outside the picture.
        """
        size = np.ceil(self._size_px / self._factor).astype(np.int64)
        corners = np.concatenate(polygons).astype(np.int64)
        low = np.clip((corners.min(axis=0) >> _SUB_BITS) - 1, -size, 2 * size - 1)
        high = np.maximum(np.clip((corners.max(axis=0) >> _SUB_BITS) + 3, -size, 2 * size), low + 1)
        return (int(low[0]), int(low[1])), (int(high[0]), int(high[1]))

    def _silhouette(self, polygons: Sequence[Polygon]) -> npt.NDArray[np.uint8]:
        """Draw polygons alone, in their window."""
        (left, top), (right, bottom) = self._window(polygons)
        mask = np.zeros((bottom - top, right - left), np.uint8)
        shift = np.array([left << _SUB_BITS, top << _SUB_BITS], np.int32)
        for polygon in polygons:
            cv2.fillConvexPoly(mask, polygon - shift, 1, cv2.LINE_8, _SUB_BITS)
        return mask


def _box(points_px: FloatArray) -> FloatArray:
    return np.concatenate([points_px.min(axis=0), points_px.max(axis=0)])


def _extent(mask: BoolArray) -> FloatArray:
    """Return (4,) first column, first row, last column + 1, last row + 1 of what is set; NaN where nothing is."""
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    if not len(rows):
        return np.full(4, np.nan)
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], dtype=np.float64)
