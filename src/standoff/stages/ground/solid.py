"""The reference object as a solid: an upright prism over its outline, of which one camera sees some edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.pose import CHANGES, View
from standoff.core.types import IntArray
from standoff.stages.ground.projection import eye_of
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid_samples import find_visible, put_samples

STATE = CHANGES + 1
"""Parameters of a change of a `SolidState`: those of a view, then the solid's height (m)."""

HEIGHT = CHANGES
"""The height's place among the changes of a state: behind those of the view."""


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
        change = np.empty(STATE)
        change[:CHANGES], change[HEIGHT] = self.view.change_from(other.view), self.height_m - other.height_m
        return change


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
    return find_visible(np.ascontiguousarray(shape.corners_m), state.height_m, *eye_of(state.view))


def sample_edges(shape: ReferenceShape, state: SolidState) -> EdgeSamples:
    """Put points on the visible edges, evenly in the picture, away from the corners."""
    return EdgeSamples(*put_samples(np.ascontiguousarray(shape.corners_m), state.height_m, *eye_of(state.view)))
