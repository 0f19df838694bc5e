"""The hazard of one pair of tracks, by the gap between them."""

from __future__ import annotations

import math

from standoff.core.types import Hazard
from standoff.stages.hazard.life import Reading
from standoff.stages.hazard.params import HazardParams
from standoff.stages.hazard.watch import Limit, Watch


class PairWatch(Watch):
    """Watch one pair: near is a gap within the buffer, breached a negative one.

    Args:
        track_ids: Smaller id first.
        params: Settings.
    """

    def __init__(self, track_ids: tuple[int, int], params: HazardParams) -> None:
        super().__init__("proximity", track_ids, params)

    def measurable(self, reading: Reading) -> bool:
        """Tell whether a reading says how near the pair is; NaN never does."""
        return not math.isnan(self._cautious_gap_m(reading))

    def measure_gap(self, time_s: float, reading: Reading) -> Hazard | None:
        """Take a measurement and return what there is to say of it."""
        gap_m = self._cautious_gap_m(reading)
        return self.measure(time_s, reading, self._limit(gap_m, self._params.buffer_m), self._limit(gap_m, 0.0))

    def _limit(self, gap_m: float, limit_m: float) -> Limit:
        return Limit(gap_m < limit_m, gap_m > limit_m + self._params.hysteresis_m)

    def _cautious_gap_m(self, reading: Reading) -> float:
        caution = self._params.caution_sigmas
        return reading.gap_m - caution * reading.sigma_m if caution > 0 else reading.gap_m
