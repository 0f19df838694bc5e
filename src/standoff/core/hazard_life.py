"""A hazard as a whole: what its events, one after another, have said of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from standoff.core.hazards import GRAVENESS, Hazard, Severity, worse


@dataclass(slots=True)
class HazardLife:
    """One hazard from its first event to its last.

    Attributes:
        hazard_id: Of all its events.
        rule: "proximity", "zone" or "measurement".
        track_ids: Whom it is about.
        names: What its tracks are called.
        opened_s: Time of the first event.
        severity: The gravest it had.
        zone: Name of the zone; empty where it is of none.
        closed_s: Time of the last; None while open.
        distance_m: The smallest measured; NaN when none was.
        gap_m: Its gap.
        sigma_m: Its standard error.
        reason: Why it was unknown or why it closed.
        worst_s: Time of the event at which it was gravest, of those the one with the least gap.
        worst_frame: Its frame; None where nobody said.
        worst_gap_m: Its gap; NaN when it was not measured.
        changes: From when on it had which severity, as far as events tell.
    """

    hazard_id: str
    rule: str
    track_ids: tuple[int, ...]
    names: tuple[str, ...]
    opened_s: float
    severity: Severity
    zone: str = ""
    closed_s: float | None = None
    distance_m: float = math.nan
    gap_m: float = math.nan
    sigma_m: float = math.nan
    reason: str = ""
    worst_s: float = math.nan
    worst_frame: int | None = None
    worst_gap_m: float = math.nan
    changes: list[tuple[float, Severity]] = field(default_factory=list)

    @classmethod
    def begun(cls, event: Hazard, names: tuple[str, ...], frame: int | None = None) -> HazardLife:
        """Return what a first event says.

        Args:
            event: The event.
            names: What its tracks are called.
            frame: Index in the source; None: unknown.
        """
        life = cls(event.hazard_id, event.rule, event.track_ids, names, event.time_s, event.severity, event.zone)
        life.worst_s, life.worst_frame = event.time_s, frame
        life.take(event, frame)
        return life

    def take(self, event: Hazard, frame: int | None = None) -> None:
        """Take the next event.

        Args:
            event: The event.
            frame: Index in the source; None: unknown.
        """
        graver = GRAVENESS.index(event.severity) - GRAVENESS.index(self.severity)
        if graver > 0 or (graver == 0 and math.isfinite(event.gap_m) and not event.gap_m >= self.worst_gap_m):
            self.worst_s, self.worst_frame, self.worst_gap_m = event.time_s, frame, event.gap_m
        if not self.changes or self.changes[-1][1] != event.severity:
            self.changes.append((event.time_s, event.severity))
        self.severity = worse(self.severity, event.severity)
        self.measure(event.distance_m, event.gap_m, event.sigma_m)
        self.reason = event.reason or self.reason
        if event.phase == "closed":
            self.closed_s = event.time_s

    def measure(self, distance_m: float, gap_m: float, sigma_m: float) -> None:
        """Take a measurement; the smallest counts."""
        if math.isfinite(gap_m) and not gap_m >= self.gap_m:
            self.distance_m, self.gap_m, self.sigma_m = distance_m, gap_m, sigma_m

    def severity_at(self, time_s: float) -> Severity | None:
        """Return how grave it was at a time; None: it was not open."""
        if self.closed_s is not None and time_s >= self.closed_s:
            return None
        return next((severity for since_s, severity in reversed(self.changes) if since_s <= time_s), None)

    @property
    def who(self) -> str:
        """Whom it is about, for people."""
        alone = self.rule == "proximity" and len(self.names) == 1
        who = " and ".join([*self.names, "perhaps somebody"] if alone else self.names) or "whole picture"
        if self.zone:
            return f"{who}: zone {self.zone}"
        return who if self.rule == "proximity" else f"{who} ({self.rule})"

    def lasted_s(self, last_s: float) -> float:
        """Return how long it was open, up to the run's last frame."""
        return (self.closed_s if self.closed_s is not None else last_s) - self.opened_s
