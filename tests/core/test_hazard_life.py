"""What the events of a hazard say of it as a whole."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.core.hazard_life import HazardLife
from standoff.core.hazards import GRAVENESS, Hazard, Phase, Severity

_GAPS = st.one_of(st.just(math.nan), st.floats(-5.0, 20.0))
_EVENTS = st.lists(st.tuples(st.sampled_from(GRAVENESS), _GAPS), min_size=1, max_size=12)


def event(time_s: float, severity: Severity, gap_m: float, phase: Phase = "updated", reason: str = "") -> Hazard:
    return Hazard("01M8", "proximity", severity, phase, (1, 4), time_s, gap_m + 5.0, gap_m, 0.3, reason)


def life_of(events: list[Hazard]) -> HazardLife:
    life = HazardLife.begun(events[0], ("worker", "excavator"), 0)
    for frame, one in enumerate(events[1:], start=1):
        life.take(one, frame)
    return life


@given(_EVENTS)
def test_a_life_is_as_grave_as_its_gravest_event_and_as_near_as_its_nearest(
    said: list[tuple[Severity, float]],
) -> None:
    events = [event(float(k), severity, gap_m) for k, (severity, gap_m) in enumerate(said)]
    life = life_of(events)
    gravest = max(events, key=lambda one: GRAVENESS.index(one.severity)).severity
    gaps = [one.gap_m for one in events if not math.isnan(one.gap_m)]
    assert life.severity == gravest
    assert life.gap_m == min(gaps) if gaps else math.isnan(life.gap_m)
    assert life.worst_frame is not None
    worst = events[life.worst_frame]
    assert worst.severity == gravest and worst.time_s == life.worst_s
    among = [one.gap_m for one in events if one.severity == gravest and not math.isnan(one.gap_m)]
    assert life.worst_gap_m == min(among) if among else math.isnan(life.worst_gap_m)


@given(_EVENTS)
def test_at_each_time_it_is_as_grave_as_the_last_event_said(said: list[tuple[Severity, float]]) -> None:
    events = [event(float(k), severity, gap_m) for k, (severity, gap_m) in enumerate(said)]
    life = life_of([*events, event(len(said), said[-1][0], math.nan, "closed", "clear for 0.5 s")])
    for k, (severity, _) in enumerate(said):
        assert life.severity_at(float(k)) == life.severity_at(k + 0.5) == severity
    assert life.severity_at(-0.5) is None and life.severity_at(float(len(said))) is None
    assert (life.closed_s, life.reason) == (len(said), "clear for 0.5 s")


def test_what_is_open_lasts_to_the_end_of_the_run() -> None:
    life = life_of([event(2.0, "warning", 0.5, "opened"), event(3.0, "danger", -1.0)])
    assert life.lasted_s(10.0) == pytest.approx(8.0)
    assert life.who == "worker and excavator"


def test_a_machine_alone_is_near_somebody_whom_nobody_follows() -> None:
    opened = replace(event(2.0, "unknown", math.nan, "opened", "somebody may stand near it"), track_ids=(4,))
    assert HazardLife.begun(opened, ("excavator 4",)).who == "excavator 4 and perhaps somebody"
    in_zone = replace(opened, rule="zone", zone="pit")
    assert HazardLife.begun(in_zone, ("excavator 4",)).who == "excavator 4: zone pit"
    assert HazardLife.begun(replace(opened, rule="measurement", track_ids=()), ()).who == "whole picture (measurement)"
