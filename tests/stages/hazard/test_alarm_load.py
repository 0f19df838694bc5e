"""Alarms for each worker and hour, and what would make them fewer."""

from __future__ import annotations

import numpy as np
import pytest
from stages.hazard.frames_of_gaps import frame

from standoff.core.types import GroundPositions, Hazard
from standoff.stages.hazard.alarm_load import AlarmLoad


def said(number: int, *, ahead: float = 0.4, severity: str = "warning", rule: str = "proximity") -> Hazard:
    return Hazard(str(number), rule, severity, "opened", (1, 2), 0.0, 8.0, 0.2, 0.1, breach_ahead=ahead)  # type: ignore[arg-type]


def workers(count: int) -> GroundPositions:
    """Return so many workers, all of them placed."""
    return frame({(2 * k + 1, 2 * k + 2): 5.0 for k in range(count // 2)})[0]


def after(hours: float, events: list[Hazard], *, people: int = 2) -> AlarmLoad:
    load, positions = AlarmLoad(), workers(people)
    steps = round(hours * 3600.0 / 2.0)
    for k in range(steps + 1):
        load.update(2.0 * k, positions, events if k == steps else [])
    return load


def test_hours_are_those_of_all_workers_who_are_placed() -> None:
    assert after(0.5, [], people=4).describe() == {"worker_hours": 2.0, "alarms": 0, "per_worker_hour": 0.0}


def test_alarms_are_counted_once_and_what_is_unknown_is_none() -> None:
    events = [said(1), said(1, severity="danger"), said(2), said(3, severity="unknown"), said(4, rule="measurement")]
    assert after(0.5, events).describe() == {"worker_hours": 1.0, "alarms": 2, "per_worker_hour": 2.0}


def test_of_a_few_minutes_no_rate_is_told() -> None:
    load = after(0.1, [said(k) for k in range(50)])
    assert load.describe()["per_worker_hour"] is None and not load.warnings


def test_a_pause_in_the_stream_is_no_work() -> None:
    load, positions = AlarmLoad(), workers(2)
    for time_s in (0.0, 1.0, 3601.0, 3602.0):
        load.update(time_s, positions, [])
    assert load.describe()["worker_hours"] == pytest.approx(2 * 7.0 / 3600.0)


def test_too_many_are_named_with_the_setting_that_leaves_few_enough() -> None:
    likely = [*np.linspace(0.31, 0.69, 20), *[0.95] * 4]
    (warning,) = after(0.5, [said(k, ahead=one) for k, one in enumerate(likely)]).warnings
    assert warning.startswith(
        "24 alarms for each worker and hour: the rule is not usable as set (24 of 24 between worker"
    )
    assert "hazard.warning_probability: 0.7 would leave 4.0" in warning
    (warning,) = after(0.5, [said(k, severity="danger") for k in range(30)]).warnings
    assert "no probability would do: set smaller radii" in warning
    assert not after(0.5, [said(k) for k in range(6)]).warnings
