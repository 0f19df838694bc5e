"""The reference object as a solid: an upright prism over its outline, of which one camera sees some edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.pose import CHANGES, View
from standoff.core.types import IntArray
from standoff.stages.ground.projection import project
from standoff.stages.ground.shape import ReferenceShape

STATE = CHANGES + 1
"""Parameters of a change of a `SolidState`: those of a view, then the solid's height (m)."""

HEIGHT = CHANGES
"""The height's place among them."""

_STEP_PX = 1.5
_TRIM_PX = 3.0
"""Corners are rounded by every lens, and by every bricklayer."""

_MIN_LENGTH_PX = 9.0
_NARROW_PX = 3.0
"""The upper and the lower edge of a side that shows narrower than this are one edge of the picture, not two."""

_PARALLEL_COSINE, _OVERLAP = 0.9, 0.8
"""Edges run beside each other if they are this parallel and overlap by a fifth of their lengths."""


@dataclass(frozen=True, slots=True, eq=False)
class SolidState:
    """What the picture of a reference object depends on.

    Attributes:
        view: The camera in the site frame, whose z = 0 is the ground on which the reference stands.
        height_m: Of the reference's top above that ground.
    """

    view: View
    height_m: float

    def changed(self, change: FloatArray) -> SolidState:
        """Return the state after a change (9,)."""
        return SolidState(self.view.changed(change[:CHANGES]), max(self.height_m + float(change[HEIGHT]), 0.0))

    def change_from(self, other: SolidState) -> FloatArray:
        """Return the change (9,) that leads from another state to this one."""
        return np.append(self.view.change_from(other.view), self.height_m - other.height_m)


@dataclass(frozen=True, slots=True, eq=False)
class EdgeSamples:
    """Points along the edges of a solid that a camera can see, as it sees them.

    Attributes:
        xy_m: (N, 2) site frame.
        z_share: (N,) height of each as a share of the solid's: 0 at the base, 1 at the top.
        edge: (N,) which edge each is on.
        points_px: (N, 2) in the picture.
        normal: (N, 2) unit vectors across the edge.
        reach_px: (N,) how far across the edge a look must not go, because another edge is there.
        length_px: (E,) visible length of each edge; 0 where it is not sampled.
        doubt_px: (E,) standard error of where across the edge it really is.
        lower_side: (E,) the side whose lower edge each is; -1 for all others.
    """

    xy_m: FloatArray
    z_share: FloatArray
    edge: IntArray
    points_px: FloatArray
    normal: FloatArray
    reach_px: FloatArray
    length_px: FloatArray
    doubt_px: FloatArray
    lower_side: IntArray

    def __len__(self) -> int:
        return len(self.z_share)

    def points_m(self, height_m: float) -> FloatArray:
        """Return (N, 3) site frame for a height of the solid."""
        return np.column_stack([self.xy_m, self.z_share * height_m])


def facing_sides(shape: ReferenceShape, view: View) -> BoolArray:
    """Return (N,) which upright sides face the camera."""
    starts, ends = shape.corners_m, np.roll(shape.corners_m, -1, axis=0)
    along = ends - starts
    outward = np.column_stack([along[:, 1], -along[:, 0]])
    return np.asarray(((view.position_m[:2] - starts) * outward).sum(axis=1) > 0)


