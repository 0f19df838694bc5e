"""A receiver warns rather than not, warns once, never of what is over, and says when nobody watches over its wearer."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from service.wearable.made_words import alert, supervision

from standoff.core.hazards import GRAVENESS
from standoff.service.wearable import Receiver, Signal

DELAYS_MS = st.floats(0.0, 2500.0)


def receiver(heard_ms: float = 0.0) -> Receiver:
    """Return one that has just heard that its wearer is supervised."""
    made = Receiver("wrist")
    assert not made.take_supervision(supervision(heard_ms), heard_ms).dropped
    return made


def test_an_alert_is_shown_sounds_and_is_echoed() -> None:
    made = receiver()
    done = made.take_alert(alert("e-1"), 40.0)
    assert (done.topic, done.sounds, done.dropped) == ("echo", "danger", "")
    assert json.loads(done.payload) == {"id": "e-1", "held_ms": 0.0}
    shown = made.shown(40.0)
    assert (shown.level, shown.is_acknowledged) == ("danger", False)
    assert shown.alert is not None and shown.alert.hazard.hazard_id == "h-1"


def test_what_comes_twice_is_taken_once() -> None:
    made = receiver()
    made.take_alert(alert("e-1"), 40.0)
    assert made.take_alert(alert("e-1"), 41.0) == Signal(dropped="known already")
    assert made.take_alert(alert("e-2"), 42.0).sounds == "danger"


def test_what_asks_to_be_silent_is_shown_and_does_not_sound() -> None:
    made = receiver()
    assert made.take_alert(alert(silent=True), 40.0).sounds == ""
    assert made.shown(40.0).level == "danger"


@pytest.mark.parametrize(
    ("delay_ms", "dropped"), [(0.0, False), (4990.0, False), (5010.0, True), (1e6, True), (-50.0, False)]
)
def test_what_is_too_late_is_dropped(delay_ms: float, dropped: bool) -> None:
    made = receiver()
    done = made.take_alert(alert(), delay_ms)
    assert (done.dropped == "too late") == dropped == (done.sounds == "")
    assert (made.shown(max(delay_ms, 0.0)).alert is None) == dropped


def test_an_alert_is_shown_for_as_long_as_it_holds() -> None:
    made = receiver()
    made.take_alert(alert(remaining_ms=2000.0), 100.0)
    assert made.shown(1999.0).level == "danger"
    assert made.shown(2001.0).level == "supervised"


@pytest.mark.parametrize("clock", ["boot-2", ""])
def test_an_alert_whose_age_nobody_can_tell_warns_for_a_while(clock: str) -> None:
    made = receiver()
    assert made.take_alert(alert(clock=clock, sent_ms=-1e9), 40.0).sounds == "danger"
    assert made.shown(5030.0).level == "danger"
    assert made.shown(5050.0).level == "unsupervised"
    assert Receiver("wrist").take_alert(alert(), 1e9).sounds == "danger"


def test_an_alert_without_a_moment_of_sending_warns_too() -> None:
    event = {name: value for name, value in json.loads(alert()).items() if name != "clock"}
    assert receiver().take_alert(json.dumps(event).encode(), 40.0).sounds == "danger"


def test_after_the_service_began_anew_its_clock_is_learnt_anew() -> None:
    made = receiver()
    assert not made.take_supervision(supervision(-4e6, clock="boot-2"), 2000.0).dropped
    assert made.take_alert(alert("e-1", -4e6, clock="boot-2"), 2040.0).sounds == "danger"
    assert made.take_alert(alert("e-2", -4e6, clock="boot-2"), 9000.0).dropped == "too late"
    assert made.shown(2100.0).level == "danger"


@pytest.mark.parametrize("take", ["take_alert", "take_supervision"])
@pytest.mark.parametrize("payload", [b"", b"{}", b"\xff", b"[]", alert(device="other"), supervision(device="other")])
def test_what_is_not_for_it_or_nothing_at_all_is_dropped(take: str, payload: bytes) -> None:
    made = receiver()
    done = getattr(made, take)(payload, 40.0)
    assert done.dropped and not done.topic and not done.sounds
    assert made.shown(40.0).level == "supervised"


def test_a_word_on_supervision_without_its_moment_is_no_word() -> None:
    event = {name: value for name, value in json.loads(supervision()).items() if name != "clock"}
    made = Receiver("wrist")
    assert made.take_supervision(json.dumps(event).encode(), 0.0).dropped == "without the moment of its sending"
    assert made.shown(0.0).level == "unsupervised"


def test_nobody_is_supervised_before_the_first_word_and_three_seconds_after_the_last() -> None:
    assert Receiver("wrist").shown(0.0).level == "unsupervised"
    made = receiver(heard_ms=1000.0)
    for now_ms, level in (
        (1000.0, "supervised"),
        (3999.0, "supervised"),
        (4001.0, "unsupervised"),
        (1e9, "unsupervised"),
    ):
        assert made.shown(now_ms).level == level
    assert made.shown(4001.0).silence_s == pytest.approx(3.001)


def test_a_word_that_was_held_up_is_no_word_of_now() -> None:
    made = receiver()
    assert made.take_supervision(supervision(1000.0), 4100.0).dropped == "too late"
    assert made.shown(4100.0).level == "unsupervised"


def test_why_nobody_watches_is_said() -> None:
    made = receiver()
    made.take_supervision(supervision(1000.0, supervised=False, reason="gate: blurred"), 1000.0)
    shown = made.shown(1000.0)
    assert (shown.level, shown.reason) == ("unsupervised", "gate: blurred")


def test_what_is_over_is_taken_away() -> None:
    made = receiver()
    made.take_alert(alert("e-1"), 40.0)
    done = made.take_alert(alert("e-2", phase="closed", silent=True), 1000.0)
    assert (done.sounds, done.topic) == ("", "echo")
    assert made.shown(1000.0).level == "supervised"


def test_graver_sounds_again_and_needs_to_be_noted_again() -> None:
    made = receiver()
    made.take_alert(alert("e-1", severity="warning"), 40.0)
    (noted,) = made.acknowledge(50.0)
    assert (noted.topic, json.loads(noted.payload)) == ("ack", {"hazard_id": "h-1"})
    assert made.take_alert(alert("e-2", severity="danger", phase="updated"), 60.0).sounds == "danger"
    assert not made.shown(60.0).is_acknowledged
    assert len(made.acknowledge(70.0)) == 1 and made.acknowledge(80.0) == []
    made.take_alert(alert("e-3", severity="danger", phase="updated", silent=True), 90.0)
    shown = made.shown(90.0)
    assert (shown.level, shown.is_acknowledged) == ("danger", True)


def test_a_warning_that_was_noted_is_not_shown_and_danger_is() -> None:
    made = receiver()
    made.take_alert(alert("e-1", severity="warning"), 40.0)
    made.acknowledge(50.0)
    assert made.shown(60.0).level == "supervised"
    made.take_alert(alert("e-2", hazard_id="h-2"), 70.0)
    made.acknowledge(80.0)
    assert (made.shown(90.0).level, made.shown(90.0).is_acknowledged) == ("danger", True)


def test_all_that_is_shown_is_noted_at_once() -> None:
    made = receiver()
    for number in range(3):
        made.take_alert(alert(f"e-{number}", hazard_id=f"h-{number}"), 40.0)
    assert {json.loads(one.payload)["hazard_id"] for one in made.acknowledge(50.0)} == {"h-0", "h-1", "h-2"}
    made.take_alert(alert("e-9", hazard_id="h-9", remaining_ms=100.0), 60.0)
    assert made.acknowledge(200.0) == []


@pytest.mark.parametrize("severities", [("warning", "warning"), ("warning", "unknown"), ("danger", "warning")])
def test_what_was_noted_does_not_hide_what_was_not(severities: tuple[str, str]) -> None:
    first, second = severities
    made = receiver()
    made.take_alert(alert("e-1", hazard_id="h-1", severity=first), 40.0)
    made.acknowledge(50.0)
    made.take_alert(alert("e-2", hazard_id="h-2", severity=second), 60.0)
    shown = made.shown(70.0)
    assert shown.level == (first if first == "danger" else second)
    if first != "danger":
        assert shown.alert is not None and shown.alert.hazard.hazard_id == "h-2" and not shown.is_acknowledged


def test_of_two_dangers_the_one_that_nobody_noted_is_shown() -> None:
    made = receiver()
    made.take_alert(alert("e-1", hazard_id="h-1"), 40.0)
    made.acknowledge(50.0)
    made.take_alert(alert("e-2", hazard_id="h-2"), 60.0)
    shown = made.shown(70.0)
    assert shown.alert is not None and shown.alert.hazard.hazard_id == "h-2" and not shown.is_acknowledged


@pytest.mark.parametrize("last", [{"phase": "closed"}, {"phase": "unknown"}, {"severity": "warning"}])
def test_an_alert_that_was_overtaken_by_a_newer_one_neither_sounds_nor_counts(last: dict[str, Any]) -> None:
    made = receiver()
    made.take_alert(alert("e-2", time_s=12.0, **{"phase": "updated", "silent": True, **last}), 40.0)
    before = made.shown(60.0)
    done = made.take_alert(alert("e-1", time_s=10.0, severity="danger"), 50.0)
    assert done.sounds == "" and done.dropped
    assert made.shown(60.0).level == before.level


def test_a_hazard_that_is_not_known_any_more_is_shown_as_such() -> None:
    made = receiver()
    made.take_alert(alert("e-1"), 40.0)
    made.take_alert(alert("e-2", phase="unknown", reason="no picture comes", silent=True), 50.0)
    shown = made.shown(60.0)
    assert (shown.level, shown.reason) == ("unknown", "no picture comes")


def test_a_change_of_level_is_told_once() -> None:
    made = Receiver("wrist")
    assert made.changed_to(0.0) is None
    made.take_supervision(supervision(0.0), 0.0)
    assert (made.changed_to(0.0), made.changed_to(1.0)) == ("supervised", None)
    made.take_alert(alert(), 10.0)
    assert (made.changed_to(10.0), made.changed_to(11.0)) == ("danger", None)
    assert (made.changed_to(6000.0), made.changed_to(9000.0)) == ("unsupervised", None)


@given(
    offset_ms=st.floats(-1e9, 1e9),
    heard=st.lists(DELAYS_MS, min_size=1, max_size=30),
    delay_ms=st.floats(0.0, 12_000.0),
    remaining_ms=st.floats(100.0, 10_000.0),
)
def test_no_alert_is_acted_on_after_its_end_by_more_than_the_quickest_words_delay(
    offset_ms: float, heard: list[float], delay_ms: float, remaining_ms: float
) -> None:
    """Whatever the device's clock shows: it knows the service's by the words on supervision alone."""
    made = Receiver("wrist")
    for number, word_ms in enumerate(heard):
        made.take_supervision(supervision(1000.0 * number), offset_ms + 1000.0 * number + word_ms)
    sent_ms = 1000.0 * len(heard)
    done = made.take_alert(alert(sent_ms=sent_ms, remaining_ms=remaining_ms), offset_ms + sent_ms + delay_ms)
    slack_ms = 0.01
    if not done.dropped:
        assert delay_ms <= remaining_ms + min(heard) + slack_ms
        latest_ms = offset_ms + sent_ms + remaining_ms + min(heard) + slack_ms
        assert made.shown(latest_ms).alert is None
    else:
        assert delay_ms > remaining_ms - slack_ms
    if delay_ms < remaining_ms - slack_ms:
        assert not done.dropped


@given(
    st.lists(
        st.none()
        | st.tuples(
            st.sampled_from(["h-1", "h-2", "h-3"]),
            st.sampled_from(["opened", "updated", "unknown", "closed"]),
            st.sampled_from(["warning", "danger"]),
        ),
        max_size=25,
    )
)
def test_the_gravest_is_shown_that_nobody_noted_or_that_is_danger(life: list[tuple[str, str, str] | None]) -> None:
    made, held = receiver(), dict[str, tuple[str, bool]]()
    for number, step in enumerate(life):
        if step is None:
            noted = {json.loads(one.payload)["hazard_id"] for one in made.acknowledge(10.0)}
            assert noted == {name for name, (_, is_noted) in held.items() if not is_noted}
            held = {name: (level, True) for name, (level, _) in held.items()}
            continue
        hazard_id, phase, severity = step
        made.take_alert(alert(f"e-{number}", hazard_id=hazard_id, phase=phase, severity=severity, time_s=number), 10.0)
        before = held.pop(hazard_id, ("unknown", False))
        level = "unknown" if phase == "unknown" else severity
        if phase != "closed":
            held[hazard_id] = (level, before[1] and GRAVENESS.index(level) <= GRAVENESS.index(before[0]))
    standing = [(level, not is_noted) for level, is_noted in held.values() if level == "danger" or not is_noted]
    gravest = max(standing, key=lambda one: (GRAVENESS.index(one[0]), one[1]), default=("supervised", True))
    shown = made.shown(10.0)
    assert (shown.level, not shown.is_acknowledged) == gravest
