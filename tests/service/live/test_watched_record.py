"""The record of a day adds up: what was watched, what was not and why, and what nobody was there to watch."""

from __future__ import annotations

import json
import random
from datetime import UTC, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from mutations import damaged
from service.live.made_news import ClockOfBoth
from service.live.made_sightings import watched

from standoff.config import ShiftSettings
from standoff.core.types import WatchedGround
from standoff.core.watched_ground import BLURRED
from standoff.messages import WatchedZone
from standoff.service.live.watched_record import PICTURE, WatchedRecord, shift_at

BERLIN = ZoneInfo("Europe/Berlin")
DAY = ShiftSettings()
AT = datetime(2026, 3, 2, tzinfo=UTC)
HOUR_S = 3600.0
STEPS = st.lists(
    st.tuples(
        st.sampled_from(["live", "late", "stale", "lost", "frozen"]),
        st.floats(0.01, 8.0),
        st.none() | st.sampled_from([0.0, 0.3, 1.0]),
        st.none() | st.sampled_from([0.0, 0.5, 1.0]),
    ),
    min_size=1,
    max_size=40,
)


def clock_at(begun: datetime = AT, after_s: float = 0.0) -> ClockOfBoth:
    made = ClockOfBoth(begun)
    made.clock.pass_s(after_s)
    return made


def unix_s(*parts: int) -> float:
    year, month, day, hour, minute = (*parts, 0, 0)[:5]
    return datetime(year, month, day, hour, minute, tzinfo=BERLIN).timestamp()


def stream_of(
    until: str = "2026-03-02T00:00:00+00:00", gaps: str = "[]", states_s: str = "{}", places: str = "{}"
) -> bytes:
    """Return the file of a day with one stream."""
    told = f'"until": "{until}", "gaps": {gaps}, "states_s": {states_s}, "places": {places}'
    return f'{{"streams": {{"gate": {{{told}}}}}}}'.encode()


def note(record: WatchedRecord, clock: ClockOfBoth, state: str, passed_s: float, stream: str = "gate") -> None:
    """Say that a stream was in a state for so long, ten times a second or as often as it takes."""
    while passed_s > 1e-9:
        step_s = min(passed_s, 1.0)
        clock.clock.pass_s(step_s)
        passed_s -= step_s
        record.note_state(stream, state, "" if state == "live" else f"it is {state}")


def told(record: WatchedRecord, stream: str = "gate") -> dict[str, Any]:
    words = record.words()
    assert words is not None
    return {"passed_s": words["passed_s"], **words["streams"][stream]}


def sums_of(stream: dict[str, Any]) -> list[float]:
    return [sum(stream["states_s"].values())] + [
        one["watched_s"] + sum(one["unwatched_s"].values()) for one in stream["places"].values()
    ]


def test_time_on_ground_that_is_half_watched_is_half_watched(tmp_path: Path) -> None:
    clock = clock_at()
    record = WatchedRecord(tmp_path, "yard", DAY, clock)
    record.note_state("gate", "connecting", "it begins")
    record.note_ground("gate", watched(right_half=BLURRED), [WatchedZone("pit", 0.25, "blurred")])
    note(record, clock, "live", 60.0)
    note(record, clock, "late", 30.0)
    note(record, clock, "lost", 10.0)
    stream = told(record)
    assert stream["states_s"] == {"live": 60.0, "late": 30.0, "lost": 10.0}
    assert stream["places"][PICTURE] == {
        "watched_share": 0.45, "watched_s": 45.0, "unwatched_s": {"blurred": 45.0, "it is lost": 10.0},
    }  # fmt: skip
    assert stream["places"]["pit"]["watched_s"] == 22.5
    assert (stream["passed_s"], stream["until"]) == (100.0, "2026-03-02T00:01:40+00:00")


