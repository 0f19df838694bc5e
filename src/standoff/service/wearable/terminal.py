"""The reference receiver in a terminal: one large panel, a bell, and Enter."""

from __future__ import annotations

import json
import queue
import select
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, Final

from rich.align import Align
from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.text import Text

from standoff.core.lengths import METRES
from standoff.messages import Topics
from standoff.service.live.broker import Broker, BrokerAccess, Confirmed, Connected, Disconnected, Received
from standoff.service.wearable.phrases import Phrases, read_vibrations
from standoff.service.wearable.receiver import Level, Receiver, Shown, Signal

_LOOKS: Final[dict[Level, tuple[str, str]]] = {
    "danger": ("bold white on red", "■"),
    "warning": ("bold black on yellow", "▲"),
    "unknown": ("bold white on magenta", "?"),
    "unsupervised": ("bold white on grey30", "✕"),
    "supervised": ("bold white on dark_green", "●"),
}
"""How each level looks: in colour, and with a sign for who sees none."""
_WAIT_S: Final = 0.02
_DRAW_EVERY_S: Final = 0.1


class Wearable:
    """One receiver, connected.

    Args:
        device: Its name.
        topics: Of the site.
        access: To the broker.
        phrases: In which language it speaks.
        say: Hears each thing that happens, as words by name.
    """

    def __init__(
        self, device: str, topics: Topics, access: BrokerAccess, phrases: Phrases, say: Callable[[dict[str, Any]], None]
    ) -> None:
        self._topics, self._phrases, self._say = topics.device(device), phrases, say
        self.receiver = Receiver(device)
        self._vibrations = read_vibrations()
        self.is_connected = False
        self._broker = Broker(access, f"standoff-device-{device}", [self._topics.alert, self._topics.supervision])

    def step(self, longest_s: float) -> None:
        """Take what comes within so long; the rest of the time there is nothing to do."""
        try:
            news = self._broker.news.get(timeout=longest_s)
        except queue.Empty:
            news = None
        if isinstance(news, Connected | Disconnected):
            self.is_connected = isinstance(news, Connected)
            self._say({"event": "connected" if self.is_connected else "disconnected"})
        elif isinstance(news, Received):
            self._take(news)
        elif isinstance(news, Confirmed):
            pass
        level = self.receiver.changed_to(_now_ms())
        if level is not None:
            shown = self.receiver.shown(_now_ms())
            self._say({"event": "level", "level": level, "reason": shown.reason, "at_s": time.monotonic()})
            if level in ("unsupervised", "supervised"):
                self._sound(level)

    def acknowledge(self) -> None:
        """Send that the wearer has taken note of what is shown."""
        for one in self.receiver.acknowledge(_now_ms()):
            self._broker.send(self._topics.acknowledgement, one.payload)
            self._say({"event": "acknowledged", **json.loads(one.payload)})

    def close(self) -> None:
        """End."""
        self._broker.close()

    def _take(self, news: Received) -> None:
        arrived_ms = news.at_s * 1e3
        is_alert = news.topic == self._topics.alert
        take = self.receiver.take_alert if is_alert else self.receiver.take_supervision
        done: Signal = take(news.payload, arrived_ms)
        if done.sounds:
            self._sound(done.sounds)
        if not is_alert:
            self._say({"event": "supervision", "dropped": done.dropped, "at_s": news.at_s})
        else:
            event = json.loads(news.payload) if not done.dropped or done.dropped == "too late" else {}
            self._say(
                {"event": "alert", "dropped": done.dropped, "sounds": done.sounds, "at_s": news.at_s, "alert": event}
            )
        if done.topic == "echo":
            words = {**json.loads(done.payload), "held_ms": round(_now_ms() - arrived_ms, 2)}
            self._broker.send(self._topics.echo, json.dumps(words).encode(), qos=0)

    def _sound(self, level: str) -> None:
        pattern_ms, times = self._vibrations[level]
        self._say({"event": "vibration", "level": level, "pattern_ms": list(pattern_ms), "times": times})

    def panel(self) -> Panel:
        """Return what is shown now, for a terminal."""
        return _panel(self.receiver.shown(_now_ms()), self._phrases, is_connected=self.is_connected)


