"""What a receiver knows and shows, apart from how it hears and sounds: no threads, no clock of its own, no network."""

from __future__ import annotations

import json
import math
from collections import OrderedDict
from dataclasses import dataclass
from typing import Final, Literal, TypeVar

from standoff.core.hazards import GRAVENESS, Severity
from standoff.messages import Alert, HazardNews, Supervision, Timing, Unreadable, read_event
from standoff.service.wearable.device_clock import DeviceClock

Level = Literal["danger", "warning", "unknown", "unsupervised", "supervised"]
"""What is shown, the gravest first."""

Value = TypeVar("Value")

_SILENCE_MS: Final = 3000.0
_KNOWN: Final = 5000
_UNKNOWN_OFFSET_MS: Final = 5000.0
"""For so long an alert is shown whose age nobody can tell."""


@dataclass(frozen=True, slots=True)
class Signal:
    """What a receiver does at once.

    Attributes:
        topic: "ack" or "echo", where something is to be sent; empty: nothing.
        payload: What.
        sounds: Which vibration pattern begins; empty: none.
        dropped: Why a message was not taken; empty where it was.
    """

    topic: str = ""
    payload: bytes = b""
    sounds: str = ""
    dropped: str = ""


@dataclass(frozen=True, slots=True)
class Shown:
    """What a receiver shows at a moment.

    Attributes:
        level: How grave.
        reason: Why nobody watches; empty otherwise.
        alert: The gravest that holds; None: none does.
        is_acknowledged: Whether somebody has taken note of it.
        silence_s: Since the last word on supervision.
    """

    level: Level
    reason: str
    alert: Alert | None
    is_acknowledged: bool
    silence_s: float


@dataclass(slots=True)
class _Held:
    alert: Alert
    until_ms: float
    is_acknowledged: bool = False


class Receiver:
    """The reference receiver.

    Args:
        device: Its name.
    """

    def __init__(self, device: str) -> None:
        self._device = device
        self.clock = DeviceClock()
        self._known: OrderedDict[str, None] = OrderedDict()
        self._held: dict[str, _Held] = {}
        self._newest: OrderedDict[str, tuple[float, bool]] = OrderedDict()
        self._supervision: Supervision | None = None
        self._heard_ms = -math.inf
        self._level: Level = "unsupervised"

    def take_supervision(self, payload: bytes, now_ms: float) -> Signal:
        """Take a word on supervision.

        Args:
            payload: As it came.
            now_ms: By the device's own monotonic clock.
        """
        try:
            _, told, timing = read_event(payload, Supervision)
        except Unreadable as error:
            return Signal(dropped=str(error))
        if told.device != self._device or timing is None:
            return Signal(dropped="of another device" if timing else "without the moment of its sending")
        self.clock.learn(timing, now_ms)
        remaining_ms = self.clock.remaining_ms(timing, now_ms)
        if remaining_ms is not None and remaining_ms <= 0.0:
            return Signal(dropped="too late")
        self._supervision, self._heard_ms = told, now_ms
        return Signal()

    def take_alert(self, payload: bytes, now_ms: float) -> Signal:
        """Take an alert: show it, sound where it asks for it, and echo; drop what is known or too late."""
        try:
            event_id, alert, timing = read_event(payload, Alert)
        except Unreadable as error:
            return Signal(dropped=str(error))
        if alert.device != self._device:
            return Signal(dropped="of another device")
        if event_id in self._known:
            return Signal(dropped="known already")
        remaining_ms = self._remaining_ms(timing, now_ms)
        _remember(self._known, event_id, None)
        if remaining_ms <= 0.0:
            return Signal(dropped="too late")
        hazard = alert.hazard
        if self._is_overtaken(hazard):
            return Signal(dropped="overtaken by a newer one")
        before = self._held.get(hazard.hazard_id)
        if hazard.phase == "closed":
            self._held.pop(hazard.hazard_id, None)
        else:
            graver = before is not None and _rank(alert) > _rank(before.alert)
            noted = before is not None and before.is_acknowledged and not graver
            self._held[hazard.hazard_id] = _Held(alert, now_ms + remaining_ms, noted)
        # One that asks to be silent never sounds.
        sounds = "" if alert.silent or hazard.phase == "closed" else _level_of(alert)
        echo = json.dumps({"id": event_id, "held_ms": 0.0}).encode()
        return Signal("echo", echo, sounds)

    def acknowledge(self, now_ms: float) -> list[Signal]:
        """Take that the wearer has taken note of all that is shown."""
        self._drop_old(now_ms)
        found = []
        for hazard_id, held in self._held.items():
            if not held.is_acknowledged:
                held.is_acknowledged = True
                found.append(Signal("ack", json.dumps({"hazard_id": hazard_id}).encode()))
        return found

    def shown(self, now_ms: float) -> Shown:
        """Return what is shown at a moment."""
        self._drop_old(now_ms)
        silence_s = (now_ms - self._heard_ms) / 1e3
        standing = [one for one in self._held.values() if not one.is_acknowledged or _level_of(one.alert) == "danger"]
        gravest = max(standing, key=lambda held: (_rank(held.alert), not held.is_acknowledged), default=None)
        if gravest is not None:
            alert = gravest.alert
            return Shown(_level_of(alert), alert.hazard.reason, alert, gravest.is_acknowledged, silence_s)
        if now_ms - self._heard_ms > _SILENCE_MS or self._supervision is None:
            return Shown("unsupervised", "", None, False, silence_s)
        level: Level = "supervised" if self._supervision.supervised else "unsupervised"
        return Shown(level, self._supervision.reason, None, False, silence_s)

    def changed_to(self, now_ms: float) -> Level | None:
        """Return the level where it has become better or worse since this was asked last; None where it has not.

        For what is told by vibration also without an alert: that nobody watches any more, and that somebody does again.
        """
        level = self.shown(now_ms).level
        if level == self._level:
            return None
        self._level = level
        return level

    def _remaining_ms(self, timing: Timing | None, now_ms: float) -> float:
        remaining_ms = None if timing is None else self.clock.remaining_ms(timing, now_ms)
        return _UNKNOWN_OFFSET_MS if remaining_ms is None else remaining_ms

    def _is_overtaken(self, hazard: HazardNews) -> bool:
        """Return whether something newer is known of a hazard: what waited for the broker may come after what did not.

        Several may be told of one moment; of a hazard that is over no other is.
        """
        newest_s, is_over = self._newest.get(hazard.hazard_id, (-math.inf, False))
        if hazard.time_s < newest_s or (is_over and hazard.time_s <= newest_s):
            return True
        _remember(self._newest, hazard.hazard_id, (hazard.time_s, hazard.phase == "closed"))
        return False

    def _drop_old(self, now_ms: float) -> None:
        self._held = {key: held for key, held in self._held.items() if held.until_ms > now_ms}


def _remember(known: OrderedDict[str, Value], name: str, value: Value) -> None:
    known[name] = value
    while len(known) > _KNOWN:
        known.popitem(last=False)


def _level_of(alert: Alert) -> Severity:
    hazard = alert.hazard
    return "unknown" if hazard.phase == "unknown" or hazard.severity == "unknown" else hazard.severity


def _rank(alert: Alert) -> int:
    return GRAVENESS.index(_level_of(alert))
