"""How long something usually takes, and at worst."""

from __future__ import annotations

from collections import deque

import numpy as np


class Percentiles:
    """Of the latest values of something.

    Args:
        most: How many of them count.
    """

    def __init__(self, most: int = 1500) -> None:
        self._values: deque[float] = deque(maxlen=most)

    def add(self, value: float) -> None:
        """Take a value."""
        self._values.append(value)

    def summary(self) -> dict[str, float] | None:
        """Return the 50th, 95th and 99th percentile, rounded, and of how many; None without values.

        >>> some = Percentiles()
        >>> for value in range(101): some.add(value)
        >>> some.summary()
        {'p50': 50.0, 'p95': 95.0, 'p99': 99.0, 'count': 101}
        """
        if not self._values:
            return None
        p50, p95, p99 = np.percentile(self._values, (50, 95, 99)).tolist()
        return {"p50": round(p50, 1), "p95": round(p95, 1), "p99": round(p99, 1), "count": len(self._values)}
