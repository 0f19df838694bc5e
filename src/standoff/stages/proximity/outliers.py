"""The outlier filter of the paper, one per pair of tracks, and a bounded form that cannot freeze.

As printed, the filter compares with the mean of its own previous two estimates. Replacements are
estimates, too: after a real jump beyond the threshold the mean hardly moves again, and the filter
repeats a stale distance for as long as the pair stays there. At a few frames a second steady motion
is enough: a loader at 12 m/s outruns the mean. The bounded form follows the same rule, but it keeps no
replacements, allows for motion, and forgets.
"""

from __future__ import annotations

import math
from typing import Protocol


class OutlierFilter(Protocol):
    """Filters the distances of one pair of tracks."""

    def update(self, time_s: float, distance_m: float, threshold_m: float) -> float:
        """Return the distance, or the mean of the previous two estimates where it is an outlier.

        Args:
            time_s: Presentation timestamp.
            distance_m: As measured; finite.
            threshold_m: How far from the mean an outlier begins.
        """
        ...


class PaperFilter:
    """The rule as printed, without any notion of time.

    Source:
        Paper, section 5.1, step v.

    >>> paper = PaperFilter()
    >>> [paper.update(0.1 * i, d, 2.0) for i, d in enumerate([10.0, 11.0, 30.0, 12.0])]
    [10.0, 11.0, 10.5, 12.0]
    """

    __slots__ = ("_before_last_m", "_last_m")

    def __init__(self) -> None:
        self._before_last_m = self._last_m = math.nan

    def update(self, time_s: float, distance_m: float, threshold_m: float) -> float:
        """Return the distance, or the mean of the previous two estimates where it is an outlier."""
        expected_m = (self._last_m + self._before_last_m) / 2.0
        # With fewer than two estimates the mean is NaN and the comparison False.
        estimate_m = expected_m if abs(distance_m - expected_m) > threshold_m else distance_m
        self._before_last_m, self._last_m = self._last_m, estimate_m
        return estimate_m


class BoundedFilter:
    """The paper's rule for what cannot be motion, and for a limited time only.

    Args:
        max_speed_mps: The threshold grows by this speed times the age of the mean.
        max_replaced_s: Estimates older than this are forgotten.

    >>> bounded = BoundedFilter(max_speed_mps=15.0, max_replaced_s=0.5)
    >>> [bounded.update(0.2 * i, d, 2.0) for i, d in enumerate([10.0, 11.0, 90.0, 90.0, 90.0])]
    [10.0, 11.0, 10.5, 10.5, 90.0]
    """

    __slots__ = ("_before_last", "_last", "_max_replaced_s", "_max_speed_mps")

    def __init__(self, max_speed_mps: float, max_replaced_s: float) -> None:
        self._max_speed_mps = max_speed_mps
        self._max_replaced_s = max_replaced_s
        self._before_last = self._last = (math.nan, math.nan)

    def update(self, time_s: float, distance_m: float, threshold_m: float) -> float:
        """Return the distance, or the mean of the previous two estimates where it is an outlier."""
        (before_s, before_m), (last_s, last_m) = self._before_last, self._last
        if time_s - last_s > self._max_replaced_s:
            last_m = math.nan
            self._last = (math.nan, math.nan)
        expected_m = (last_m + before_m) / 2.0
        reachable_m = self._max_speed_mps * (time_s - (last_s + before_s) / 2.0)
        if abs(distance_m - expected_m) > threshold_m + reachable_m:
            return expected_m
        self._before_last, self._last = self._last, (time_s, distance_m)
        return distance_m