def visible_edges(shape: ReferenceShape, state: SolidState) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return the edges that the camera can see.

    Where a side shows as so narrow a strip that its upper and lower edge cannot be told apart, the two are one edge
    half way up, and in doubt by half the strip's width.

    Returns:
        (E, 2, 3): x, y and share of the height (0 base, 1 top) of both ends. The outline of the top first, side by
        side; then of the base and of the upright edges what faces the camera. Then (E,) the doubt in px, and (E,) the
        side whose lower edge it is, or -1.
    """
    corners = shape.corners_m
    following = np.roll(corners, -1, axis=0)
    faces = facing_sides(shape, state.view)
    strip_px = _strip_widths_px(shape, state)
    narrow = faces & (strip_px < _NARROW_PX)
    top = _level(np.where(narrow, 0.5, 1.0), corners, following)
    base = _level(np.zeros(len(corners)), corners, following)[faces & ~narrow]
    upright = _upright(corners)[faces | np.roll(faces, 1)]
    doubt_px = np.zeros(len(top) + len(base) + len(upright))
    doubt_px[: len(top)] = np.where(narrow, strip_px / 2.0, 0.0)
    lower_side = np.full(len(doubt_px), -1)
    lower_side[len(top) : len(top) + len(base)] = np.flatnonzero(faces & ~narrow)
    return np.concatenate([top, base, upright]), doubt_px, lower_side


def _level(share: FloatArray, starts: FloatArray, ends: FloatArray) -> FloatArray:
    return np.stack([np.column_stack([starts, share]), np.column_stack([ends, share])], axis=1)


def _upright(corners: FloatArray) -> FloatArray:
    high, low = np.ones(len(corners)), np.zeros(len(corners))
    return np.stack([np.column_stack([corners, high]), np.column_stack([corners, low])], axis=1)


def _strip_widths_px(shape: ReferenceShape, state: SolidState) -> FloatArray:
    """Return (N,) how far apart the middles of the upper and the lower edge of each side appear, across the edge."""
    corners = shape.corners_m
    following = np.roll(corners, -1, axis=0)
    middle = (corners + following) / 2.0
    height_m = state.height_m
    ends_m = [(corners, height_m), (following, height_m), (middle, height_m), (middle, 0.0)]
    places = np.concatenate([np.column_stack([xy, np.full(len(xy), z)]) for xy, z in ends_m])
    start, end, high, low = project(state.view, places).reshape(4, len(corners), 2)
    along = end - start
    with np.errstate(invalid="ignore", divide="ignore"):
        across = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    return np.asarray(np.abs(((high - low) * across).sum(axis=1)))


def sample_edges(shape: ReferenceShape, state: SolidState) -> EdgeSamples:
    """Put points on the visible edges, evenly in the picture, away from the corners."""
    edges, doubt_px, lower_side = visible_edges(shape, state)
    scale = np.array([1.0, 1.0, state.height_m])
    ends_px = project(state.view, (edges * scale).reshape(-1, 3)).reshape(-1, 2, 2)
    along = ends_px[:, 1] - ends_px[:, 0]
    length_px = np.linalg.norm(along, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        normal = np.column_stack([-along[:, 1], along[:, 0]]) / length_px[:, None]
    usable = np.isfinite(length_px) & (length_px >= _MIN_LENGTH_PX)
    counts = np.where(usable, np.maximum((length_px - 2.0 * _TRIM_PX) / _STEP_PX, 3.0), 0.0).astype(np.int64)
    edge = np.repeat(np.arange(len(edges)), counts)
    within = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)
    trim = _TRIM_PX / np.where(usable, length_px, 1.0)
    share = trim[edge] + (1.0 - 2.0 * trim[edge]) * (within + 0.5) / counts[edge]
    places = edges[edge, 0] + share[:, None] * (edges[edge, 1] - edges[edge, 0])
    return EdgeSamples(
        xy_m=places[:, :2],
        z_share=places[:, 2].copy(),
        edge=edge,
        points_px=project(state.view, places * scale),
        normal=normal[edge],
        reach_px=_free_reach(ends_px, normal, edges[:, 0, 2] == edges[:, 1, 2])[edge],
        length_px=np.where(usable, length_px, 0.0),
        doubt_px=doubt_px,
        lower_side=lower_side,
    )


def _free_reach(ends_px: FloatArray, normal: FloatArray, level: BoolArray) -> FloatArray:
    """Return (E,) half the distance from each edge to the nearest level one beside it, in px; inf if there is none.

    Upright edges are too short to hem in others.
    """
    middle = ends_px.mean(axis=1)
    along = ends_px[:, 1] - ends_px[:, 0]
    length = np.linalg.norm(along, axis=1)
    apart = middle[None] - middle[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        parallel = np.abs(normal @ normal.T) > _PARALLEL_COSINE
        across = np.abs((apart * normal[:, None]).sum(axis=2))
        lengthwise = np.abs((apart * (along / length[:, None])[:, None]).sum(axis=2))
        # Edges that follow each other in one line do not hem each other in.
        beside = lengthwise < _OVERLAP * (length[None] + length[:, None]) / 2.0
    across[~(parallel & beside & level)] = np.inf
    np.fill_diagonal(across, np.inf)
    reach: FloatArray = across.min(axis=1) / 2.0
    return reach
