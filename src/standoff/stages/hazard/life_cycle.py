"""The hazard of one pair, or of one entity and a zone, from the first sign of it to its end."""

from __future__ import annotations

import math
from dataclasses import dataclass

from standoff.core.durations import has_lasted
from standoff.core.types import Hazard, Severity
from standoff.stages.hazard.latch import UNMEASURED, LastPhase, Latch, OpenHazard, Reading
from standoff.stages.hazard.params import HazardParams


@dataclass(frozen=True, slots=True)
class Limit:
    """What a measurement says of one limit; neither holds between the two ends of a hysteresis.

    Attributes:
        passed: It is passed.
        clear: It is left far enough behind for the level to end.
        sure: It is passed beyond doubt.
    """

    passed: bool
    clear: bool
    sure: bool = False


class HazardLifeCycle:
    """One life after another of the hazard of one thing. In each frame call exactly one of its four methods.

    Two latches follow what is measured, one per limit: near and breached. A hazard is open while one of them is on;
    what cannot be measured counts as near.

    Args:
        rule: Whose it is.
        track_ids: Smaller id first.
        params: Settings.
        zone: Name of the zone; empty where it is of none.
    """

    def __init__(self, rule: str, track_ids: tuple[int, ...], params: HazardParams, zone: str = "") -> None:
        self._rule, self._track_ids, self._zone = rule, track_ids, zone
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
    def is_idle(self) -> bool:
        """Whether nothing is open, nor on its way to be."""
        return self._hazard is None and not self._is_stirred and self._missing_since_s is None

    @property
    def _is_stirred(self) -> bool:
        return self._near.stirred or self._breached.stirred

    def measure(
        self, time_s: float, reading: Reading, near: Limit, breached: Limit, *, at_once: bool = False
    ) -> Hazard | None:
        """Take a measurement and return what there is to say of it.

        Args:
            time_s: Presentation timestamp.
            reading: The measurement.
            near: What it says of a warning.
            breached: What it says of danger.
            at_once: What holds is said at once.
        """
        self._missing_since_s = self._lost_since_s = None
        self._reading = reading
        for latch, limit in ((self._near, near), (self._breached, breached)):
            latch.update(time_s, enters=limit.passed, leaves=limit.clear, at_once=at_once)
        self._was_clear |= not self._is_stirred
        if not self._near.on and not self._breached.on:
            return self.end(time_s, reading.excuse or f"clear for {self._params.release_s:g} s")
        severity = self._severity(clear=near.clear)
        if self._hazard is None:
            return self._open(time_s, severity)
        changed = severity != self._hazard.severity or not self._hazard.measured
        if severity == "unknown" or not (changed or self._hazard.is_silent(time_s, self._params.update_every_s)):
            return None
        self._hazard.severity = severity
        return self._hazard.event("updated", time_s, reading)

    def miss(self, time_s: float, reason: str, *, may_open: bool) -> Hazard | None:
        """Take that it is there but could not be measured.

        Args:
            time_s: Presentation timestamp.
            reason: Why.
            may_open: False while something else already says that nothing can be measured.
        """
        was_lost, self._lost_since_s = self._lost_since_s is not None, None
        self._reading = UNMEASURED
        if self._missing_since_s is None:
            self._missing_since_s = time_s
        self._near.miss()
        self._breached.miss()
        patience_s = self._params.min_duration_s if self._is_stirred else self._params.unknown_after_s
        if not has_lasted(self._missing_since_s, time_s, patience_s):
            return None
        if self._hazard is not None:
            is_news = self._hazard.measured or was_lost
            return self._hazard.event("unknown", time_s, reason=reason) if is_news else None
        if not may_open:
            return None
        self._near.hold_on()
        return self._open(time_s, "unknown", reason)

    def lose(self, time_s: float, reason: str) -> Hazard | None:
        """Take that it is no longer followed."""
        if self._hazard is None:
            return None
        self._reading = UNMEASURED
        self._near.miss()
        self._breached.miss()
        if self._lost_since_s is None:
            self._lost_since_s = time_s
            return self._hazard.event("unknown", time_s, reason=reason)
        if not has_lasted(self._lost_since_s, time_s, self._params.unknown_timeout_s):
            return None
        return self.end(time_s, f"{reason} for {self._params.unknown_timeout_s:g} s")

    def finish(self, time_s: float) -> Hazard | None:
        """Take that nothing more will come: what was near in all its few looks is said now; `end` follows."""
        measured = not math.isnan(self._reading.gap_m)
        if self._hazard is not None or not measured or self._was_clear or not self._is_stirred:
            return None
        self._near.finish()
        self._breached.finish()
        return self._open(time_s, self._severity(clear=False))

    def end(self, time_s: float, reason: str, phase: LastPhase = "closed") -> Hazard | None:
        """End the hazard, if one is open: over, as it was last measured, or unknown because nobody watches any more."""
        if self._hazard is None:
            return None
        ending, self._hazard = self._hazard, None
        return ending.event(phase, time_s, self._reading if phase == "closed" else UNMEASURED, reason)

    def _open(self, time_s: float, severity: Severity, reason: str = "") -> Hazard:
        self._hazard = OpenHazard(self._rule, self._track_ids, severity, self._zone)
        return self._hazard.event("opened", time_s, self._reading, reason)

    def _severity(self, *, clear: bool) -> Severity:
        """Return the level while a latch is on; unknown if it was never measured near."""
        if self._breached.on:
            return "danger"
        never = clear and self._hazard is not None and self._hazard.severity == "unknown"
        return "unknown" if never else "warning"
