"""The hazard of a stream in which something is missing without which nothing can be measured."""

from __future__ import annotations

from standoff.core.types import Hazard
from standoff.stages.hazard.latch import Latch, StreamHazard
from standoff.stages.hazard.params import HazardParams


class AbsenceWatch(StreamHazard):
    """Says that something is missing, and when it is back.

    Args:
        params: Settings; the same durations as for pairs.
        back: Why the hazard ends once it is there again.
        rule: Whose it is.
    """

    def __init__(self, params: HazardParams, back: str, rule: str = "measurement") -> None:
        super().__init__(rule)
        self._params, self._back = params, back
        self._missing = Latch(params.min_duration_s, params.release_s)
        # A stream that starts without it says so at once: only what comes and goes can flicker.
        self._missing.hold_on()

    def update(self, time_s: float, reason: str) -> Hazard | None:
        """Take why it is missing in this frame, "" where it is there, and return what there is to say of it."""
        self._missing.update(time_s, enters=bool(reason), leaves=not reason)
        if not self._missing.on:
            return self.end(time_s, self._back)
        if not reason:
            return None
        if self._hazard is None:
            return self.begin(time_s, reason)
        if self._hazard.reason == reason or not self._hazard.is_silent(time_s, self._params.update_every_s):
            return None
        return self._hazard.event("updated", time_s, reason=reason)
