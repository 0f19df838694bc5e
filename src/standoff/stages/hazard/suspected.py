"""Machines near which somebody may stand whom no track shows: he has no distance, and is not nobody."""

from __future__ import annotations

import math

import numpy as np

from standoff.core.homography import BoolArray
from standoff.core.types import PARKED, GroundPositions, Hazard, WatchedGround
from standoff.stages.hazard.latch import TRACK_LOST, LastPhase, Reading
from standoff.stages.hazard.life_cycle import HazardLifeCycle, Limit
from standoff.stages.hazard.params import HazardParams

SOMEBODY_NEAR = "somebody may stand near it"
NOBODY_NEAR = "nobody is suspected near it any more"

_GONE, _PARKED = (Reading(math.nan, math.nan, math.nan, excuse=excuse) for excuse in (NOBODY_NEAR, PARKED))
_CLEAR = Limit(passed=False, clear=True)


class SuspectedHazards:
    """The hazards, of unknown severity, of machines within whose reach somebody may stand.

    Args:
        params: Settings; the same durations as for a pair that cannot be measured: most who come into a picture are in
            a track before.
        machines: (C,) by class id, near which of them people are watched.
        parked_after_s: A machine that has stood for so long has none; None: every one may have.
    """

    def __init__(self, params: HazardParams, machines: BoolArray, parked_after_s: float | None) -> None:
        self._params, self._machines, self._parked_after_s = params, machines, parked_after_s
        self._watches: dict[int, HazardLifeCycle] = {}

    def update(self, time_s: float, positions: GroundPositions, watched: WatchedGround) -> list[Hazard | None]:
        """Take a frame and return its events by track; of a machine without a place, or where nobody judged, none."""
        judged = len(watched.suspects) == len(positions)
        parked = positions.parked(self._parked_after_s)
        due = watched.suspects & self._machines[positions.class_id] & ~parked if judged else np.zeros_like(parked)
        alive = set(positions.track_id.tolist())
        near, placed, at_rest = (
            set(positions.track_id[rows].tolist()) for rows in (due, positions.valid & judged, parked)
        )
        events: list[Hazard | None] = []
        for track in sorted(self._watches.keys() | near):
            watch = self._watches.setdefault(track, HazardLifeCycle("proximity", (track,), self._params))
            if track not in alive:
                events.append(watch.lose(time_s, TRACK_LOST))
            elif track in near:
                events.append(watch.miss(time_s, SOMEBODY_NEAR, may_open=True))
            elif track in placed:
                over = _PARKED if track in at_rest else _GONE
                events.append(watch.measure(time_s, over, _CLEAR, _CLEAR))
        self._watches = {track: watch for track, watch in self._watches.items() if watch.is_open or track in near}
        return events

    def end(self, time_s: float, reason: str, phase: LastPhase = "closed") -> list[Hazard | None]:
        """End everything that is open, and forget it."""
        events = [self._watches[track].end(time_s, reason, phase) for track in sorted(self._watches)]
        self.reset()
        return events

    def reset(self) -> None:
        """Forget everything without a word."""
        self._watches = {}
