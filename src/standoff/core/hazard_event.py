"""What is said of a hazard, from its beginning to its end."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Severity = Literal["warning", "danger", "unknown"]
Phase = Literal["opened", "updated", "closed", "unknown"]


@dataclass(frozen=True, slots=True)
class Hazard:
    """One event in the life of a hazard; all events of one hazard share `hazard_id`.

    Attributes:
        hazard_id: ULID.
        rule: "proximity"; "zone" for who is where he must not be; "measurement" when the stream as a whole cannot be
            measured.
        severity: Of the hazard at this event; "unknown" when it was never measured.
        phase: "opened" first, "closed" last; "unknown" while it cannot be measured.
        track_ids: The pair, smaller id first; of a zone that nobody may be in the one track, of a crossing both; empty
            where it is of the whole stream.
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
