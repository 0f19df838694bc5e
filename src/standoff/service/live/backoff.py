"""How long to wait before the next attempt."""

from __future__ import annotations

import random
from typing import Final

_FIRST_S: Final = 0.2
_SOON_S: Final = 2.0
_LATER_S: Final = 10.0
_SOON_FOR_S: Final = 60.0


class Backoff:
    """Pauses between attempts: short ones in the first minute of an outage, longer ones later, for ever.

    Args:
        rng: For the jitter, so that many do not knock at the same moment.
    """

    def __init__(self, rng: random.Random | None = None) -> None:
        self._rng = rng or random.Random()
        self._since_s: float | None = None
        self._pause_s = _FIRST_S

    def failed(self, now_s: float) -> float:
        """Return how long to wait after one more attempt that failed.

        Args:
            now_s: Monotonic.
        """
        if self._since_s is None:
            self._since_s = now_s
        most_s = _SOON_S if now_s - self._since_s < _SOON_FOR_S else _LATER_S
        pause_s, self._pause_s = min(self._pause_s, most_s), min(2.0 * self._pause_s, _LATER_S)
        return pause_s * self._rng.uniform(0.5, 1.0)

    def succeeded(self) -> None:
        """Take that it works again."""
        self._since_s, self._pause_s = None, _FIRST_S
