"""From a stream's own time stamps to one time that only rises, and to UTC with a word on who told it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Final, Literal, Protocol

ToldBy = Literal["file", "arrival", "rtcp", "telemetry"]
"""Who told the time of capture: the file's header, this machine when the picture arrived, the sender's RTCP report, or
the drone's log. Arrival is later than capture by an unknown delay."""

_MOST_JUMP_S: Final = 5.0
"""A step of the stamps that is longer than this machine saw pass by so much is a new beginning of the encoder."""

_LEAST_STEP_S: Final = 1e-3
"""Between two pictures whose stamps do not rise: time does."""

_OLDEST: Final = timedelta(seconds=60)
_AHEAD: Final = timedelta(seconds=1)
"""A sender's time further behind or ahead of this machine's is a clock that nobody has set."""


class Clock(Protocol):
    """What time it is on this machine."""

    def monotonic_s(self) -> float:
        """Return seconds since some moment; never fall, whoever sets the clock."""
        ...

    def utc(self) -> datetime:
        """Return aware UTC."""
        ...


class MachineClock:
    """The clock of this machine."""

    def monotonic_s(self) -> float:
        """Return seconds since some moment."""
        return time.monotonic()

    def utc(self) -> datetime:
        """Return aware UTC."""
        return datetime.now(UTC)


@dataclass(frozen=True, slots=True)
class StreamTime:
    """When a picture was taken.

    Attributes:
        time_s: Seconds from the stream's first picture; rises from picture to picture, across reconnects too.
        captured_at: Aware UTC.
        told_by: Who says so.
    """

    time_s: float
    captured_at: datetime
    told_by: ToldBy


class StreamClock:
    """The time of one stream, for as long as somebody watches it.

    Within a connection time follows the stamps of the pictures. Between two connections, and where the stamps fall or
    leap because the sender began anew, it goes on by what passed on this machine.

    Args:
        clock: Of this machine.
    """

    def __init__(self, clock: Clock | None = None) -> None:
        self._clock = clock or MachineClock()
        self._shift_s: float | None = None
        self._stamp_s = self._time_s = self._seen_s = 0.0
        self._is_fresh = True

    def reconnect(self) -> None:
        """Take that the next picture comes over a new connection, with stamps that begin anywhere."""
        self._shift_s = None

    def at(
        self,
        stamp_s: float,
        told: datetime | None = None,
        told_by: ToldBy = "arrival",
        *,
        arrived_s: float | None = None,
    ) -> StreamTime:
        """Return when a picture was taken.

        Args:
            stamp_s: Its presentation timestamp.
            told: Aware UTC of its capture, where somebody tells; None: it counts as captured when it arrived.
            told_by: Who tells. What a sender tells has to be plausible by this machine's clock; a file's time need not.
            arrived_s: When it arrived by this machine's monotonic clock; None: now.
        """
        now_s = self._clock.monotonic_s() if arrived_s is None else arrived_s
        passed_s = 0.0 if self._is_fresh else now_s - self._seen_s
        step_s = stamp_s - self._stamp_s
        leaps = self._shift_s is not None and not -_LEAST_STEP_S < step_s <= passed_s + _MOST_JUMP_S
        if self._shift_s is None or leaps:
            self._shift_s = self._time_s + passed_s - stamp_s
        time_s = stamp_s + self._shift_s
        if not self._is_fresh:
            time_s = max(time_s, self._time_s + _LEAST_STEP_S)
        self._stamp_s, self._time_s, self._seen_s, self._is_fresh = stamp_s, time_s, now_s, False
        return StreamTime(time_s, *self._captured(told, told_by))

    def now_s(self) -> float:
        """Return the stream's time at this moment, for when no picture comes."""
        return self._time_s + (0.0 if self._is_fresh else self._clock.monotonic_s() - self._seen_s)

    def _captured(self, told: datetime | None, told_by: ToldBy) -> tuple[datetime, ToldBy]:
        now = self._clock.utc()
        if told is None or (told_by != "file" and not now - _OLDEST <= told <= now + _AHEAD):
            return now, "arrival"
        return told, told_by
