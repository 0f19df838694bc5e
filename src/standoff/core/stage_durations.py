"""Medians of any number of durations in a fixed amount of memory."""

from __future__ import annotations

import numpy as np

_STEP = 1.01
_SMALLEST_MS = 1e-3
_BINS = 2400


class Durations:
    """A histogram with bins one per cent wide, so that its quantiles are good to half a per cent."""

    def __init__(self) -> None:
        self._counts = np.zeros(_BINS, dtype=np.int64)
        self._total_ms = 0.0

    def add(self, duration_ms: float) -> None:
        """Count one duration."""
        steps = np.log(max(duration_ms, _SMALLEST_MS) / _SMALLEST_MS) / np.log(_STEP)
        self._counts[min(int(steps), _BINS - 1)] += 1
        self._total_ms += duration_ms

    def quantile_ms(self, fraction: float) -> float:
        """Return the duration that this fraction of them does not exceed; NaN when there are none."""
        below = np.cumsum(self._counts)
        if below[-1] == 0:
            return float("nan")
        step = int(np.searchsorted(below, fraction * below[-1], side="left"))
        return float(_SMALLEST_MS * _STEP ** (step + 0.5))

    def summary(self) -> dict[str, float]:
        """Return median, 90th percentile and total, in milliseconds."""
        return {
            "median_ms": round(self.quantile_ms(0.5), 4),
            "p90_ms": round(self.quantile_ms(0.9), 4),
            "total_ms": round(self._total_ms, 1),
        }
