"""From news to messages: who is told, how loud, for how long it holds; and what is left of it when it is sent."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from service.live.made_news import UNIX_S, hazard, health, letter, moment, news
from service.live.made_sightings import WORKER_M, at, recipients, sighting

from standoff.config import LiveSettings
from standoff.messages import Alert, HazardNews, HealthNews, Topics, read_event
from standoff.service.live.alarms import Alarms
from standoff.service.live.letters import LetterWriter, sent_text
from standoff.service.live.outbox import Letter, News, OpenHazardRow, Shelf
from standoff.service.live.service_clock import Moment

TOPICS = Topics("standoff/yard")
RECEIVERS: dict[str, dict[str, Any]] = {
    "wrist": {"wearer": "worker"},
    "foreman": {"wearer": "nobody", "everything": True},
    "pitman": {"wearer": "nobody", "zones": ("pit",)},
}


def writer(**live: Any) -> LetterWriter:
    """Return one on whose site the wrist's wearer is track 1."""
    settings = LiveSettings.model_validate({"site": "yard", "receivers": RECEIVERS, **live})
    return LetterWriter(
        settings, TOPICS, recipients(RECEIVERS, sighting(), wrist=at(WORKER_M)), Alarms(settings.alerts)
    )


def alerts(letters: list[Letter]) -> dict[str, Alert]:
    found = [one for one in letters if one.topic.endswith("/alert")]
    told = {one.topic: read_event(sent_text(one, moment())[0], Alert)[1] for one in found}
    assert all(topic == TOPICS.device(one.device).alert for topic, one in told.items())
    assert len(told) == len(found)
    return {one.device: one for one in told.values()}


def shelf(**parts: Any) -> Shelf:
    return Shelf(**{"id": "s", "stream": "gate", "zone": "", "hazard_id": "", "author": "anna", "reason": "why",
                    "until_unix_s": UNIX_S + 60.0, **parts})  # fmt: skip


def test_a_hazard_is_told_on_its_streams_topic_and_to_each_who_is_concerned() -> None:
    letters = writer().letters(news(), (), [])
    assert [one.topic for one in letters] == [
        "standoff/yard/stream/gate/hazard",
        "standoff/yard/device/wrist/alert",
        "standoff/yard/device/foreman/alert",
    ]
    assert {device: (one.because, one.silent) for device, one in alerts(letters).items()} == {
        "wrist": ("position", False),
        "foreman": ("everything", False),
    }
    assert len({one.id for one in letters}) == len(letters)
    assert all((one.news_id, one.retained, one.captured_s) == ("n-1", False, 999.8) for one in letters)
    event_id, told, timing = read_event(sent_text(letters[0], moment())[0], HazardNews)
    assert (event_id, told) == (letters[0].id, hazard())
    assert timing is not None


def test_a_hazard_of_a_zone_is_told_on_the_zones_topic_too() -> None:
    letters = writer().letters(news(hazard(zone="pit", rule="zone", track_ids=(9,))), (), [])
    assert [one.topic for one in letters] == [
        "standoff/yard/stream/gate/hazard",
        "standoff/yard/zone/pit/hazard",
        "standoff/yard/device/foreman/alert",
        "standoff/yard/device/pitman/alert",
    ]


def test_the_same_news_make_the_same_letters_however_often_they_are_written() -> None:
    ids = [[one.id for one in writer().letters(news(), (), [])] for _ in range(2)]
    assert ids[0] == ids[1]


def test_without_a_known_delay_nobody_is_alarmed_but_all_can_read_it() -> None:
    letters = writer(notify=[{"apprise": "env:HOME", "severities": ["danger"]}]).letters(
        news(hazard(delay="unknown")), (), []
    )
    assert [one.topic for one in letters] == ["standoff/yard/stream/gate/hazard"]


def test_what_is_set_aside_is_recorded_and_told_to_nobody() -> None:
    made = writer(notify=[{"apprise": "env:HOME"}])
    (letter_of_stream,) = made.letters(news(), (), [shelf()])
    _, told, _ = read_event(sent_text(letter_of_stream, moment())[0], HazardNews)
    assert (letter_of_stream.topic, told.shelved_by) == ("standoff/yard/stream/gate/hazard", "anna")
    assert alerts(made.letters(news(news_id="n-2"), (), [shelf(stream="crane")])).keys() == {"wrist", "foreman"}
    assert alerts(made.letters(news(news_id="n-3"), (), [])).keys() == {"wrist", "foreman"}


@pytest.mark.parametrize("change", [{"delay": "unknown"}, {"session": "s-0"}, {}])
@pytest.mark.parametrize("shelves", [[], [shelf()]])
@pytest.mark.parametrize("phase", ["closed", "unknown"])
def test_the_end_is_told_to_whoever_was_told_the_beginning(
    phase: str, shelves: list[Shelf], change: dict[str, Any]
) -> None:
    ended = hazard(phase=phase, **change)
    told = alerts(writer().letters(news(ended), {"gone", "wrist"}, shelves))
    assert {"gone", "wrist"} <= told.keys()
    assert all(one.silent and one.hazard.phase == phase for one in told.values())


