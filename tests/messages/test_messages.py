"""What the service says is read as it was meant, and whatever does not say what it should is refused."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from messages.made_news import AT, EVENTS, HAZARD, ONE_OF_EACH, SUPERVISION, TIMING, TIMINGS

from standoff.messages import (
    EVENT_TYPES,
    Acknowledgement,
    DevicePosition,
    Echo,
    HazardNews,
    Supervision,
    Timing,
    Topics,
    Unreadable,
    event_text,
    read_event,
    read_message,
)

IDS = st.text(min_size=1, max_size=200)


def text_of(news: object, timing: Timing | None = TIMING, event_id: str = "e-1") -> str:
    return event_text(news, event_id=event_id, source="standoff/yard", subject="x", at=AT, timing=timing)


def changed(news: object, **changes: Any) -> bytes:
    event = json.loads(text_of(news))
    return json.dumps({**event, "data": {**event["data"], **changes}}).encode()


@given(EVENTS, IDS, st.none() | TIMINGS)
def test_every_event_is_read_as_it_was_written(news: object, event_id: str, timing: Timing | None) -> None:
    payload = text_of(news, timing, event_id).encode()
    if len(payload) <= 65_536:
        assert read_event(payload, type(news)) == (event_id, news, timing)


@pytest.mark.parametrize("news", ONE_OF_EACH, ids=lambda one: type(one).__name__)
def test_an_event_has_all_that_cloudevents_ask_for(news: object) -> None:
    event = json.loads(text_of(news))
    kind = EVENT_TYPES[type(news)]
    assert (event["specversion"], event["id"], event["source"], event["type"]) == ("1.0", "e-1", "standoff/yard", kind)
    assert datetime.fromisoformat(event["time"]) == AT
    assert event["datacontenttype"] == "application/json"
    extensions = event.keys() - {"specversion", "id", "source", "type", "subject", "time", "data"}
    assert all(name.isalnum() and name == name.lower() for name in extensions)
    assert (event["clock"], event["sentms"], event["remainingms"], event["agems"]) == ("boot-1", 12600.0, 4900.0, 150.0)


@pytest.mark.parametrize("news", ONE_OF_EACH, ids=lambda one: type(one).__name__)
def test_an_event_of_one_kind_is_none_of_another(news: object) -> None:
    for kind in EVENT_TYPES:
        if kind is not type(news):
            with pytest.raises(Unreadable, match=EVENT_TYPES[kind]):
                read_event(text_of(news).encode(), kind)


def test_numbers_that_are_none_are_said_as_null() -> None:
    text = text_of(replace(HAZARD, distance_m=math.nan, gap_m=-math.inf))
    _, told, _ = read_event(text.encode(), HazardNews)
    assert (told.distance_m, told.gap_m) == (None, None)


def test_the_same_moment_is_read_whatever_the_time_zone() -> None:
    there = AT.astimezone(timezone(timedelta(hours=5, minutes=30)))
    _, told, _ = read_event(text_of(replace(HAZARD, captured_at=there)).encode(), HazardNews)
    assert told.captured_at == AT


def test_what_is_new_in_a_later_version_is_passed_over() -> None:
    event = json.loads(changed(SUPERVISION, mood="good"))
    _, told, timing = read_event(json.dumps({**event, "traceparent": "00-1"}).encode(), Supervision)
    assert (told, timing) == (SUPERVISION, TIMING)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"supervised": 1}, "supervised: Input should be a valid boolean"),
        ({"supervised": "true"}, "supervised"),
        ({"sequence": -1}, "sequence: Input should be greater than or equal to 0"),
        ({"sequence": 1.5}, "sequence"),
        ({"sequence": True}, "sequence"),
        ({"device": "x" * 65}, "device"),
        ({"reason": "x" * 501}, "reason"),
        ({"streams": "gate"}, "streams"),
        ({"streams": ["gate", 1]}, "streams.1"),
        ({"device": None}, "device"),
    ],
)
def test_a_word_that_is_not_as_it_should_be_is_named(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(Unreadable, match=told):
        read_event(changed(SUPERVISION, **changes), Supervision)


@pytest.mark.parametrize("event_id", [None, "", 5, "x" * 201, ["a"]])
def test_an_event_without_an_id_is_refused(event_id: object) -> None:
    event = {**json.loads(text_of(SUPERVISION)), "id": event_id}
    with pytest.raises(Unreadable, match="an id"):
        read_event(json.dumps(event).encode(), Supervision)


def test_a_clock_without_its_time_is_refused() -> None:
    event = json.loads(text_of(SUPERVISION))
    del event["sentms"]
    with pytest.raises(Unreadable, match="sent_ms"):
        read_event(json.dumps(event).encode(), Supervision)


@pytest.mark.parametrize("name", ["sentms", "remainingms", "agems"])
@pytest.mark.parametrize("number", ["1e999", "-1e999", "NaN", "Infinity", "true", '"5"'])
def test_nothing_is_sent_at_no_time_or_holds_for_ever(name: str, number: str) -> None:
    event = json.loads(text_of(SUPERVISION))
    payload = json.dumps({**event, name: "HERE"}).replace('"HERE"', number)
    with pytest.raises(Unreadable):
        read_event(payload.encode(), Supervision)


@pytest.mark.parametrize("told", [{"x_m": 1.0, "y_m": 2.0}, {"longitude_deg": 8.5, "latitude_deg": 50.1}])
def test_a_device_says_where_it_is_in_one_of_two_ways(told: dict[str, float]) -> None:
    position = read_message(json.dumps({"sigma_m": 0.5, "age_ms": 20, **told}).encode(), DevicePosition)
    assert position == DevicePosition(0.5, age_ms=20.0, **told)
    assert position.in_site_frame == ("x_m" in told)


@pytest.mark.parametrize(
    "told",
    [
        {},
        {"x_m": 1.0},
        {"longitude_deg": 8.5},
        {"x_m": 1.0, "latitude_deg": 50.1},
        {"x_m": 1.0, "y_m": 2.0, "longitude_deg": 8.5},
        {"x_m": 1.0, "y_m": 2.0, "longitude_deg": 8.5, "latitude_deg": 50.1},
        {"longitude_deg": 181.0, "latitude_deg": 0.0},
        {"longitude_deg": 0.0, "latitude_deg": -90.1},
        {"x_m": 1e8, "y_m": 0.0},
        {"x_m": "1", "y_m": 0.0},
        {"x_m": 1.0, "y_m": 2.0, "age_ms": -1.0},
        {"x_m": 1.0, "y_m": 2.0, "sigma_m": 0.0},
        {"x_m": 1.0, "y_m": 2.0, "sigma_m": 1001.0},
    ],
)
def test_a_place_that_is_half_or_nowhere_is_refused(told: dict[str, Any]) -> None:
    with pytest.raises(Unreadable):
        read_message(json.dumps({"sigma_m": 0.5, **told}).encode(), DevicePosition)


def test_what_devices_answer_is_read() -> None:
    assert read_message(b'{"hazard_id": "01J"}', Acknowledgement).hazard_id == "01J"
    assert read_message(b'{"id": "e", "held_ms": 12}', Echo) == Echo("e", 12.0)
    for wrong in (b'{"hazard_id": ""}', b'{"hazard_id": "%s"}' % (b"x" * 65), b"{}"):
        with pytest.raises(Unreadable):
            read_message(wrong, Acknowledgement)


def test_a_message_that_is_too_long_is_not_even_looked_at() -> None:
    room = b" " * 65_536
    assert read_message((b'{"hazard_id": "01J"}' + room)[:65_536], Acknowledgement).hazard_id == "01J"
    with pytest.raises(Unreadable, match="at most 65536 bytes, found 65556"):
        read_message(b'{"hazard_id": "01J"}' + room, Acknowledgement)


@given(st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_-]{0,20}", fullmatch=True))
def test_the_topic_of_a_device_tells_which_device_it_is(device: str) -> None:
    topics = Topics.of("a/{site}/b", "yard")
    of_it = topics.device(device)
    parts = (of_it.alert, of_it.supervision, of_it.position, of_it.acknowledgement, of_it.echo)
    names = ("alert", "supervision", "position", "ack", "echo")
    assert [topics.device_of(one) for one in parts] == [(device, name) for name in names]
    assert len(set(parts)) == len(parts)


@pytest.mark.parametrize(
    "topic",
    [
        "standoff/yard/device/wrist",
        "standoff/yard/device//ack",
        "standoff/yard/device/wrist/a/b",
        "standoff/other/device/wrist/ack",
        "x/standoff/yard/device/wrist/ack",
        "device/wrist/ack",
        "wrist/ack",
        "",
    ],
)
def test_another_topic_is_of_no_device(topic: str) -> None:
    assert Topics("standoff/yard").device_of(topic) is None


@given(st.text(min_size=1, max_size=60))
def test_no_zone_can_be_named_so_that_its_topic_is_another_or_a_pattern(zone: str) -> None:
    topic = Topics("standoff/yard").zone(zone)
    assert topic.startswith("standoff/yard/zone/") and topic.endswith("/hazard")
    assert topic.count("/") == 4 and not set("+#") & set(topic)