def run_in_terminal(make: Callable[[Callable[[dict[str, Any]], None]], Wearable]) -> None:
    """Show a receiver until Ctrl-C.

    Args:
        make: Makes it; is given what hears of it.
    """
    console, bell = Console(), threading.Event()

    def heard(words: dict[str, Any]) -> None:
        if words["event"] == "vibration" and words["level"] != "supervised":
            bell.set()

    wearable = make(heard)
    typed = _typed_lines()
    drawn_s = 0.0
    try:
        with Live(wearable.panel(), console=console, auto_refresh=False, screen=console.is_terminal) as live:
            while True:
                wearable.step(_WAIT_S)
                if bell.is_set():
                    bell.clear()
                    console.bell()
                if typed():
                    wearable.acknowledge()
                if time.monotonic() - drawn_s >= _DRAW_EVERY_S:
                    drawn_s = time.monotonic()
                    live.update(wearable.panel(), refresh=True)
    except KeyboardInterrupt:
        pass
    finally:
        wearable.close()


def run_as_json(make: Callable[[Callable[[dict[str, Any]], None]], Wearable]) -> None:
    """Print each thing that happens to a receiver as a line of JSON, until Ctrl-C or the end of the input."""

    def heard(words: dict[str, Any]) -> None:
        sys.stdout.write(json.dumps(words) + "\n")
        sys.stdout.flush()

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    wearable = make(heard)
    typed = _typed_lines()
    try:
        while True:
            wearable.step(_WAIT_S)
            if typed():
                wearable.acknowledge()
    except KeyboardInterrupt:
        pass
    finally:
        wearable.close()


def _typed_lines() -> Callable[[], bool]:
    """Return what tells whether Enter was pressed since it was asked last; at the end of the input it never is."""
    ended = False

    def is_typed() -> bool:
        nonlocal ended
        if ended or not select.select([sys.stdin], [], [], 0.0)[0]:
            return False
        line = sys.stdin.readline()
        ended = not line
        return bool(line)

    return is_typed


def _panel(shown: Shown, phrases: Phrases, *, is_connected: bool) -> Panel:
    style, sign = _LOOKS[shown.level]
    lines = [Text(f"{sign}  {phrases.say(shown.level)}  {sign}", justify="center")]
    lines += [Text(line, justify="center") for line in _details(shown, phrases, is_connected=is_connected)]
    hint = phrases.say("acknowledged" if shown.is_acknowledged else "acknowledge")
    return Panel(
        Align.center(Group(Text(), *lines, Text()), vertical="middle"), style=style, subtitle=hint, padding=(1, 2)
    )


def _details(shown: Shown, phrases: Phrases, *, is_connected: bool) -> list[str]:
    if shown.alert is None:
        found = [phrases.say(f"{shown.level}_more")]
        if not is_connected:
            found.append(phrases.say("offline"))
        elif shown.level == "unsupervised" and shown.reason:
            found.append(shown.reason)
        elif shown.level == "unsupervised" and shown.silence_s < 1e6:
            found.append(phrases.say("no_heartbeat", seconds=round(shown.silence_s)))
        return found
    hazard = shown.alert.hazard
    found = [" + ".join(phrases.say("somebody" if one == "unknown" else one) for one in hazard.classes)]
    if shown.level == "unknown":
        found.append(phrases.say("unknown_more", reason=hazard.reason))
    elif hazard.distance_m is not None and not hazard.zone:
        distance = METRES.distance(hazard.distance_m, hazard.sigma_m or float("nan")).removesuffix(" m")
        found.append(phrases.say("distance", distance=distance))
    if hazard.zone:
        found.append(phrases.say("zone", zone=hazard.zone))
    if shown.alert.because == "near":
        found.append(phrases.say("near"))
    return [line for line in found if line]


def _now_ms() -> float:
    return time.monotonic() * 1e3
