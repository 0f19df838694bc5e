"""When a reading is near and when it is a breach, by either rule."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.stages.hazard.latch import UNMEASURED, Reading
from standoff.stages.hazard.levels import levels_of
from standoff.stages.hazard.life_cycle import Limit
from standoff.stages.hazard.params import HazardParams

PROBABLE = HazardParams(warning_probability=0.4, danger_probability=0.6)
DISTANT = HazardParams(rule="distance")


def reading(gap_m: float, now: float = math.nan, ahead: float = math.nan) -> Reading:
    return Reading(gap_m + 7.8, gap_m, 0.2, now, ahead)


@given(now=st.floats(0, 1), ahead=st.floats(0, 1), gap_m=st.floats(-7, 50))
def test_probabilities_decide_whatever_the_gap(now: float, ahead: float, gap_m: float) -> None:
    levels = levels_of(reading(gap_m, now, ahead), PROBABLE)
    assert levels is not None
    assert levels.near == Limit(ahead >= 0.4, ahead < 0.2)
    assert levels.breached == Limit(now >= 0.6, now < 0.3, now >= 0.95)
    cautious = levels_of(reading(gap_m, now, ahead), HazardParams(danger_probability=0.97))
    assert cautious is not None and cautious.breached.sure == (now >= 0.97)


@given(gap_m=st.floats(-7, 50), now=st.floats(0, 1), ahead=st.floats(0, 1))
def test_by_distance_probabilities_say_nothing_and_without_them_the_distance_does(
    gap_m: float, now: float, ahead: float
) -> None:
    by_distance = levels_of(reading(gap_m, now, ahead), DISTANT)
    assert by_distance is not None and by_distance == levels_of(reading(gap_m), PROBABLE)
    assert by_distance.near == Limit(gap_m < 1.0, gap_m > 1.5)
    assert by_distance.breached == Limit(gap_m < 0.0, gap_m > 0.5)


@pytest.mark.parametrize("params", [PROBABLE, DISTANT])
def test_what_was_not_measured_speaks_for_neither(params: HazardParams) -> None:
    assert levels_of(UNMEASURED, params) is None


@pytest.mark.parametrize("name", ["warning_probability", "danger_probability"])
@pytest.mark.parametrize("value", [math.nan, -0.1])
def test_a_probability_that_is_none_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        HazardParams(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("params", [PROBABLE, DISTANT])
def test_an_excused_pair_is_clear_however_near(params: HazardParams) -> None:
    levels = levels_of(Reading(1.0, -6.8, 0.2, 1.0, 1.0, "the machine is parked"), params)
    assert levels == (Limit(False, True), Limit(False, True))
