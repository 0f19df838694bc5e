"""The hazard of one pair of tracks, from the first sign of it to its end."""

from __future__ import annotations

from standoff.core.types import Hazard, Severity
from standoff.stages.hazard.levels import levels_of
from standoff.stages.hazard.life import UNMEASURED, Latch, OpenHazard, Reading
from standoff.stages.hazard.params import HazardParams


class PairWatch:
    """Watch one pair. In each frame call exactly one of `measure`, `miss` and `lose`.

    Two latches follow what is measured, one per level: near and breached. A hazard is open while one of them is on; a
    pair that cannot be measured counts as near.

    Args:
        track_ids: Smaller id first.
        params: Settings.
    """

    def __init__(self, track_ids: tuple[int, int], params: HazardParams) -> None:
        self._track_ids = track_ids
        self._params = params
        self._near = Latch(params.min_duration_s, params.release_s)
        self._breached = Latch(params.min_duration_s, params.release_s)
        self._missing_since_s: float | None = None
        self._lost_since_s: float | None = None
        self._reading = UNMEASURED
        self._was_clear = False
        self._hazard: OpenHazard | None = None

    @property
    def is_open(self) -> bool:
        """Whether a hazard is open."""
        return self._hazard is not None

    @property
    def _is_stirred(self) -> bool:
        return self._near.stirred or self._breached.stirred

    def measurable(self, reading: Reading) -> bool:
        """Tell whether a reading says how near the pair is; NaN never does."""
        return levels_of(reading, self._params) is not None

    def measure(self, time_s: float, reading: Reading, *, rare: bool = False) -> Hazard | None:
        """Take a measurement and return what there is to say of it.

        Args:
            time_s: Presentation timestamp.
            reading: The measurement.
            rare: The last look was so long ago that what holds is said at once.
        """
        self._missing_since_s = self._lost_since_s = None
        self._reading = reading
        levels = levels_of(reading, self._params)
        if levels is None:
            raise ValueError("a reading that tells nothing is a miss")
        self._near.update(time_s, **levels.near._asdict(), rare=rare)
        self._breached.update(time_s, **levels.breached._asdict(), rare=rare)
        self._was_clear |= not self._is_stirred
        if not self._near.on and not self._breached.on:
            return self.end(time_s, reading.excuse or f"clear for {self._params.release_s:g} s")
        severity = self._severity(clear=levels.near.leaves)
        if self._hazard is None:
            return self._open(time_s, severity)
        changed = severity != self._hazard.severity or not self._hazard.measured
        if severity == "unknown" or not (changed or self._hazard.silent_s(time_s) >= self._params.update_every_s):
            return None
        self._hazard.severity = severity
        return self._hazard.event("updated", time_s, reading)

    def miss(self, time_s: float, reason: str, *, may_open: bool) -> Hazard | None:
        """Take that the pair is there but could not be measured.

        Args:
            time_s: Presentation timestamp.
            reason: Why.
            may_open: False while something else already says that nothing can be measured.
        """
        self._lost_since_s = None
        self._reading = UNMEASURED
        if self._missing_since_s is None:
            self._missing_since_s = time_s
        self._near.miss()
        self._breached.miss()
        patience_s = (
            self._params.min_duration_s
            if self._near.stirred or self._breached.stirred
            else self._params.unknown_after_s
        )
        if time_s - self._missing_since_s < patience_s:
            return None
        if self._hazard is not None:
            return self._hazard.event("unknown", time_s, reason=reason) if self._hazard.measured else None
        if not may_open:
            return None
        self._near.hold_on()
        return self._open(time_s, "unknown", reason)

    def lose(self, time_s: float, reason: str) -> Hazard | None:
        """Take that the pair is no longer followed."""
        if self._hazard is None:
            return None
        self._reading = UNMEASURED
        self._near.miss()
        self._breached.miss()
        if self._lost_since_s is None:
            self._lost_since_s = time_s
            return self._hazard.event("unknown", time_s, reason=reason)
        if time_s - self._lost_since_s < self._params.unknown_timeout_s:
            return None
        return self.end(time_s, f"{reason} for {self._params.unknown_timeout_s:g} s")

    def finish(self, time_s: float) -> Hazard | None:
        """Take that nothing more will come: a pair that was near in all its few looks is said now; `end` follows."""
        if self._hazard is not None or not self.measurable(self._reading) or self._was_clear:
            return None
        self._near.finish()
        self._breached.finish()
        return self._open(time_s, self._severity(clear=False))

    def end(self, time_s: float, reason: str) -> Hazard | None:
        """Close the hazard, if one is open."""
        if self._hazard is None:
            return None
        closing, self._hazard = self._hazard, None
        return closing.event("closed", time_s, self._reading, reason)

    def _open(self, time_s: float, severity: Severity, reason: str = "") -> Hazard:
        self._hazard = OpenHazard("proximity", self._track_ids, severity)
        return self._hazard.event("opened", time_s, self._reading, reason)

    def _severity(self, *, clear: bool) -> Severity:
        """Return the level while a latch is on; unknown if it was never measured near."""
        if self._breached.on:
            return "danger"
        return "unknown" if clear and self._hazard is not None and self._hazard.severity == "unknown" else "warning"