@examples(40)
@given(STEPS, st.floats(0.0, 7200.0))
def test_a_record_adds_up_to_what_has_passed_of_the_shift(
    steps: list[tuple[str, float, float | None, float | None]], begun_after_s: float
) -> None:
    with TemporaryDirectory() as folder:
        clock = clock_at(after_s=begun_after_s)
        record = WatchedRecord(Path(folder), "yard", DAY, clock)
        record.note_state("gate", "connecting", "it begins")
        for state, passed_s, share, zone_share in steps:
            zones = [] if zone_share is None else [WatchedZone("pit", zone_share, "blurred")]
            ground = WatchedGround() if share is None else watched(BLURRED if share < 1.0 else 0, BLURRED)
            record.note_ground("gate", ground, zones)
            clock.clock.pass_s(passed_s)
            record.note_state("gate", state, "why" if state != "live" else "")
        stream = told(record)
        passed_s = begun_after_s + sum(step[1] for step in steps)
        assert stream["passed_s"] == pytest.approx(passed_s, abs=0.06)
        for total_s in sums_of(stream):
            assert total_s == pytest.approx(passed_s, abs=1.0)


def test_what_passed_before_anybody_watched_was_not_watched(tmp_path: Path) -> None:
    clock = clock_at(after_s=2 * HOUR_S)
    record = WatchedRecord(tmp_path, "yard", DAY, clock)
    record.note_state("gate", "connecting", "it begins")
    note(record, clock, "live", 60.0)
    stream = told(record)
    assert stream["places"][PICTURE]["unwatched_s"] == {
        "nobody watched it yet": 7200.0,
        "nobody has judged it yet": 60.0,
    }
    assert [one["reasons"] for one in stream["gaps"]] == [["nobody watched it yet"]]


def test_a_restart_counts_as_not_running_until_the_stream_is_looked_at_again(tmp_path: Path) -> None:
    clock = clock_at()
    first = WatchedRecord(tmp_path, "yard", DAY, clock)
    first.note_state("gate", "connecting", "it begins")
    first.note_ground("gate", watched(), [WatchedZone("pit", 1.0, "")])
    note(first, clock, "live", 100.0)
    first.write()
    clock.clock.pass_s(600.0)
    second = WatchedRecord(tmp_path, "yard", DAY, clock)
    clock.clock.pass_s(20.0)  # The detector is loaded.
    second.note_state("gate", "connecting", "it begins")
    second.note_ground("gate", watched(), [WatchedZone("pit", 1.0, "")])
    note(second, clock, "live", 80.0)
    stream = told(second)
    assert stream["states_s"] == {"live": 180.0, "lost": 620.0}
    for place in (PICTURE, "pit"):
        assert stream["places"][place]["watched_s"] == 180.0
        assert stream["places"][place]["unwatched_s"] == {"the service was not running": 620.0}
    assert stream["places"][PICTURE]["watched_share"] == 0.225
    (gap,) = stream["gaps"]
    assert (gap["begin"], gap["end"]) == ("2026-03-02T00:01:40+00:00", "2026-03-02T00:12:00+00:00")


def test_it_is_written_every_few_seconds_and_read_by_whoever_begins_anew(tmp_path: Path) -> None:
    clock = clock_at()
    record = WatchedRecord(tmp_path, "yard", DAY, clock)
    record.note_state("gate", "live", "")
    note(record, clock, "live", 25.0)
    path = tmp_path / "days" / "2026-03-02.json"
    assert 14.0 < json.loads(path.read_text())["streams"]["gate"]["states_s"]["live"] <= 25.0
    killed = WatchedRecord(tmp_path, "yard", DAY, clock)
    assert sum(told(killed)["states_s"].values()) == pytest.approx(25.0, abs=1.0)


def test_whoever_was_held_up_has_not_watched(tmp_path: Path) -> None:
    clock = clock_at()
    record = WatchedRecord(tmp_path, "yard", DAY, clock)
    record.note_state("gate", "live", "")
    record.note_ground("gate", watched(), [])
    clock.clock.pass_s(300.0)
    record.note_state("gate", "live", "")
    stream = told(record)
    assert stream["states_s"] == {"lost": 300.0}
    assert stream["places"][PICTURE]["unwatched_s"] == {"the service was held up": 300.0}


