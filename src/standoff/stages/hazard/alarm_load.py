"""How many alarms a worker gets in an hour: a rule that cries all day is heeded by nobody."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable

import numpy as np

from standoff.core.classes import CLASSES
from standoff.core.roles import PERSON_ROLE, ROLE_OF_CLASS
from standoff.core.types import GroundPositions, Hazard

MOST_PER_HOUR = 6.0
_LEAST_HOURS = 0.25
"""Workers must have been in sight for so long, taken together; of less nobody can tell a rate."""

_LONGEST_STEP_S = 5.0
"""A pause in a stream is no work that was watched."""

_HIGHER = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9)


class AlarmLoad:
    """Count the alarms of one stream and the hours of the workers in sight.

    An alarm is a hazard of a pair or a zone that was measured; what is unknown is none.
    """

    def __init__(self) -> None:
        self._worker_s = 0.0
        self._time_s = math.inf
        self._class_of: dict[int, int] = {}
        self._likeliest: dict[str, float] = {}
        self._between: dict[str, str] = {}

    def update(self, time_s: float, positions: GroundPositions, events: Iterable[Hazard | None]) -> None:
        """Take one frame and what was said in it."""
        step_s = min(max(time_s - self._time_s, 0.0), _LONGEST_STEP_S)
        self._time_s = time_s
        people = ROLE_OF_CLASS[positions.class_id] == PERSON_ROLE
        self._worker_s += step_s * int(np.count_nonzero(people & positions.valid))
        self._class_of = dict(zip(positions.track_id.tolist(), positions.class_id.tolist(), strict=True))
        for event in events:
            if event is not None and event.rule != "measurement" and event.severity != "unknown":
                self._count(event)

    def _count(self, event: Hazard) -> None:
        likely = 1.0 if event.severity == "danger" or math.isnan(event.breach_ahead) else event.breach_ahead
        self._likeliest[event.hazard_id] = max(likely, self._likeliest.get(event.hazard_id, 0.0))
        names = sorted(CLASSES[self._class_of[one]].name for one in event.track_ids if one in self._class_of)
        self._between.setdefault(event.hazard_id, " and ".join(names).replace("_", " "))

    def describe(self) -> dict[str, float | None]:
        """Return hours of workers in sight, alarms, and alarms for each hour; None where too little was seen."""
        hours, alarms = self._worker_s / 3600.0, len(self._likeliest)
        rate = alarms / hours if hours >= _LEAST_HOURS else None
        return {"worker_hours": hours, "alarms": alarms, "per_worker_hour": rate}

    @property
    def warnings(self) -> list[str]:
        """That there are too many to be heeded, and which setting would leave fewer."""
        rate = self.describe()["per_worker_hour"]
        if rate is None or rate <= MOST_PER_HOUR:
            return []
        kind, count = Counter(self._between.values()).most_common(1)[0]
        most = f"{count} of {len(self._between)} between {kind}" if kind else f"{count} of zones"
        return [f"{rate:.0f} alarms for each worker and hour: the rule is not usable as set ({most}); {self._advice()}"]

    def _advice(self) -> str:
        hours = self._worker_s / 3600.0
        for limit in _HIGHER:
            left = sum(likely >= limit for likely in self._likeliest.values()) / hours
            if left <= MOST_PER_HOUR:
                return f"hazard.warning_probability: {limit:g} would leave {left:.1f}"
        return "no probability would do: set smaller radii (locate.radius_m), or say who works together"
