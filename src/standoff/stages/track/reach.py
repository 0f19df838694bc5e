"""Which detection a track can have reached over the ground since it was last seen.

Where frames are far apart, boxes of one walker no longer overlap, but nobody leaves the circle that a run covers
between them. Places are kept in the site frame, so that it makes no difference how the camera moved meanwhile.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from standoff.core.classes import Role, class_ids
from standoff.core.homography import FloatArray
from standoff.core.types import Detections, GroundMap, IntArray, NoGroundMap
from standoff.stages.track.motion import MotionArray
from standoff.stages.track.params import TrackParams

PLACE_FIELDS: list[Any] = [
    ("place_m", np.float64, (2,)),
    ("place_rate_mps", np.float64, (2,)),
    ("place_s", np.float64),
    ("site_frame", np.int64),
]
"""Fields of a structured row: where it stood when it was last seen, how fast it went there from where it was seen
before, when, and in which site frame; NaN where no map told."""


def start(rows: MotionArray) -> None:
    """Fill rows in place: no place is known."""
    rows["place_m"], rows["place_rate_mps"], rows["place_s"] = np.nan, np.nan, np.nan


def standing_m(detections: Detections, ground: GroundMap | NoGroundMap) -> FloatArray:
    """Return (N, 2) where detections stand: their ground point, or the bottom centre of the box; NaN without a map."""
    if isinstance(ground, NoGroundMap) or not len(detections):
        return np.full((len(detections), 2), np.nan)
    left, _, right, bottom = detections.xyxy_px.T
    known = np.asarray(np.isfinite(detections.foot_px).all(axis=1))
    at_px = np.where(known[:, None], detections.foot_px, np.column_stack([(left + right) / 2.0, bottom]))
    places_m, _ = ground.to_ground(at_px)
    return places_m


def correct(
    rows: MotionArray, which: IntArray, places_m: FloatArray, ground: GroundMap | NoGroundMap, time_s: float
) -> None:
    """Take the places at which tracks were seen into some of the rows, in place.

    Args:
        rows: (N,) structured, with `PLACE_FIELDS`.
        which: (K,) indices of the rows that were seen, each at most once.
        places_m: (K, 2) site frame; NaN where no map tells.
        ground: The frame's map.
        time_s: Of the frame.
    """
    seen = rows[which]
    site_frame = -1 if isinstance(ground, NoGroundMap) else ground.site_frame
    step_s = time_s - seen["place_s"]
    moves = (seen["site_frame"] == site_frame) & (step_s > 0)
    rate_mps = (places_m - seen["place_m"]) / np.where(moves, step_s, np.nan)[:, None]
    seen["place_rate_mps"], seen["place_m"], seen["site_frame"], seen["place_s"] = (
        rate_mps,
        places_m,
        site_frame,
        time_s,
    )
    rows[which] = seen


def closeness(
    rows: MotionArray,
    class_id: IntArray,
    places_m: FloatArray,
    ground: GroundMap | NoGroundMap,
    time_s: float,
    params: TrackParams,
) -> FloatArray:
    """Return (M, N) how near each detection is to where a track would have gone, among what it can have reached.

    Args:
        rows: (M,) structured, with `PLACE_FIELDS`.
        class_id: (M,) of the tracks.
        places_m: (N, 2) where the detections stand.
        ground: The frame's map.
        time_s: Of the frame.
        params: How fast things get.

    Returns:
        1 where it is expected, down to 0 out of its reach; 0 where no map tells.
    """
    if isinstance(ground, NoGroundMap):
        return np.zeros((len(rows), len(places_m)))
    step_s = time_s - rows["place_s"]
    fastest_mps = np.where(np.isin(class_id, class_ids(Role.PERSON)), params.person_speed_mps, params.machine_speed_mps)
    reach_m = (params.place_slack_m + fastest_mps * step_s)[:, None]
    same_frame = (rows["site_frame"] == ground.site_frame)[:, None]
    moved_m = places_m - rows["place_m"][:, None]
    expected_m = np.nan_to_num(rows["place_rate_mps"]) * step_s[:, None]
    possible = same_frame & (np.linalg.norm(moved_m, axis=2) <= reach_m)
    surprise = np.linalg.norm(moved_m - expected_m[:, None], axis=2) / (2.0 * reach_m)
    return np.where(possible, 1.0 - surprise**2, 0.0)
