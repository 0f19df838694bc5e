"""When a device sounds: not again for what it has told already, not for what is set aside, and who is next in line."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Final

from standoff.config import AlertSettings
from standoff.core.hazards import GRAVENESS, Severity
from standoff.messages import HazardNews
from standoff.service.live.outbox import OpenHazardRow, Shelf
from standoff.service.live.service_clock import Moment

_FORGOTTEN_S: Final = 3600.0

Cause = tuple[str, str, str, str]
"""Device, stream, rule, and zone or classes: what sounds the same to somebody."""


@dataclass
class _Sounded:
    severity: Severity
    at_s: float


@dataclass
class Alarms:
    """What each device has told.

    Attributes:
        settings: How people are told.
    """

    settings: AlertSettings
    _by_hazard: dict[tuple[str, str], _Sounded] = field(default_factory=dict)
    _by_cause: dict[Cause, _Sounded] = field(default_factory=dict)

    def is_silent(self, device: str, hazard: HazardNews, now_s: float) -> bool:
        """Return whether a device is only to show an event, and take note that it does.

        It sounds where somebody is in danger, or may be soon, and this device has not sounded for it yet, or for less;
        nor for the like of it a moment ago. That something is over, or not known any more, is shown only.

        Args:
            device: Which.
            hazard: The event.
            now_s: Monotonic.
        """
        if hazard.phase in ("closed", "unknown") or hazard.severity == "unknown":
            return True
        key = (device, hazard.hazard_id)
        cause = (device, hazard.stream, hazard.rule, hazard.zone or "+".join(sorted(hazard.classes)))
        before, alike = self._by_hazard.get(key), self._by_cause.get(cause)
        said = before is not None and not _is_graver(hazard.severity, before.severity)
        cooling = (
            alike is not None
            and now_s - alike.at_s < self.settings.cooldown_s
            and not _is_graver(hazard.severity, alike.severity)
        )
        if said or (before is None and cooling):
            return True
        self._by_hazard[key] = self._by_cause[cause] = _Sounded(hazard.severity, now_s)
        self._forget(now_s)
        return False

    def _forget(self, now_s: float) -> None:
        self._by_hazard = {key: one for key, one in self._by_hazard.items() if now_s - one.at_s <= _FORGOTTEN_S}
        self._by_cause = {key: one for key, one in self._by_cause.items() if now_s - one.at_s <= _FORGOTTEN_S}

    def due(
        self,
        open_hazards: Collection[OpenHazardRow],
        acknowledged: Collection[str],
        shelves: Collection[Shelf],
        now: Moment,
    ) -> list[tuple[OpenHazardRow, int, str]]:
        """Return what goes to the next in line: the hazard, how far down the line, and to which device.

        Args:
            open_hazards: All that are open.
            acknowledged: Ids of those of which somebody has taken note.
            shelves: What is set aside: nobody is told of it.
            now: The moment.
        """
        line = self.settings.escalate_to
        found = []
        for row in open_hazards:
            hazard = row.latest
            if hazard.severity != "danger" or hazard.hazard_id in acknowledged:
                continue
            if hazard.delay == "unknown" or shelved_by(hazard, shelves):
                continue
            steps = int(now.since(row.opened) // self.settings.escalate_after_s)
            found += [(row, step, line[step]) for step in range(min(max(steps, 0), len(line)))]
        return found


def shelved_by(hazard: HazardNews, shelves: Collection[Shelf]) -> str:
    """Return who has set a hazard's alarm aside; "" where nobody has."""
    return next((one.author for one in shelves if one.holds(hazard)), "")


def _is_graver(severity: Severity, other: Severity) -> bool:
    return GRAVENESS.index(severity) > GRAVENESS.index(other)
