"""The outlier filter of the paper, one per pair of tracks.

As printed, the filter compares with the mean of its own previous two estimates. Replacements are estimates, too: after
a real jump beyond the threshold the mean hardly moves again, and the filter repeats a stale distance for as long as the
pair stays there. At a few frames a second steady motion is enough: a loader at 12 m/s outruns the mean. The gate of the
locate stage's filter, which is what everybody else gets, cannot hold a value for longer than a third of a second.
"""

from __future__ import annotations

import math


class PaperFilter:
    """The rule as printed, without any notion of time.

    Source:
        Paper, section 5.1, step v.

    >>> paper = PaperFilter()
    >>> [paper.update(d, 2.0) for d in [10.0, 11.0, 30.0, 12.0]]
    [10.0, 11.0, 10.5, 12.0]
    """

    __slots__ = ("_before_last_m", "_last_m")

    def __init__(self) -> None:
        self._before_last_m = self._last_m = math.nan

    def update(self, distance_m: float, threshold_m: float) -> float:
        """Return the distance, or the mean of the previous two estimates where it is an outlier.

        Args:
            distance_m: As measured; finite.
            threshold_m: How far from the mean an outlier begins.
        """
        expected_m = (self._last_m + self._before_last_m) / 2.0
        # With fewer than two estimates the mean is NaN and the comparison False.
        estimate_m = expected_m if abs(distance_m - expected_m) > threshold_m else distance_m
        self._before_last_m, self._last_m = self._last_m, estimate_m
        return estimate_m
