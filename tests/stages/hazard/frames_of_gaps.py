"""Frames of pairs with given gaps, and what the hazard stage makes of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from standoff.core.types import GroundMap, GroundPositions, Hazard, NoGroundMap, Proximities
from standoff.stages.hazard import HazardMonitor, HazardParams

GROUND = GroundMap(np.eye(3), np.zeros((9, 9)), (1920, 1080), "exact", 0.02)
FOLLOWED = np.zeros(1, dtype=np.bool_)
NO_GROUND = NoGroundMap("reference not found")
CUT_OFF = "cut off by the picture's edge"
NAN = math.nan
STEP_S = 0.125
"""A step that floating point knows exactly."""
CALM = HazardParams(rule="distance", min_duration_s=0.25, release_s=0.5, update_every_s=1000.0, unknown_after_s=1.0)

Pair = tuple[int, int]
Gaps = dict[Pair, float]


def frame(gaps: Gaps, sigma_m: float = 0.1, order: Sequence[int] | None = None) -> tuple[GroundPositions, Proximities]:
    """Return the rows of one frame; a gap of NaN is a pair that was not measured because one track is cut off."""
    tracks = sorted({track for pair in gaps for track in pair})
    lost = {track for track in tracks if all(math.isnan(gap) for pair, gap in gaps.items() if track in pair)}
    valid = np.array([track not in lost for track in tracks], dtype=np.bool_)
    count = len(tracks)
    positions = GroundPositions(
        track_id=np.array(tracks, dtype=np.int64),
        class_id=np.zeros(count, dtype=np.int64),
        xy_m=np.where(valid[:, None], np.zeros((count, 2)), np.nan),
        velocity_mps=np.zeros((count, 2)),
        state_covariance=np.zeros((count, 4, 4)),
        map_factor_m=np.zeros((count, 2, 10)),
        predicted=np.zeros(count, dtype=np.bool_),
        standing_s=np.zeros(count),
        radius_m=np.zeros(count),
        valid=valid,
        reason=np.where(valid, "", CUT_OFF).astype(object),
    )
    pairs, gap_m = [*gaps], np.array([*gaps.values()], dtype=np.float64)
    proximities = Proximities(
        track_a=np.array([a for a, _ in pairs], dtype=np.int64),
        track_b=np.array([b for _, b in pairs], dtype=np.int64),
        distance_m=gap_m + 7.8,
        gap_m=gap_m,
        sigma_m=gap_m * 0.0 + sigma_m,
        closing_mps=gap_m * 0.0,
        time_to_contact_s=gap_m * np.nan,
        filtered=np.zeros(len(pairs), dtype=np.bool_),
    )
    return positions, proximities if order is None else proximities[np.array(order, dtype=np.int64)]


def events_of(
    frames: Iterable[Gaps | NoGroundMap], params: HazardParams = CALM, *, step_s: float = STEP_S
) -> list[Hazard]:
    """Run a monitor over frames of gaps by pair; a missing map leaves pair (1, 2) unmeasured."""
    monitor = HazardMonitor(params)
    events: list[Hazard] = []
    for index, gaps in enumerate(frames):
        ground = gaps if isinstance(gaps, NoGroundMap) else GROUND
        rows = frame({(1, 2): NAN} if isinstance(gaps, NoGroundMap) else gaps)
        events += monitor.update(step_s * index, *rows, ground, FOLLOWED)
    return events


def events_of_likely(breaches: Iterable[float], params: HazardParams) -> list[Hazard]:
    """Run a monitor over frames of one pair that is in breach so likely, now and ahead; NaN is not measured."""
    monitor = HazardMonitor(params)
    events: list[Hazard] = []
    for index, likely in enumerate(breaches):
        positions, pairs = frame({(1, 2): likely * 0.0})
        known = replace(pairs, breach_now=np.array([likely]), breach_ahead=np.array([likely]))
        events += monitor.update(STEP_S * index, positions, known, GROUND, FOLLOWED)
    return events


def pair_events(gaps_m: Iterable[float], params: HazardParams = CALM) -> list[Hazard]:
    return events_of([{(1, 2): gap_m} for gap_m in gaps_m], params)


def told(events: Iterable[Hazard]) -> list[tuple[str, str, float]]:
    return [(event.phase, event.severity, event.time_s) for event in events]
