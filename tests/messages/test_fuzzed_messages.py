"""Whatever comes over the broker: it is read, or refused in one short line. Nothing else happens."""

from __future__ import annotations

import json
import os
import random
from typing import Any, Final, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples, seeds
from messages.made_news import DEVICE_KINDS, ONE_OF_EACH, POSITION, TIMING
from messages.test_messages import text_of
from mutations import damaged, mutated

from standoff.messages import EVENT_TYPES, Acknowledgement, DevicePosition, Heartbeat, Unreadable, read_event
from standoff.messages import read_message as read_device
from standoff.service.live.drone_word import read_osd

FUZZED = int(os.environ.get("SOAK_FUZZED", "2500"))
"""`make soak` asks for 100,000."""
VALID = [text_of(one, TIMING).encode() for one in ONE_OF_EACH]
VALID_DEVICE = [
    json.dumps({"sigma_m": POSITION.sigma_m, "x_m": 1.0, "y_m": 2.0, "age_ms": 5}).encode(),
    b'{"sigma_m": 4, "longitude_deg": 8.5, "latitude_deg": 50.1}',
    b'{"hazard_id": "01JHAZARD"}',
    b'{"id": "01JHAZARD/wrist-7", "held_ms": 3.5}',
]
OSD: Final = (
    b'{"data": {"elevation": 30.5, "height": 140.25, "latitude": 50.1, "longitude": 8.5, "attitude_head": 12,'
    b' "52-0-0": {"gimbal_pitch": -60.0, "gimbal_roll": 0.5, "gimbal_yaw": 12.0}}, "timestamp": 1}'
)
TRIPPING: Final = (b"null", b"9" * 400, b"[[[[", b"{}", b'"\\ud800"', b"\\u0000", b"\\n", b"true", b'""')
_NUMBERS = st.integers() | st.floats() | st.sampled_from([10**400, -(10**4000), 1e308, -0.0, 2**53 + 1])
_WORDS = st.text(st.characters(), max_size=12) | st.sampled_from(["\ud800", "a\ud800\n", "NaN", "\0", "x" * 600])
_VALUES = st.recursive(
    st.none() | st.booleans() | _NUMBERS | _WORDS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(_WORDS, inner, max_size=3),
    max_leaves=6,
)


def is_one_short_line(refused: Unreadable) -> bool:
    said = str(refused)
    return said.isprintable() and 0 < len(said) <= 300


def never_fails(payload: bytes) -> None:
    for kind in EVENT_TYPES:
        try:
            event_id, told, _ = read_event(payload, cast("type[object]", kind))
        except Unreadable as refused:
            assert is_one_short_line(refused), refused
        else:
            assert 0 < len(event_id) <= 200 and isinstance(told, kind)
    for device_kind in DEVICE_KINDS:
        try:
            assert isinstance(read_device(payload, device_kind), device_kind)
        except Unreadable as refused:
            assert is_one_short_line(refused), refused
    try:
        assert read_osd(payload)
    except Unreadable as refused:
        assert is_one_short_line(refused), refused


@pytest.mark.parametrize("seed", seeds(10, quick=2))
def test_thousands_of_damaged_messages_are_read_or_refused(seed: int) -> None:
    rng = random.Random(seed)
    for _ in range(FUZZED):
        never_fails(damaged(rng, rng.choice([*VALID, *VALID_DEVICE, OSD]), *TRIPPING))


@examples(100)
@given(st.binary(max_size=80) | st.text(max_size=40).map(str.encode))
def test_noise_is_refused(payload: bytes) -> None:
    never_fails(payload)


@examples(100)
@given(mutated(st.sampled_from([*VALID, *VALID_DEVICE, OSD])))
def test_a_message_that_was_damaged_is_read_or_refused(payload: bytes) -> None:
    never_fails(payload)


@examples(200)
@given(st.sampled_from([*VALID, *VALID_DEVICE, OSD]), st.data())
def test_any_part_may_be_of_any_type(payload: bytes, data: st.DataObject) -> None:
    event: dict[str, Any] = json.loads(payload)
    place = event
    while True:
        name = data.draw(st.sampled_from(sorted(place)))
        inner = place[name]
        if not isinstance(inner, dict) or not inner or data.draw(st.booleans()):
            break
        place = inner
    if data.draw(st.booleans()):
        place[name] = data.draw(_VALUES)
    else:
        place[data.draw(_WORDS)] = place.pop(name)
    text = json.dumps(event) if data.draw(st.booleans()) else json.dumps(event, ensure_ascii=False)
    never_fails(text.encode(data.draw(st.sampled_from(["utf-8", "utf-16", "utf-32"])), "surrogatepass"))


@pytest.mark.parametrize("depth", [10, 200, 300, 900, 1100, 5000, 30_000])
@pytest.mark.parametrize("brackets", [b"[]", b'{"a":}'])
def test_nesting_ends_in_a_refusal_and_not_in_the_process(depth: int, brackets: bytes) -> None:
    opening, closing = brackets[:-1], brackets[-1:]
    whole = opening * depth + b"1" + closing * depth
    for payload in (whole, b'{"hazard_id": "a", "more": ' + whole + b"}", b'{"data": ' + whole + b"}", opening * depth):
        never_fails(payload)


@pytest.mark.parametrize("digits", [20, 310, 4299, 4301, 60_000])
def test_huge_numbers_are_no_numbers(digits: int) -> None:
    number = b"9" * digits
    never_fails(b'{"sigma_m": ' + number + b', "x_m": 0, "y_m": 0}')
    never_fails(b'{"data": {"elevation": ' + number + b"}}")
    for exponent in (b"1e999", b"-1e999", b"NaN", b"Infinity", b"-Infinity"):
        with pytest.raises(Unreadable):
            read_device(b'{"sigma_m": 1, "x_m": ' + exponent + b', "y_m": 0}', DevicePosition)


def test_a_name_with_a_line_end_is_told_in_one_line() -> None:
    event = json.loads(VALID[2])
    event["data"]["unwatched"] = {"two\nlines" + "x" * 5000: "much"}
    with pytest.raises(Unreadable, match="two lines") as refused:
        read_event(json.dumps(event).encode(), Heartbeat)
    assert is_one_short_line(refused.value)


def test_half_a_letter_is_no_text() -> None:
    with pytest.raises(Unreadable):
        read_device(b'{"hazard_id": "\\ud800"}', Acknowledgement)
