"""A sink behind a queue: nobody waits for it, and it misses no event, whatever it does."""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import monotonic, sleep

import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from stages.sinks.fake_site import FakeSite

from standoff.core.hazards import OpenHazards
from standoff.core.types import FrameResult, Outcome, Silence
from standoff.monitor import LiveQueue

RESULTS = list(FakeSite((64, 36)).results(150))
EVENTS = [event for result in RESULTS for event in result.hazards]
PATIENCE_S = 5.0


class Receiver:
    """A sink that can be held up, and can be away for some attempts."""

    def __init__(self, fails: int = 0) -> None:
        self.fails, self.attempts = fails, 0
        self.results: list[FrameResult] = []
        self.silences: list[Silence] = []
        self.outcomes: list[Outcome] = []
        self.gate = threading.Event()
        self.gate.set()

    def write(self, result: FrameResult) -> None:
        self.gate.wait(PATIENCE_S)
        self.attempts += 1
        if self.attempts <= self.fails:
            raise ConnectionError("broker is away")
        self.results.append(result)

    def tell(self, silence: Silence) -> None:
        self.silences.append(silence)

    def close(self, outcome: Outcome) -> None:
        self.outcomes.append(outcome)


def until(condition: Callable[[], bool]) -> None:
    end_s = monotonic() + PATIENCE_S
    while not condition() and monotonic() < end_s:
        sleep(0.005)
    assert condition()


def test_a_sink_that_keeps_up_sees_every_frame_once_and_in_order() -> None:
    receiver = Receiver()
    queue = LiveQueue(receiver)
    for number, result in enumerate(RESULTS[:20], start=1):
        queue.write(result)
        until(lambda number=number: len(receiver.results) == number)  # type: ignore[misc]
    queue.close(Outcome("complete"))
    assert receiver.results == RESULTS[:20]
    assert [outcome.status for outcome in receiver.outcomes] == ["complete"]
    assert queue.state.superseded == 0


@examples(15)
@given(size=st.integers(1, 4))
def test_while_it_is_slow_the_newest_wins_and_no_event_is_lost(size: int) -> None:
    receiver = Receiver()
    receiver.gate.clear()
    queue = LiveQueue(receiver, size)
    begun_s = monotonic()
    for result in RESULTS:
        queue.write(result)
    assert monotonic() - begun_s < 1.0  # nobody waited for it
    assert queue.state.waiting <= size
    receiver.gate.set()
    queue.close(Outcome("complete"))
    assert receiver.results[-1].frame is RESULTS[-1].frame
    assert len(receiver.results) + queue.state.superseded == len(RESULTS)
    assert [event for result in receiver.results for event in result.hazards] == EVENTS
    indices = [result.frame.index for result in receiver.results]
    assert indices == sorted(indices)


@pytest.mark.parametrize("fails", [1, 3])
def test_a_sink_that_was_away_is_tried_again_and_gets_every_event(fails: int) -> None:
    receiver = Receiver(fails)
    queue = LiveQueue(receiver)
    for result in RESULTS[:40]:
        queue.write(result)
    until(lambda: bool(receiver.results) and not queue.state.waiting)
    assert queue.state.failures == 0 and not queue.state.error
    queue.close(Outcome("complete"))
    told = [event for result in receiver.results for event in result.hazards]
    assert told == [event for result in RESULTS[:40] for event in result.hazards]


def test_a_sink_that_stays_away_says_so_and_holds_nobody_up() -> None:
    receiver = Receiver(fails=10**6)
    queue = LiveQueue(receiver, patience_s=0.2)
    queue.write(RESULTS[0])
    until(lambda: queue.state.failures > 0)
    assert queue.state.error == "broker is away"
    begun_s = monotonic()
    with pytest.raises(TimeoutError, match=f"{len(RESULTS[0].hazards)} events not delivered: broker is away"):
        queue.close(Outcome("complete"))
    assert monotonic() - begun_s < 2.0
    attempts = receiver.attempts
    assert attempts < 20  # it rests between them
    sleep(0.5)
    assert receiver.attempts <= attempts + 1  # and nobody tries for ever


def test_the_news_that_nothing_arrives_comes_in_its_turn() -> None:
    receiver = Receiver()
    queue = LiveQueue(receiver, size=4)
    silence = Silence("gate", 9.0, "no picture arrives", (), OpenHazards())
    queue.write(RESULTS[0])
    queue.tell(silence)
    queue.close(Outcome("failed", "lost"))
    assert (receiver.results, receiver.silences) == ([RESULTS[0]], [silence])
