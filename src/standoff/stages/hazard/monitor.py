"""From the distances of each frame to hazards with a beginning, changes and an end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from standoff.core import protocols
from standoff.core.durations import is_apart
from standoff.core.homography import BoolArray
from standoff.core.roles import IS_EQUIPMENT
from standoff.core.types import GroundMap, GroundPositions, Hazard, NoGroundMap, Proximities, WatchedGround
from standoff.core.zones import Zone
from standoff.stages.hazard.absence import AbsenceWatch
from standoff.stages.hazard.alarm_load import AlarmLoad
from standoff.stages.hazard.latch import NOT_MEASURED, NOT_WATCHED, TRACK_LOST, LastPhase, Reading
from standoff.stages.hazard.levels import levels_of
from standoff.stages.hazard.life_cycle import HazardLifeCycle
from standoff.stages.hazard.newcomers import Newcomers
from standoff.stages.hazard.params import HazardParams
from standoff.stages.hazard.suspected import SuspectedHazards
from standoff.stages.hazard.unfollowed import UnfollowedHazard
from standoff.stages.hazard.zone import ZoneRule

Pair = tuple[int, int]

MAP_IS_BACK = "ground map is back"
STREAM_ENDED = "end of stream"
NOTHING_WATCHED = "no ground is watched"
HARDLY_WATCHED = "hardly any ground is watched"
WATCHED_AGAIN = "ground is watched again"

_NOBODY_JUDGED = WatchedGround()


class HazardMonitor(protocols.HazardMonitor):
    """Raise, follow and close the hazards of one stream.

    A hazard's first event is "opened", its last "closed", and nothing follows that. An event carries the
    time at which it is said, `min_duration_s` after the condition began; at once where frames are further apart than
    that, or where the first measurement of a pair is danger without doubt; and at the end of the stream for what only
    its last frames showed. What cannot be measured is never taken for safe: an open hazard becomes "unknown", a visible
    pair that stays unmeasured opens one of severity "unknown", and a stream without a ground map has one hazard of rule
    "measurement" in place of one for each pair; where many sure detections are in no track, or hardly any of the ground
    is watched, there is another one. So is there for a machine near which somebody may stand whom no track shows
    (`SuspectedHazards`). Zones have hazards of the same life (`ZoneRule`).

    Args:
        params: Settings; the defaults when left out.
        zones: Parts of the site with a rule of their own.
        machines: (C,) by class id, near which machines people are watched; all when left out.
        parked_after_s: Near a machine that has stood for so long nobody is suspected; None: near every one.
    """

    def __init__(
        self,
        params: HazardParams | None = None,
        zones: Sequence[Zone] = (),
        machines: BoolArray = IS_EQUIPMENT,
        parked_after_s: float | None = None,
    ) -> None:
        self._params = params or HazardParams()
        self._given_zones = tuple(zones)
        self._map = AbsenceWatch(self._params, MAP_IS_BACK)
        self._follow = UnfollowedHazard(self._params)
        self._sight = AbsenceWatch(self._params, WATCHED_AGAIN)
        self._pairs: dict[Pair, HazardLifeCycle] = {}
        self._newcomers = Newcomers[Pair]()
        self._load = AlarmLoad()
        self._looked_s = math.inf
        self._zones = ZoneRule(self._given_zones, self._params)
        self._suspected = SuspectedHazards(self._params, machines, parked_after_s)

    def describe(self) -> dict[str, Any]:
        """Return what there is to say of the stream so far, for the record."""
        warnings = [*self._follow.warnings, *self._zones.warnings, *self._load.warnings]
        return {"alarms": self._load.describe(), "warnings": warnings}

    def update(
        self,
        time_s: float,
        positions: GroundPositions,
        proximities: Proximities,
        ground: GroundMap | NoGroundMap,
        unfollowed: BoolArray,
        watched: WatchedGround = _NOBODY_JUDGED,
    ) -> tuple[Hazard, ...]:
        """Take one frame and return its events, the stream's own first, then by pair, by machine and by zone.

        Args:
            time_s: Presentation timestamp.
            positions: For the reasons why something is not measured, and which tracks are alive.
            proximities: All configured pairs.
            ground: The frame's map, or why there is none.
            unfollowed: (K,) which of the frame's sure detections are in no track.
            watched: Where a worker would be found.
        """
        no_map = (ground.reason or NOT_MEASURED) if isinstance(ground, NoGroundMap) else ""
        events = [
            self._map.update(time_s, no_map),
            self._follow.update(time_s, unfollowed),
            self._sight.update(time_s, "" if no_map else self._unseeing(watched)),
        ]
        rare = is_apart(self._looked_s, time_s, self._params.min_duration_s)
        self._looked_s = time_s
        readings = _readings(proximities)
        new = self._newcomers.among(
            time_s, [pair for pair, reading in readings.items() if not math.isnan(reading.gap_m)]
        )
        reasons = dict(zip(positions.track_id.tolist(), positions.reason.tolist(), strict=True))
        for pair in sorted(self._pairs.keys() | readings.keys()):
            watch = self._pairs.setdefault(pair, HazardLifeCycle("proximity", pair, self._params))
            reading = readings.get(pair)
            if reading is None:
                followed = reasons.keys() >= set(pair)
                events.append(watch.lose(time_s, NOT_WATCHED if followed else TRACK_LOST))
            elif (levels := levels_of(reading, self._params)) is not None:
                at_once = rare or (pair in new and levels.breached.sure)
                events.append(watch.measure(time_s, reading, levels.near, levels.breached, at_once=at_once))
            else:
                reason = reasons.get(pair[0]) or reasons.get(pair[1]) or NOT_MEASURED
                events.append(watch.miss(time_s, reason, may_open=bool(ground)))
        self._pairs = {pair: watch for pair, watch in self._pairs.items() if watch.is_open or pair in readings}
        events += self._suspected.update(time_s, positions, watched)
        events += self._zones.update(time_s, positions, ground, rare=rare)
        self._load.update(time_s, positions, events)
        return _said(events)

    def close(self, time_s: float) -> tuple[Hazard, ...]:
        """End the stream: close everything that is open."""
        return self._end(time_s, STREAM_ENDED, "closed")

    def lose(self, time_s: float, reason: str) -> tuple[Hazard, ...]:
        """End a stream that was lost: what is open is unknown from now on, and nobody says that it is over."""
        return self._end(time_s, reason, "unknown")

    def _end(self, time_s: float, reason: str, phase: LastPhase) -> tuple[Hazard, ...]:
        events = [one.end(time_s, reason, phase) for one in (self._map, self._follow, self._sight)]
        for pair in sorted(self._pairs):
            events += [self._pairs[pair].finish(time_s), self._pairs[pair].end(time_s, reason, phase)]
        self._map, self._pairs = AbsenceWatch(self._params, MAP_IS_BACK), {}
        self._newcomers = Newcomers[Pair]()
        self._sight = AbsenceWatch(self._params, WATCHED_AGAIN)
        events += self._suspected.end(time_s, reason, phase)
        return _said(events + self._zones.end(time_s, reason, phase))

    def _unseeing(self, watched: WatchedGround) -> str:
        """Return why a worker would hardly be found anywhere; "" where there is ground enough that is watched."""
        # What was too little is enough again only at twice as much: a share near the limit does not flicker.
        enough = (2.0 if self._sight.is_open else 1.0) * self._params.least_watched_share
        if not watched.judged or watched.share >= enough:
            return ""
        how_little = HARDLY_WATCHED if watched.share > 0.0 else NOTHING_WATCHED
        return ": ".join([how_little, *list(watched.unwatched)[:1]])

    def reset(self) -> None:
        """Forget everything without a word."""
        self._map = AbsenceWatch(self._params, MAP_IS_BACK)
        self._follow = UnfollowedHazard(self._params)
        self._sight = AbsenceWatch(self._params, WATCHED_AGAIN)
        self._pairs = {}
        self._newcomers = Newcomers[Pair]()
        self._load = AlarmLoad()
        self._looked_s = math.inf
        self._suspected.reset()
        self._zones = ZoneRule(self._given_zones, self._params)


def _readings(proximities: Proximities) -> dict[Pair, Reading]:
    columns = (
        proximities.track_a,
        proximities.track_b,
        proximities.distance_m,
        proximities.gap_m,
        proximities.sigma_m,
        proximities.breach_now,
        proximities.breach_ahead,
        proximities.excuse,
    )
    return {(a, b): Reading(*values) for a, b, *values in zip(*(c.tolist() for c in columns), strict=True)}


def _said(events: Iterable[Hazard | None]) -> tuple[Hazard, ...]:
    return tuple(event for event in events if event is not None)
