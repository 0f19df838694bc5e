"""Every result to every sink."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeVar

from standoff.core.protocols import LiveSink, Sink
from standoff.core.types import FrameResult, Outcome, Silence
from standoff.monitor.monitor import clocked

_LOG = logging.getLogger(__name__)

News = TypeVar("News")


class FanOut:
    """Give what a monitor says to sinks, one after another, in the thread of the caller.

    A sink that fails is logged and left out from then on; the others go on. For sinks that write files: what is lost of
    them cannot be made good. A sink that may be slow or away for a while belongs into a `LiveQueue` of its own.

    Args:
        sinks: By name.

    Attributes:
        errors: Message of each sink that failed.
    """

    def __init__(self, sinks: Mapping[str, Sink]) -> None:
        self._sinks = dict(sinks)
        self.errors: dict[str, str] = {}

    def write(self, result: FrameResult) -> dict[str, float]:
        """Give a frame's result to all and return the milliseconds of each ("sinks.NAME")."""
        sink_ms: dict[str, float] = {}
        for name, sink in self._going():
            with clocked(sink_ms, f"sinks.{name}"):
                self._attempt(name, sink.write, result)
        return sink_ms

    def tell(self, silence: Silence) -> None:
        """Give the news that nothing arrives to all who listen to it."""
        for name, sink in self._going():
            if isinstance(sink, LiveSink):
                self._attempt(name, sink.tell, silence)

    def close(self, outcome: Outcome) -> None:
        """Close all sinks, those that failed as well; each hears of those that failed before it."""
        for name, sink in self._sinks.items():
            self._attempt(name, sink.close, replace(outcome, sink_errors=dict(self.errors)))

    def _going(self) -> list[tuple[str, Sink]]:
        return [(name, sink) for name, sink in self._sinks.items() if name not in self.errors]

    def _attempt(self, name: str, action: Callable[[News], None], news: News) -> None:
        try:
            action(news)
        except Exception as error:  # noqa: BLE001 - a full disk must not stop the monitoring, nor the other outputs
            if name not in self.errors:
                _LOG.error("output %s stopped: %s", name, error)
            self.errors.setdefault(name, str(error) or type(error).__name__)
