"""What is said of a hazard, from its beginning to its end, and which hazards are open."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Severity = Literal["warning", "danger", "unknown"]
Phase = Literal["opened", "updated", "closed", "unknown"]
Pair = tuple[int, int]
"""Two track ids, the smaller one first."""

GRAVENESS: tuple[Severity, ...] = ("unknown", "warning", "danger")
"""All severities, the gravest last."""


@dataclass(frozen=True, slots=True)
class Hazard:
    """One event in the life of a hazard; all events of one hazard share `hazard_id`.

    Attributes:
        hazard_id: ULID.
        rule: "proximity"; "zone" for who is where he must not be; "measurement" when the stream as a whole cannot be
            measured.
        severity: Of the hazard at this event; "unknown" when it was never measured.
        phase: "opened" first, "closed" last; "unknown" while it cannot be measured.
        track_ids: The pair, smaller id first; the machine where somebody may stand near it whom no track shows; of a
            zone that nobody may be in the one track, of a crossing both; empty where it is of the whole stream.
        time_s: Presentation timestamp.
        distance_m: Centre to centre, or to the zone, 0 in it; of two in a crossing, of the one further out; NaN while
            unknown.
        gap_m: Distance less both action radii, or to the zone's edge, negative inside; NaN while unknown.
        sigma_m: Standard error of the distance; NaN while unknown.
        reason: Why it is unknown or why it closed; empty otherwise.
        breach_now: Probability that the gap is negative; NaN while unknown.
        breach_ahead: Probability that it is, or will be within the horizon; NaN while unknown.
        zone: Name of the zone; empty for other rules, and where no zone can be watched.
    """

    hazard_id: str
    rule: str
    severity: Severity
    phase: Phase
    track_ids: tuple[int, ...]
    time_s: float
    distance_m: float
    gap_m: float
    sigma_m: float
    reason: str = ""
    breach_now: float = math.nan
    breach_ahead: float = math.nan
    zone: str = ""


@dataclass(frozen=True, slots=True)
class OpenHazards:
    """The hazards that are open at one moment.

    Attributes:
        latest: The latest event of each, in the order in which they opened.
    """

    latest: tuple[Hazard, ...] = ()

    def after(self, events: Iterable[Hazard]) -> OpenHazards:
        """Return what is open once these events have happened."""
        still = {event.hazard_id: event for event in self.latest}
        for event in events:
            if event.phase == "closed":
                still.pop(event.hazard_id, None)
            else:
                still[event.hazard_id] = event
        return OpenHazards(tuple(still.values()))

    def by_pair(self) -> dict[Pair, Hazard]:
        """Return the open hazard of each pair of tracks that are too near to each other."""
        pairs = (event for event in self.latest if len(event.track_ids) == 2 and not event.zone)
        return {(event.track_ids[0], event.track_ids[1]): event for event in pairs}

    def of_machines(self) -> tuple[Hazard, ...]:
        """Return the open hazards of machines near which somebody may stand whom no track shows."""
        return tuple(event for event in self.latest if len(event.track_ids) == 1 and not event.zone)

    def in_zones(self) -> tuple[Hazard, ...]:
        """Return the open hazards of zones."""
        return tuple(event for event in self.latest if event.zone)

    def of_stream(self) -> tuple[Hazard, ...]:
        """Return the open hazards of the stream as a whole, which cannot be measured."""
        return tuple(event for event in self.latest if event.rule == "measurement")


def worse(severity: Severity, other: Severity) -> Severity:
    """Return the graver of two severities; "unknown" is what a hazard is called until it is measured.

    >>> worse("warning", "danger")
    'danger'
    """
    return max(severity, other, key=GRAVENESS.index)