def test_whoever_was_told_hears_how_it_goes_on_wherever_he_is_now() -> None:
    made = writer()
    told = alerts(made.letters(news(hazard(track_ids=(8, 9), phase="updated")), {"wrist"}, []))
    assert {device: one.because for device, one in told.items()} == {"foreman": "everything", "wrist": "stream"}


def test_that_it_is_over_may_be_told_later_than_that_it_begins() -> None:
    made = writer(alerts={"valid_s": 3.0})
    for phase, valid_s in (("opened", 3.0), ("updated", 3.0), ("closed", 60.0), ("unknown", 60.0)):
        letters = made.letters(news(hazard(phase=phase)), {"wrist"}, [])
        assert {one.valid_s for one in letters} == {valid_s}


def test_how_a_stream_is_is_kept_for_who_comes_later() -> None:
    (one,) = writer().letters(news(health("gate", "lost", "no picture comes")), (), [])
    assert (one.topic, one.retained, one.valid_s) == ("standoff/yard/stream/gate/health", True, math.inf)
    _, told, timing = read_event(sent_text(one, moment(86_400.0))[0], HealthNews)
    assert told == health("gate", "lost", "no picture comes")
    assert timing is not None and timing.remaining_ms > 1e11


def test_a_messenger_is_told_each_level_of_a_hazard_once() -> None:
    made = writer(notify=[{"apprise": "env:HOME"}, {"apprise": "env:HOME", "severities": ["warning", "danger"]}])
    life = [("opened", "warning"), ("updated", "warning"), ("updated", "danger"), ("unknown", "danger"),
            ("updated", "danger"), ("closed", "danger")]  # fmt: skip
    found = []
    for number, (phase, severity) in enumerate(life):
        letters = made.letters(news(hazard(phase=phase, severity=severity), f"n-{number}"), (), [])
        found += [(one.topic, one.id) for one in letters if one.topic.startswith("notify:")]
    first, second = [{i for topic, i in found if topic == f"notify:{number}"} for number in (0, 1)]
    assert first == {"h-1/danger/notify-0"}
    assert second == {"h-1/warning/notify-1", "h-1/danger/notify-1"}


@given(st.floats(0.0, 1e4), st.floats(0.0, 5.0), st.none() | st.floats(0.0, 60.0))
def test_what_is_left_is_computed_as_it_is_sent(passed_s: float, delay_s: float, valid_s: float | None) -> None:
    one = letter(body='{"id":"x"}', valid_s=math.inf if valid_s is None else valid_s, captured_s=moment().s - delay_s)
    payload, timing = sent_text(one, moment(passed_s))
    event = json.loads(payload)
    assert (event["id"], event["clock"], event["sentms"]) == ("x", "boot-1", timing.sent_ms)
    assert timing.sent_ms == pytest.approx(moment(passed_s).s * 1e3, abs=0.1)
    assert event["agems"] == pytest.approx((passed_s + delay_s) * 1e3, abs=0.2)
    if valid_s is not None:
        assert event["remainingms"] == pytest.approx((valid_s - passed_s) * 1e3, abs=0.2)


def test_after_the_machine_began_anew_nobody_knows_how_old_a_picture_is() -> None:
    now = Moment("boot-2", 5.0, UNIX_S + 2.0)
    payload, timing = sent_text(letter(valid_s=5.0), now)
    assert (timing.clock, timing.age_ms, json.loads(payload)["agems"]) == ("boot-2", None, None)
    assert timing.remaining_ms == pytest.approx(3000.0)
    assert sent_text(letter(captured_s=None), moment())[1].age_ms is None


def test_an_escalation_sounds_wherever_the_next_in_line_is() -> None:
    made = writer()
    row = OpenHazardRow(hazard(phase="unknown"), moment())
    one = made.escalation(row, 0, "chief", moment(20.0))
    told = alerts([one])["chief"]
    assert (told.because, told.silent, told.hazard) == ("escalation", False, row.latest)
    assert (one.valid_s, one.at) == (5.0, moment(20.0))
    other = made.escalation(row, 1, "chief", moment(40.0))
    assert one.id != other.id and one.id == made.escalation(row, 0, "chief", moment(21.0)).id


@examples(25)
@given(st.lists(st.sampled_from(["opened", "updated", "unknown", "closed"]), min_size=1, max_size=8), st.booleans())
def test_no_two_letters_of_a_life_have_one_id(phases: list[str], has_zone: bool) -> None:
    made, ids = writer(), []
    for number, phase in enumerate(phases):
        told = hazard(phase=phase, zone="pit" if has_zone else "")
        ids += [one.id for one in made.letters(news(told, f"n-{number}", number), {"wrist"}, [])]
    assert len(ids) == len(set(ids))


def test_news_that_are_sent_again_after_a_restart_are_the_same_but_for_what_is_left() -> None:
    one: News = news(replace(hazard(), distance_m=None))
    first, second = writer().letters(one, (), []), writer().letters(one, (), [])
    assert first == second
