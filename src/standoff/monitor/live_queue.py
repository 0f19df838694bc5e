"""A sink that may be slow, or away for a while, beside a monitor that may not wait."""

from __future__ import annotations

import logging
import threading
from collections import deque
from dataclasses import dataclass, replace

from standoff.core.hazards import Hazard
from standoff.core.protocols import LiveSink, Sink
from standoff.core.types import FrameResult, Outcome, Silence

_LOG = logging.getLogger(__name__)
_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 5.0

News = FrameResult | Silence


@dataclass(frozen=True, slots=True)
class QueueState:
    """How a sink keeps up.

    Attributes:
        waiting: News that it has not taken yet.
        superseded: News that it will never see, because newer ones came first; their events it did or will see.
        failures: Attempts in a row that failed; 0: it works.
        error: What the last of them said; empty where it works.
    """

    waiting: int
    superseded: int
    failures: int
    error: str


class LiveQueue:
    """Stand before a sink with a bounded queue and a thread of its own.

    The newest news win: where the queue is full, the oldest is dropped. **Its events are not**: they go in front of
    those of the one that follows it, so that a sink sees every hazard's whole life, late if it must be. What fails is
    tried again after a pause, 0.1 s at first and 5 s at last, until something newer takes its place; a sink is never
    given up.

    Args:
        sink: Takes the news, in the order of their time.
        size: How many of them may wait.
        patience_s: How long `close` lets it work off what waits.
    """

    def __init__(self, sink: Sink, size: int = 2, patience_s: float = 5.0) -> None:
        if size < 1:
            raise ValueError(f"a queue holds at least one, not {size}")
        self._sink, self._size, self._patience_s = sink, size, patience_s
        self._waiting: deque[News] = deque()
        self._changed = threading.Condition()
        self._ended = self._given_up = False
        self._taken: News | None = None
        self._superseded = self._failures = 0
        self._error = ""
        self._thread = threading.Thread(target=self._work, name=f"sink {type(sink).__name__}", daemon=True)
        self._thread.start()

    @property
    def state(self) -> QueueState:
        """How it keeps up at the moment."""
        with self._changed:
            return QueueState(len(self._waiting), self._superseded, self._failures, self._error)

    def write(self, result: FrameResult) -> None:
        """Queue a frame's result; never waits."""
        self._put(result)

    def tell(self, silence: Silence) -> None:
        """Queue that nothing arrives; never waits."""
        self._put(silence)

    def close(self, outcome: Outcome) -> None:
        """Let the sink take what waits, for `patience_s` at most, and close it.

        Raises:
            TimeoutError: Events are left that it did not take.
        """
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        self._thread.join(self._patience_s)
        if self._thread.is_alive():
            with self._changed:
                self._given_up = True
                self._changed.notify_all()
                undelivered = (*self._waiting, *([self._taken] if self._taken else ()))
            left = [event for news in undelivered for event in news.hazards]
            raise TimeoutError(f"{len(left)} events not delivered: {self._error or 'the output does not answer'}")
        self._sink.close(outcome)

    def _put(self, news: News) -> None:
        with self._changed:
            self._waiting.append(news)
            while len(self._waiting) > self._size:
                oldest = self._waiting.popleft()
                self._waiting[0] = _with_events_before(self._waiting[0], oldest.hazards)
                self._superseded += 1
            self._changed.notify_all()

    def _work(self) -> None:
        pause_s = _FIRST_PAUSE_S
        while (news := self._next()) is not None:
            try:
                if isinstance(news, FrameResult):
                    self._sink.write(news)
                elif isinstance(self._sink, LiveSink):
                    self._sink.tell(news)
            except Exception as error:  # noqa: BLE001 - a broker that is away must not end the warnings
                self._fail(error, news)
                pause_s = self._rest(pause_s)
            else:
                pause_s = _FIRST_PAUSE_S
                with self._changed:
                    self._taken, self._failures, self._error = None, 0, ""

    def _next(self) -> News | None:
        """Wait for news and take them; None at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._ended)
            self._taken = self._waiting.popleft() if self._waiting and not self._given_up else None
            return self._taken

    def _rest(self, pause_s: float) -> float:
        """Wait before the next attempt, and return how long to wait before the one after; the end is worth a try."""
        with self._changed:
            was_ended = self._ended
            self._changed.wait_for(lambda: self._given_up or self._ended != was_ended, pause_s)
            return _FIRST_PAUSE_S if self._ended else min(2.0 * pause_s, _LONGEST_PAUSE_S)

    def _fail(self, error: Exception, news: News) -> None:
        """Put what failed back, or only its events where something newer waits and there is no room."""
        with self._changed:
            if not self._failures:
                _LOG.warning("output %s does not take its news: %s", self._thread.name, error)
            self._failures += 1
            self._error, self._taken = str(error) or type(error).__name__, None
            if len(self._waiting) < self._size:
                self._waiting.appendleft(news)
            else:
                self._waiting[0] = _with_events_before(self._waiting[0], news.hazards)
                self._superseded += 1


def _with_events_before(news: News, events: tuple[Hazard, ...]) -> News:
    return replace(news, hazards=(*events, *news.hazards)) if events else news
