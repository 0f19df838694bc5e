from __future__ import annotations

from datetime import timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.core.clock import StreamClock
from standoff.testing import FakeClock

STEPS = st.tuples(st.floats(0.0, 3.0), st.floats(-1e6, 1e6), st.booleans())


@given(st.lists(STEPS, min_size=2, max_size=40))
def test_time_rises_whatever_the_sender_stamps(steps: list[tuple[float, float, bool]]) -> None:
    machine = FakeClock()
    clock, last_s = StreamClock(machine), -1.0
    for passed_s, stamp_s, is_new in steps:
        machine.pass_s(passed_s)
        if is_new:
            clock.reconnect()
        now = clock.at(stamp_s)
        assert now.time_s > last_s
        last_s = now.time_s


@given(st.floats(-1e5, 1e5), st.lists(st.floats(0.01, 2.0), min_size=1, max_size=30), st.floats(0.0, 0.5))
def test_within_a_connection_time_follows_the_stamps_and_not_when_they_arrive(
    first_s: float, steps_s: list[float], late_s: float
) -> None:
    machine = FakeClock()
    clock, stamp_s = StreamClock(machine), first_s
    assert clock.at(stamp_s).time_s == 0.0
    for number, step_s in enumerate(steps_s):
        machine.pass_s(step_s + late_s * (-1) ** number if number else step_s)
        stamp_s += step_s
        assert clock.at(stamp_s).time_s == pytest.approx(stamp_s - first_s, abs=1e-6)


def test_across_a_reconnect_time_goes_on_by_what_passed_here() -> None:
    machine = FakeClock()
    clock = StreamClock(machine)
    clock.at(700.0)
    machine.pass_s(1.0)
    assert clock.at(701.0).time_s == 1.0
    machine.pass_s(8.0)
    assert clock.now_s() == 9.0
    clock.reconnect()
    assert clock.at(3.0).time_s == 9.0
    machine.pass_s(0.5)
    assert clock.at(3.5).time_s == 9.5


@pytest.mark.parametrize("stamp_s", [0.0, 90000.0])
def test_an_encoder_that_begins_anew_is_a_new_connection(stamp_s: float) -> None:
    machine = FakeClock()
    clock = StreamClock(machine)
    clock.at(50.0)
    machine.pass_s(0.1)
    assert clock.at(stamp_s).time_s == pytest.approx(0.1)


def test_somebody_who_sets_the_clock_does_not_move_the_streams_time() -> None:
    machine = FakeClock()
    clock = StreamClock(machine)
    clock.at(5.0)
    machine.set_by(timedelta(hours=-1))
    machine.pass_s(0.2)
    moved = clock.at(5.2)
    assert moved.time_s == pytest.approx(0.2)
    assert moved.captured_at == machine.utc()


def test_utc_says_who_told_it_and_is_believed_only_where_it_can_be() -> None:
    machine = FakeClock()
    clock = StreamClock(machine)
    sent = machine.utc() - timedelta(seconds=0.4)
    told = clock.at(0.0, sent, "rtcp")
    assert (told.captured_at, told.told_by) == (sent, "rtcp")
    for wrong in (timedelta(days=-20), timedelta(seconds=30)):
        unset = clock.at(0.1, machine.utc() + wrong, "rtcp")
        assert (unset.captured_at, unset.told_by) == (machine.utc(), "arrival")
    filmed = clock.at(0.2, machine.utc() - timedelta(days=20), "file")
    assert (filmed.captured_at, filmed.told_by) == (machine.utc() - timedelta(days=20), "file")
    assert clock.at(0.3).told_by == "arrival"
