"""The service's clock as a device knows it: by the messages that came, without clocks that agree."""

from __future__ import annotations

from collections import deque
from typing import Final

from standoff.messages import Timing

_KEPT: Final = 120


class DeviceClock:
    """Learns how far the service's milliseconds are from this device's.

    A message is never there before it was sent, so that each gives a bound; the quickest of the last two minutes is
    nearest to the truth, and what is left of it makes an alert look younger than it is by that message's own delay, of
    a few milliseconds.
    """

    def __init__(self) -> None:
        self._clock = ""
        self._offsets_ms: deque[float] = deque(maxlen=_KEPT)

    def learn(self, timing: Timing, arrived_ms: float) -> None:
        """Take when a heartbeat was sent and when it came.

        Args:
            timing: Of the heartbeat.
            arrived_ms: By the device's own monotonic clock.
        """
        if timing.clock != self._clock:
            self._clock = timing.clock
            self._offsets_ms.clear()
        self._offsets_ms.append(arrived_ms - timing.sent_ms)

    def remaining_ms(self, timing: Timing, now_ms: float) -> float | None:
        """Return for how much longer a message holds; None: unknown, and then it counts as true.

        Args:
            timing: Of the message.
            now_ms: By the device's own monotonic clock.

        >>> clock = DeviceClock()
        >>> clock.learn(Timing("a", 1000.0, 3000.0, None), 501.0)
        >>> clock.remaining_ms(Timing("a", 2000.0, 5000.0, None), 2501.0)
        4000.0
        >>> clock.remaining_ms(Timing("b", 2000.0, 5000.0, None), 2501.0) is None
        True
        """
        if timing.clock != self._clock or not self._offsets_ms:
            return None
        late_ms = now_ms - timing.sent_ms - min(self._offsets_ms)
        return timing.remaining_ms - max(late_ms, 0.0)
