"""From the distances of each frame to hazards with a beginning, changes and an end."""

from __future__ import annotations

import math
from collections.abc import Iterable

from standoff.core.homography import BoolArray
from standoff.core.types import GroundMap, GroundPositions, Hazard, NoGroundMap, Proximities
from standoff.stages.hazard.follow import FollowWatch
from standoff.stages.hazard.life import Latch, Reading, StreamHazard
from standoff.stages.hazard.pair import PairWatch
from standoff.stages.hazard.params import HazardParams

Pair = tuple[int, int]

NOT_MEASURED = "not measured"
TRACK_LOST = "track lost"
NOT_WATCHED = "pair not watched any more"
MAP_IS_BACK = "ground map is back"
STREAM_ENDED = "end of stream"


class MapWatch(StreamHazard):
    """The hazard of a stream that cannot be measured at all because it has no ground map.

    Args:
        params: Settings; the same durations as for pairs.
    """

    def __init__(self, params: HazardParams) -> None:
        super().__init__()
        self._params = params
        self._missing = Latch(params.min_duration_s, params.release_s)
        # A stream that starts without a map says so at once: only a map that comes and goes can flicker.
        self._missing.hold_on()

    def update(self, time_s: float, ground: GroundMap | NoGroundMap) -> Hazard | None:
        """Take the frame's map and return what there is to say of it."""
        missing = isinstance(ground, NoGroundMap)
        self._missing.update(time_s, enters=missing, leaves=not missing)
        if not self._missing.on:
            return self.end(time_s, MAP_IS_BACK)
        if not isinstance(ground, NoGroundMap):
            return None
        if self._hazard is None:
            return self.begin(time_s, ground.reason)
        if self._hazard.reason == ground.reason or self._hazard.silent_s(time_s) < self._params.update_every_s:
            return None
        return self._hazard.event("updated", time_s, reason=ground.reason)


class HazardMonitor:
    """Raise, follow and close the hazards of one stream.

    A hazard's first event is "opened", its last "closed", and nothing follows that. An event carries the
    time at which it is said, `min_duration_s` after the condition began; at once where frames are further apart than
    that, and at the end of the stream for what only its last frames showed. What cannot be measured is
    never taken for safe: an open hazard becomes "unknown", a visible pair that stays unmeasured opens
    one of severity "unknown", and a stream without a ground map has one hazard of rule "measurement"
    in place of one for each pair; where many sure detections are in no track, there is another one.

    Args:
        params: Settings; the defaults when left out.
    """

    def __init__(self, params: HazardParams | None = None) -> None:
        self._params = params or HazardParams()
        self._map = MapWatch(self._params)
        self._follow = FollowWatch(self._params)
        self._pairs: dict[Pair, PairWatch] = {}
        self._looked_s = math.inf

    @property
    def description(self) -> dict[str, list[str]]:
        """What there is to say of the stream so far, for the record."""
        return {"warnings": self._follow.warnings}

    def update(
        self,
        time_s: float,
        positions: GroundPositions,
        proximities: Proximities,
        ground: GroundMap | NoGroundMap,
        unfollowed: BoolArray,
    ) -> tuple[Hazard, ...]:
        """Take one frame and return its events, the stream's own first, then by pair.

        Args:
            time_s: Presentation timestamp.
            positions: For the reasons why something is not measured, and which tracks are alive.
            proximities: All configured pairs.
            ground: The frame's map, or why there is none.
            unfollowed: (K,) which of the frame's sure detections are in no track.
        """
        events = [self._map.update(time_s, ground), self._follow.update(time_s, unfollowed)]
        rare = time_s - self._looked_s > self._params.min_duration_s
        self._looked_s = time_s
        readings = _readings(proximities)
        reasons = dict(zip(positions.track_id.tolist(), positions.reason.tolist(), strict=True))
        for pair in sorted(self._pairs.keys() | readings.keys()):
            watch = self._pairs.setdefault(pair, PairWatch(pair, self._params))
            reading = readings.get(pair)
            if reading is None:
                followed = reasons.keys() >= set(pair)
                events.append(watch.lose(time_s, NOT_WATCHED if followed else TRACK_LOST))
            elif watch.measurable(reading):
                events.append(watch.measure(time_s, reading, rare=rare))
            else:
                reason = reasons.get(pair[0]) or reasons.get(pair[1]) or NOT_MEASURED
                events.append(watch.miss(time_s, reason, may_open=bool(ground)))
        self._pairs = {pair: watch for pair, watch in self._pairs.items() if watch.is_open or pair in readings}
        return _said(events)

    def close(self, time_s: float) -> tuple[Hazard, ...]:
        """End the stream: close everything that is open."""
        events = [self._map.end(time_s, STREAM_ENDED), self._follow.end(time_s, STREAM_ENDED)]
        for pair in sorted(self._pairs):
            events += [self._pairs[pair].finish(time_s), self._pairs[pair].end(time_s, STREAM_ENDED)]
        self._map, self._pairs = MapWatch(self._params), {}
        return _said(events)

    def reset(self) -> None:
        """Forget everything without a word."""
        self._map = MapWatch(self._params)
        self._follow = FollowWatch(self._params)
        self._pairs = {}
        self._looked_s = math.inf


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
