"""Where somebody may stand: what looks a little like a worker, and is in no track.

Of the workers whom no track shows, two thirds are seen all the same, but not surely enough to start a track. To call
the ground under them watched and clear would be wrong; to warn of each would be to warn of cones and barrels. So for a
while the ground there is unknown.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from standoff.core.boxes import areas_px2, shared_px2
from standoff.core.classes import CAB_WITHIN_M
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.roles import IS_PERSON
from standoff.core.types import Detections, GroundMap, Tracks
from standoff.core.watched_ground import COLUMNS, ROWS, cell_of
from standoff.stages.watched.params import WatchedParams

_SAME_PLACE_M: Final = 0.5
_SAME_PERSON: Final = 0.5
"""Part of the smaller box that a detection shares with a track's: half a person is seen beside the whole one."""


class Suspects:
    """Remember where on the ground of one stream somebody may stand.

    Args:
        params: How sure, for how long and how far around.
    """

    def __init__(self, params: WatchedParams) -> None:
        self._params = params
        self._places_m: FloatArray = np.zeros((0, 2))
        self._seen_s: FloatArray = np.zeros(0)
        self._site_frame = -1

    def note(self, time_s: float, detections: Detections, tracks: Tracks, ground: GroundMap) -> None:
        """Take what was detected in a frame; of whom a track shows, where he is is known."""
        if ground.site_frame != self._site_frame:
            self._places_m, self._seen_s, self._site_frame = np.zeros((0, 2)), np.zeros(0), ground.site_frame
        people_px = tracks.xyxy_px[IS_PERSON[tracks.class_id]]
        maybe = np.flatnonzero(IS_PERSON[detections.class_id] & (detections.score >= self._params.suspect_score))
        maybe = maybe[~_is_one_of(detections.xyxy_px[maybe], people_px)]
        if not len(maybe) and not len(self):
            return
        places_m, on_ground = ground.to_ground(_feet_px(detections[maybe]))
        lasting = (time_s - self._seen_s <= self._params.suspect_s) & ~self._shown(people_px, ground)
        self._places_m = np.concatenate([places_m[on_ground], self._places_m[lasting]])
        self._seen_s = np.concatenate([np.full(np.count_nonzero(on_ground), time_s), self._seen_s[lasting]])
        # Who is seen again and again is remembered once, as of the last time.
        newest = np.unique(np.round(self._places_m / _SAME_PLACE_M), axis=0, return_index=True)[1]
        self._places_m, self._seen_s = self._places_m[newest], self._seen_s[newest]

    def __len__(self) -> int:
        """Return how many places are remembered."""
        return len(self._places_m)

    def cells(self, ground: GroundMap, size_px: tuple[int, int], around: FloatArray) -> BoolArray:
        """Tell (ROWS, COLUMNS) where somebody may stand.

        Args:
            ground: The frame's map.
            size_px: (width, height) of the picture.
            around: (N, 2) points that stand for the unit circle.
        """
        cells = np.zeros((ROWS, COLUMNS), dtype=np.bool_)
        if not len(self):
            return cells
        points_m = self._places_m[:, None] + self._params.suspect_radius_m * around
        points_px, seen = ground.to_image(points_m.reshape(-1, 2))
        places, inside = cell_of(points_px, size_px)
        places = places[seen & inside]
        cells[places[:, 0], places[:, 1]] = True
        return cells

    def near(self, xy_m: FloatArray, reach_m: FloatArray) -> BoolArray:
        """Tell (N,) within whose reach somebody may stand who is on none of them.

        Args:
            xy_m: (N, 2) where machines are, site frame.
            reach_m: (N,).
        """
        away_m = np.linalg.norm(self._places_m[:, None] - xy_m, axis=2)
        beside = ~(away_m <= CAB_WITHIN_M).any(axis=1, keepdims=True)
        return np.asarray((beside & (away_m < reach_m)).any(axis=0))

    def _shown(self, people_px: FloatArray, ground: GroundMap) -> BoolArray:
        """Tell (N,) of which places a track's box holds the picture now."""
        points_px, seen = ground.to_image(self._places_m)
        left, top, right, bottom = people_px.T[:, :, None]
        # Who was suspected at his feet is followed by a box that ends there, or a little above.
        low = bottom + 0.25 * (bottom - top)
        x, y = points_px.T
        held = (x >= left) & (x <= right) & (y >= top) & (y <= low)
        return np.asarray(seen & held.any(axis=0))


def _is_one_of(maybe_px: FloatArray, people_px: FloatArray) -> BoolArray:
    """Tell (N,) which boxes show one of the people."""
    smaller_px2 = np.minimum(areas_px2(maybe_px)[:, None], areas_px2(people_px))
    return np.asarray((shared_px2(maybe_px, people_px) >= _SAME_PERSON * smaller_px2).any(axis=1))


def _feet_px(detections: Detections) -> FloatArray:
    """Return (N, 2) where things stand: their ground points, or the middles of the lower edges."""
    left, _, right, bottom = detections.xyxy_px.T
    below_px = np.column_stack([(left + right) / 2.0, bottom])
    return np.where(np.isfinite(detections.foot_px), detections.foot_px, below_px)
