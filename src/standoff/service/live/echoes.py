"""How long it takes until an alert is shown, by the echoes of those who show it: no clocks have to agree."""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from standoff.messages import Echo
from standoff.service.live.percentiles import Percentiles

_MOST: Final = 5000


class Echoes:
    """Remembers what was sent until its echo comes.

    Attributes:
        to_wrist_ms: From a picture's capture to its alert on a device.
        to_device_ms: From the sending of an alert until it is shown.
    """

    def __init__(self) -> None:
        self._sent: OrderedDict[str, tuple[float | None, float]] = OrderedDict()
        self.to_wrist_ms, self.to_device_ms = Percentiles(), Percentiles()

    def expect(self, letter_id: str, captured_s: float | None, sent_s: float) -> None:
        """Take that a letter was sent.

        Args:
            letter_id: Of the letter; what is not echoed is forgotten after some thousand others.
            captured_s: When the picture was taken that it rests on, monotonic; None: unknown.
            sent_s: When, monotonic.
        """
        self._sent[letter_id] = (captured_s, sent_s)
        while len(self._sent) > _MOST:
            self._sent.popitem(last=False)

    def take(self, echo: Echo, at_s: float) -> None:
        """Take an echo: the way back is taken for half of the round that the message made; what nobody sent is none.

        >>> echoes = Echoes()
        >>> echoes.expect("alert", captured_s=9.9, sent_s=10.0)
        >>> echoes.take(Echo("alert", held_ms=2.0), at_s=10.012)
        >>> echoes.to_wrist_ms.summary()["p50"], echoes.to_device_ms.summary()["p50"]
        (107.0, 7.0)
        """
        sent = self._sent.pop(echo.id, None)
        if sent is None:
            return
        captured_s, sent_s = sent
        way_back_s = max(0.0, (at_s - sent_s - echo.held_ms / 1e3) / 2.0)
        self.to_device_ms.add((at_s - sent_s - way_back_s) * 1e3)
        if captured_s is not None:
            self.to_wrist_ms.add((at_s - way_back_s - captured_s) * 1e3)
