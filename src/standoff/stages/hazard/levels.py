"""Which of the two levels a reading of a pair speaks for: near, and breached."""

from __future__ import annotations

import math
from typing import NamedTuple

from standoff.stages.hazard.latch import Reading
from standoff.stages.hazard.life_cycle import Limit
from standoff.stages.hazard.params import HazardParams

SURE = 0.95
"""What is so likely is beyond doubt; by distance nothing is."""
_RELEASE = 0.5
"""A level that a probability began ends at this share of it."""


class Levels(NamedTuple):
    """Both levels.

    Attributes:
        near: Warning.
        breached: Danger.
    """

    near: Limit
    breached: Limit


def levels_of(reading: Reading, params: HazardParams) -> Levels | None:
    """Return both levels; None where the reading tells nothing.

    An excused pair is clear. Where nobody predicts, the distance decides.
    """
    gap_m = reading.gap_m
    if params.caution_sigmas > 0:
        gap_m -= params.caution_sigmas * reading.sigma_m
    if math.isnan(gap_m):
        return None
    if reading.excuse:
        return Levels(Limit(False, True), Limit(False, True))
    if params.rule == "probability" and not math.isnan(reading.breach_ahead):
        return Levels(
            _above(reading.breach_ahead, params.warning_probability),
            _above(reading.breach_now, params.danger_probability, sure_from=max(params.danger_probability, SURE)),
        )
    return Levels(*(Limit(gap_m < limit, gap_m > limit + params.hysteresis_m) for limit in (params.buffer_m, 0.0)))


def _above(probability: float, limit: float, sure_from: float = math.inf) -> Limit:
    return Limit(probability >= limit, probability < _RELEASE * limit, probability >= sure_from)