def test_gaps_are_told_and_blips_are_not(tmp_path: Path) -> None:
    clock = clock_at()
    record = WatchedRecord(tmp_path, "yard", DAY, clock)
    record.note_state("gate", "live", "")
    for state, passed_s in (("live", 10.0), ("stale", 0.5), ("live", 10.0), ("stale", 1.0), ("lost", 5.0),
                            ("live", 10.0), ("stale", 0.4), ("live", 9.0), ("frozen", 2.0), ("live", 5.0)):  # fmt: skip
        note(record, clock, state, passed_s)
    gaps = told(record)["gaps"]
    lasted_s = [round(one["end_unix_s"] - one["begin_unix_s"], 1) for one in gaps]
    assert lasted_s == [6.0, 2.0]
    assert [one["reasons"] for one in gaps] == [["it is stale", "it is lost"], ["it is frozen"]]


def test_each_shift_has_a_file_of_its_own(tmp_path: Path) -> None:
    shift = ShiftSettings(begin="22:00", end="06:00", timezone="Europe/Berlin")
    clock = clock_at(datetime(2026, 3, 2, 21, 59, 50, tzinfo=BERLIN))
    record = WatchedRecord(tmp_path, "yard", shift, clock)
    record.note_state("gate", "live", "")
    note(record, clock, "live", 5.0)
    assert record.words() is None
    note(record, clock, "live", 10.0)
    assert told(record)["states_s"] == {"live": 5.0}
    clock.clock.pass_s(8 * HOUR_S - 10.0)
    record.note_state("gate", "live", "")
    note(record, clock, "live", 10.0)
    assert record.words() is None
    written = json.loads((tmp_path / "days" / "2026-03-02.json").read_text())
    assert written["shift"] == {"begin": "22:00", "end": "06:00", "timezone": "Europe/Berlin"}
    assert written["passed_s"] == 8 * HOUR_S
    assert sum(written["streams"]["gate"]["states_s"].values()) == pytest.approx(8 * HOUR_S, abs=2.0)
    assert [path.name for path in (tmp_path / "days").iterdir()] == ["2026-03-02.json"]


@pytest.mark.parametrize(
    ("begin", "end", "moment_s", "day", "lasts_h"),
    [
        ("07:00", "17:00", unix_s(2026, 3, 2, 7), "2026-03-02", 10),
        ("07:00", "17:00", unix_s(2026, 3, 2, 16, 59), "2026-03-02", 10),
        ("07:00", "17:00", unix_s(2026, 3, 2, 17), None, 0),
        ("22:00", "06:00", unix_s(2026, 3, 2, 23), "2026-03-02", 8),
        ("22:00", "06:00", unix_s(2026, 3, 3, 5, 59), "2026-03-02", 8),
        ("22:00", "06:00", unix_s(2026, 3, 3, 6), None, 0),
        ("22:00", "06:00", unix_s(2026, 3, 29, 5), "2026-03-28", 7),
        ("22:00", "06:00", unix_s(2026, 10, 25, 5), "2026-10-24", 9),
        ("00:00", "24:00", unix_s(2026, 3, 29, 12), "2026-03-29", 23),
        ("00:00", "24:00", unix_s(2026, 10, 25, 23, 59), "2026-10-25", 25),
        ("02:30", "06:00", unix_s(2026, 3, 29, 4), "2026-03-29", 2.5),
        ("02:30", "06:00", unix_s(2026, 10, 25, 4), "2026-10-25", 4.5),
        ("18:00", "24:00", unix_s(2026, 12, 31, 23), "2026-12-31", 6),
    ],
)
def test_a_shift_is_of_the_day_on_which_it_begins(
    begin: str, end: str, moment_s: float, day: str | None, lasts_h: float
) -> None:
    span = shift_at(ShiftSettings(begin=begin, end=end, timezone="Europe/Berlin"), moment_s)
    if day is None:
        assert span is None
    else:
        assert span is not None and span.day.isoformat() == day
        assert span.end_unix_s - span.begin_unix_s == lasts_h * HOUR_S


