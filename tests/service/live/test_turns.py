"""Whose turn it is, and how long to wait: nobody starves, nobody saves up, nobody knocks too often or too rarely."""

from __future__ import annotations

import random

from hypothesis import given
from hypothesis import strategies as st
from laws import examples

from standoff.service.live.backoff import Backoff
from standoff.service.live.turns import Turns

COSTS = st.floats(0.001, 1.0)
TOLERANCE_S = 1e-6


@examples(20)
@given(st.lists(COSTS, min_size=1, max_size=6), st.randoms(use_true_random=False))
def test_who_always_waits_gets_an_equal_share_whatever_a_turn_costs(dearest_s: list[float], rng: random.Random) -> None:
    turns, used_s = Turns(), dict.fromkeys((f"s{k}" for k in range(len(dearest_s))), 0.0)
    for _ in range(200):
        name = turns.next_of(list(used_s))
        cost_s = dearest_s[int(name[1:])] * rng.uniform(0.1, 1.0)
        turns.used(name, cost_s)
        used_s[name] += cost_s
        assert max(used_s.values()) - min(used_s.values()) <= max(dearest_s) + TOLERANCE_S


@examples(20)
@given(st.lists(COSTS, min_size=2, max_size=5), st.integers(1, 40), st.randoms(use_true_random=False))
def test_whoever_rests_saves_nothing(dearest_s: list[float], pace: int, rng: random.Random) -> None:
    """While two wait together, neither is given more than one turn above what the other is given."""
    turns, names = Turns(), [f"s{k}" for k in range(len(dearest_s))]
    resting: set[str] = set()
    together_s: dict[tuple[str, str], dict[str, float]] = {}
    for step in range(200):
        if step % pace == 0:
            resting = {name for name in names if rng.random() < 0.5} - {rng.choice(names)}
        waiting = [name for name in names if name not in resting]
        name = turns.next_of(waiting)
        cost_s = dearest_s[int(name[1:])] * rng.uniform(0.1, 1.0)
        turns.used(name, cost_s)
        for one in names:
            for other in names[names.index(one) + 1 :]:
                if resting & {one, other}:
                    together_s.pop((one, other), None)
                    continue
                given_s = together_s.setdefault((one, other), {one: 0.0, other: 0.0})
                if name in given_s:
                    given_s[name] += cost_s
                # Who comes back may owe for one turn that it took just before it left.
                assert abs(given_s[one] - given_s[other]) <= 2.0 * max(dearest_s) + TOLERANCE_S


def test_a_dear_stream_does_not_hold_up_cheap_ones() -> None:
    turns, counts = Turns(), {"dear": 0, "cheap": 0}
    for _ in range(1010):
        name = turns.next_of(["dear", "cheap"])
        turns.used(name, 1.0 if name == "dear" else 0.01)
        counts[name] += 1
    assert counts == {"dear": 10, "cheap": 1000}


def test_one_that_is_new_waits_for_no_more_than_the_others_and_takes_no_more() -> None:
    turns = Turns()
    for _ in range(100):
        turns.used(turns.next_of(["a", "b"]), 1.0)
    order = []
    for _ in range(9):
        order.append(turns.next_of(["a", "b", "new"]))
        turns.used(order[-1], 1.0)
    assert {name: order.count(name) for name in ("a", "b", "new")} == {"a": 3, "b": 3, "new": 3}
    assert "new" in order[:3]


@given(st.integers(0, 2**32), st.lists(st.floats(0.0, 30.0), min_size=1, max_size=40))
def test_pauses_are_short_in_the_first_minute_and_never_long(seed: int, passed_s: list[float]) -> None:
    backoff, now_s = Backoff(random.Random(seed)), 1e4
    began_s, doubled_s = now_s, 0.2
    for step_s in passed_s:
        pause_s = backoff.failed(now_s)
        most_s = min(doubled_s, 2.0 if now_s - began_s < 60.0 else 10.0)
        assert most_s / 2.0 <= pause_s <= most_s
        doubled_s *= 2.0
        now_s += step_s


@given(st.integers(0, 2**32), st.integers(1, 30))
def test_after_a_success_the_pauses_are_short_again(seed: int, failures: int) -> None:
    backoff = Backoff(random.Random(seed))
    for number in range(failures):
        backoff.failed(100.0 * number)
    backoff.succeeded()
    assert 0.1 <= backoff.failed(1e6) <= 0.2


def test_an_outage_of_a_day_ends_within_ten_seconds_of_its_cause() -> None:
    backoff, now_s, attempts = Backoff(random.Random(1)), 0.0, 0
    while now_s < 86_400.0:
        now_s += backoff.failed(now_s)
        attempts += 1
    assert 86_400 / 10 <= attempts <= 86_400 / 5 + 100


def test_many_do_not_knock_at_the_same_moment() -> None:
    pauses = {Backoff(random.Random(seed)).failed(0.0) for seed in range(50)}
    assert len(pauses) == 50
