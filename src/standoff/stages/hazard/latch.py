"""The two small machines that every hazard is made of: a latch against flicker and a life with one id."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from ulid import ULID

from standoff.core.durations import has_lasted
from standoff.core.types import Hazard, Phase, Severity

LastPhase = Literal["closed", "unknown"]
"""With what a hazard ends: it is over, or its stream was lost."""

NOT_MEASURED = "not measured"
TRACK_LOST = "track lost"
NOT_WATCHED = "pair not watched any more"


@dataclass(frozen=True, slots=True)
class Reading:
    """One measurement of a pair, or of an entity and a zone: numbers, NaN where there are none, and an excuse."""

    distance_m: float
    gap_m: float
    sigma_m: float
    breach_now: float = math.nan
    breach_ahead: float = math.nan
    excuse: str = ""


UNMEASURED = Reading(math.nan, math.nan, math.nan)


class Latch:
    """A switch that follows a condition only once it has held for some time.

    Args:
        on_after_s: It turns on when the condition to enter has held for so long.
        off_after_s: It turns off when the condition to leave has held for so long.

    >>> latch = Latch(on_after_s=0.5, off_after_s=0.0)
    >>> for time_s in (0.0, 0.25, 0.5):
    ...     latch.update(time_s, enters=True, leaves=False)
    >>> latch.on
    True
    """

    __slots__ = ("_off_after_s", "_on_after_s", "_since_s", "on")

    def __init__(self, on_after_s: float, off_after_s: float) -> None:
        self._on_after_s = on_after_s
        self._off_after_s = off_after_s
        self._since_s: float | None = None
        self.on = False

    @property
    def stirred(self) -> bool:
        """Whether it is on, or on its way to turn on."""
        return self.on or self._since_s is not None

    def update(self, time_s: float, *, enters: bool, leaves: bool, at_once: bool = False) -> None:
        """Take what holds now; neither holds between the two limits of a hysteresis.

        Args:
            time_s: Presentation timestamp.
            enters: It should turn on.
            leaves: It should turn off.
            at_once: It turns on without waiting whether the condition holds.
        """
        if not (leaves if self.on else enters):
            self._since_s = None
            return
        if self._since_s is None:
            self._since_s = time_s
        needed_s = self._off_after_s if self.on else self._on_after_s
        if (at_once and not self.on) or has_lasted(self._since_s, time_s, needed_s):
            self.on, self._since_s = not self.on, None

    def finish(self) -> None:
        """Turn on if it was about to: nothing more will come."""
        if self.stirred:
            self.hold_on()

    def miss(self) -> None:
        """Take that nothing was measured: no step towards off, and no step back from on."""
        if self.on:
            self._since_s = None

    def hold_on(self) -> None:
        """Turn on without a measurement; only measurements turn it off again."""
        self.on, self._since_s = True, None


class OpenHazard:
    """A hazard from its first event to its last, under one id.

    Args:
        rule: "proximity", "zone" or "measurement".
        track_ids: Smaller id first; empty where it is of the whole stream.
        severity: To begin with.
        zone: Name of the zone; empty where it is of none.
    """

    __slots__ = ("_hazard_id", "_rule", "_said_s", "_track_ids", "_zone", "measured", "reason", "severity")

    def __init__(self, rule: str, track_ids: tuple[int, ...], severity: Severity, zone: str = "") -> None:
        self._hazard_id = str(ULID())
        self._rule = rule
        self._track_ids = track_ids
        self._zone = zone
        self._said_s = -math.inf
        self.severity = severity
        self.measured = False
        self.reason = ""

    def event(self, phase: Phase, time_s: float, reading: Reading = UNMEASURED, reason: str = "") -> Hazard:
        """Say something about this hazard, and remember when it was said and whether it was measured then."""
        self._said_s = time_s
        self.measured = not math.isnan(reading.gap_m)
        self.reason = reason
        return Hazard(
            hazard_id=self._hazard_id,
            rule=self._rule,
            severity=self.severity,
            phase=phase,
            track_ids=self._track_ids,
            time_s=time_s,
            distance_m=reading.distance_m,
            gap_m=reading.gap_m,
            sigma_m=reading.sigma_m,
            reason=reason,
            breach_now=reading.breach_now,
            breach_ahead=reading.breach_ahead,
            zone=self._zone,
        )

    def is_silent(self, time_s: float, duration_s: float) -> bool:
        """Return whether nothing was said for so long."""
        return has_lasted(self._said_s, time_s, duration_s)


class StreamHazard:
    """The hazard of a stream as a whole, if one is open: what tells of no pair but of all that is measured.

    Args:
        rule: Whose it is.
    """

    def __init__(self, rule: str = "measurement") -> None:
        self._rule = rule
        self._hazard: OpenHazard | None = None

    @property
    def is_open(self) -> bool:
        """Whether it has begun and not ended."""
        return self._hazard is not None

    def begin(self, time_s: float, reason: str) -> Hazard:
        """Open the hazard."""
        self._hazard = OpenHazard(self._rule, (), "unknown")
        return self._hazard.event("opened", time_s, reason=reason)

    def end(self, time_s: float, reason: str, phase: LastPhase = "closed") -> Hazard | None:
        """End the hazard, if one is open: over, or unknown because nobody watches any more."""
        if self._hazard is None:
            return None
        ending, self._hazard = self._hazard, None
        return ending.event(phase, time_s, reason=reason)