@given(
    st.integers(0, 1439), st.integers(0, 1440), st.integers(0, 366 * 24 * 60), st.sampled_from(["Europe/Berlin", "UTC"])
)
def test_a_moment_is_in_the_shift_that_it_is_in(begin_min: int, end_min: int, minute: int, zone: str) -> None:
    begin, end = (f"{one // 60:02}:{one % 60:02}" for one in (begin_min, end_min))
    if begin != end:
        shift = ShiftSettings(begin=begin, end=end, timezone=zone)
        moment_s = (datetime(2026, 1, 1, tzinfo=UTC) + timedelta(minutes=minute)).timestamp()
        span = shift_at(shift, moment_s)
        clock = datetime.fromtimestamp(moment_s, ZoneInfo(zone)).strftime("%H:%M")
        is_in = begin <= clock < end if begin < end else clock >= begin or clock < end
        is_odd_night = span is not None and (span.end_unix_s - span.begin_unix_s) % 60 == 0 and zone == "Europe/Berlin"
        if zone == "UTC" or not is_odd_night:
            assert (span is not None) == is_in
        if span is not None:
            assert span.begin_unix_s <= moment_s < span.end_unix_s
            assert shift_at(shift, span.begin_unix_s) == shift_at(shift, span.end_unix_s - 1.0) == span


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"{}", b'{"streams": 5}', b'{"streams": {"gate": 5}}', b"\xff", b'{"streams": {"gate": {}}}',
     stream_of(gaps="[1]"), stream_of(gaps="[{}]"), stream_of(until="yesterday"), stream_of(states_s='{"live": NaN}'),
     stream_of(states_s='{"live": 1e999}'), stream_of(places='{"pit": {"watched_s": 1}}')],
)  # fmt: skip
def test_a_file_that_cannot_be_read_is_kept_aside(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "days" / "2026-03-02.json"
    path.parent.mkdir()
    path.write_bytes(content)
    clock = clock_at(after_s=10.0)
    record = WatchedRecord(tmp_path, "yard", DAY, clock)
    record.note_state("gate", "live", "")
    note(record, clock, "live", 15.0)
    assert path.with_suffix(".unreadable").read_bytes() == content
    assert json.loads(path.read_text())["streams"]["gate"]["states_s"]["live"] > 0.0


def test_no_damage_to_the_file_keeps_the_service_from_beginning(tmp_path: Path) -> None:
    clock, rng = clock_at(), random.Random(0)
    made = WatchedRecord(tmp_path, "yard", DAY, clock)
    made.note_state("gate", "live", "")
    made.note_ground("gate", watched(), [WatchedZone("pit", 0.5, "blurred")])
    for state in ("live", "lost", "live"):
        note(made, clock, state, 20.0)
    made.write()
    path = tmp_path / "days" / "2026-03-02.json"
    whole = path.read_bytes()
    for _ in range(150):
        path.write_bytes(damaged(rng, whole, b"null", b"NaN", b"-1e308", b"[]", b"{}", b"0001-01-01T00:00:00"))
        record = WatchedRecord(tmp_path, "yard", DAY, clock)
        record.note_state("gate", "live", "")
        note(record, clock, "lost", 3.0)
        record.write()


def test_where_there_is_no_room_it_goes_on(tmp_path: Path) -> None:
    clock = clock_at()
    record = WatchedRecord(tmp_path, "yard", DAY, clock)
    record.note_state("gate", "live", "")
    (tmp_path / "days").rmdir()
    note(record, clock, "live", 30.0)
    assert told(record)["states_s"] == {"live": 30.0}
