"""What is to be told is on disk before anybody sends it, is told once, and dies when it is true no more."""

from __future__ import annotations

import math
import shutil
import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from service.live.made_news import UNIX_S, hazard, health, letter, moment

from standoff.core.errors import OutputError
from standoff.messages import HazardNews, HealthNews
from standoff.service.live.outbox import Letter, Outbox, Shelf
from standoff.service.live.service_clock import Moment

SECONDS = st.floats(-1e6, 1e6)


@pytest.fixture
def outbox(tmp_path: Path) -> Iterator[Outbox]:
    made = Outbox(tmp_path)
    yield made
    made.close()


def shelf(shelf_id: str = "s-1", until_s: float = 60.0, **parts: Any) -> Shelf:
    told: dict[str, Any] = {
        "stream": "gate",
        "zone": "",
        "hazard_id": "",
        "author": "anna",
        "reason": "crane is away",
        **parts,
    }
    return Shelf(shelf_id, **told, until_unix_s=UNIX_S + until_s)


def test_news_are_on_disk_before_anybody_hears_of_them(outbox: Outbox, tmp_path: Path) -> None:
    told: list[HazardNews | HealthNews] = [
        hazard("h-1"),
        hazard("h-2", distance_m=None, captured_at=None),
        health("crane", "lost", "no picture comes"),
    ]
    ids = outbox.tell(told, moment(1.0), captured_s=1000.5)
    other = Outbox(tmp_path)
    found = other.unrouted()
    other.close()
    assert tuple(one.id for one in found) == ids and len(set(ids)) == 3
    assert [one.told for one in found] == told
    assert {(one.captured_s, one.at) for one in found} == {(1000.5, moment(1.0))}


def test_news_are_routed_once_with_all_their_letters_in_order(outbox: Outbox) -> None:
    first, second = outbox.tell([hazard("h-1"), hazard("h-2")], moment())
    letters = [letter(f"{second}/b", topic="b"), letter(f"{second}/a", topic="a", captured_s=None)]
    outbox.route(second, letters)
    assert [one.id for one in outbox.unrouted()] == [first]
    outbox.route(first, [letter(f"{first}/c", valid_s=math.inf)])
    assert outbox.unrouted() == []
    assert outbox.waiting() == [*letters, letter(f"{first}/c", valid_s=math.inf)]
    assert outbox.waiting(most=1) == letters[:1]


def test_whoever_routes_again_after_a_crash_sends_nothing_twice(outbox: Outbox) -> None:
    (news_id,) = outbox.tell([hazard()], moment())
    outbox.route(news_id, [letter(f"{news_id}/a", body="first")])
    outbox.route(news_id, [letter(f"{news_id}/a", body="second")])
    assert [one.body for one in outbox.waiting()] == ["first"]
    outbox.delivered([f"{news_id}/a"], moment(1.0))
    outbox.route(news_id, [letter(f"{news_id}/a", body="third")])
    assert outbox.waiting() == [] and outbox.counts() == {"delivered": 1}


def test_a_letter_ends_once(outbox: Outbox) -> None:
    outbox.route("n", [letter("n/a"), letter("n/b"), letter("n/c")])
    outbox.delivered(["n/a", "nobody's"], moment(1.0))
    outbox.expired(["n/a", "n/b"], moment(2.0))
    outbox.delivered(["n/b"], moment(3.0))
    outbox.expired([], moment(4.0))
    assert [one.id for one in outbox.waiting()] == ["n/c"]
    assert outbox.counts() == {"delivered": 1, "expired": 1, "waiting": 1}


def test_what_is_retained_takes_the_place_of_what_still_waits_on_its_topic(outbox: Outbox) -> None:
    state = {"retained": True, "valid_s": math.inf, "topic": "gate/health"}
    outbox.route("n1", [letter("n1/h", **state)])
    outbox.route("n2", [letter("n2/h", **{**state, "topic": "crane/health"}), letter("n2/a", topic="gate/health")])
    outbox.route("n3", [letter("n3/h", **state)])
    assert [one.id for one in outbox.waiting()] == ["n2/h", "n2/a", "n3/h"]
    outbox.delivered(["n3/h"], moment(1.0))
    outbox.route("n4", [letter("n4/h", **state)])
    assert outbox.counts() == {"waiting": 3, "superseded": 1, "delivered": 1}


def test_what_is_retained_and_routed_again_is_neither_lost_nor_does_it_end_what_is_newer(outbox: Outbox) -> None:
    state = {"retained": True, "valid_s": math.inf, "topic": "gate/health"}
    outbox.route("n1", [letter("n1/h", **state)])
    outbox.route("n1", [letter("n1/h", **state)])
    assert [one.id for one in outbox.waiting()] == ["n1/h"]
    outbox.route("n2", [letter("n2/h", **state)])
    outbox.route("n1", [letter("n1/h", **state)])
    assert [one.id for one in outbox.waiting()] == ["n2/h"]


@given(SECONDS, st.floats(0.0, 1e6), st.floats(0.0, 1e6), SECONDS)
def test_what_remains_is_told_by_the_clock_that_nobody_sets(
    written_s: float, passed_s: float, valid_s: float, set_by_s: float
) -> None:
    written = Moment("boot-1", written_s, UNIX_S)
    now = Moment("boot-1", written_s + passed_s, UNIX_S + set_by_s)
    assert letter(at=written, valid_s=valid_s).remaining_s(now) == pytest.approx(valid_s - passed_s, abs=1e-3)


@given(SECONDS, st.floats(0.0, 1e6), st.floats(0.0, 1e6))
def test_after_the_machine_began_anew_the_wall_clock_tells(other_s: float, passed_s: float, valid_s: float) -> None:
    now = Moment("boot-2", other_s, UNIX_S + passed_s)
    assert letter(at=moment(), valid_s=valid_s).remaining_s(now) == pytest.approx(valid_s - passed_s, abs=1e-3)


@given(st.floats(1e-3, 1e6), st.floats(0.0, 1e9) | st.just(math.inf))
def test_what_was_written_later_than_now_is_old(set_back_s: float, valid_s: float) -> None:
    now = Moment("boot-2", 5.0, UNIX_S - set_back_s)
    assert letter(at=moment(), valid_s=valid_s).remaining_s(now) < 0.0


def test_a_hazard_is_open_from_its_first_event_to_its_last(outbox: Outbox) -> None:
    outbox.tell([hazard("h-1", severity="warning")], moment(0.0))
    outbox.tell([hazard("h-2", stream="crane")], moment(1.0))
    outbox.tell([hazard("h-1", phase="updated", severity="danger")], moment(2.0))
    outbox.tell([hazard("h-1", phase="unknown", severity="danger", reason="no picture comes")], moment(3.0))
    first, second = outbox.open_hazards()
    assert (first.latest.phase, first.latest.severity, first.opened) == ("unknown", "danger", moment(0.0))
    assert (second.latest.hazard_id, second.opened) == ("h-2", moment(1.0))
    assert [one.latest.hazard_id for one in outbox.open_hazards("crane")] == ["h-2"]
    outbox.tell([hazard("h-1", phase="closed"), hazard("h-3", phase="closed")], moment(4.0))
    assert [one.latest.hazard_id for one in outbox.open_hazards()] == ["h-2"]
    assert len(outbox.unrouted()) == 6


def test_in_silence_what_is_open_becomes_unknown_once(outbox: Outbox) -> None:
    outbox.tell([hazard("h-1"), hazard("h-2", phase="unknown", severity="unknown", gap_m=None)], moment())
    outbox.tell([hazard("h-3", stream="crane")], moment())
    for s in (1.0, 2.0):
        outbox.leave_unknown("gate", "the analysis began anew", moment(s))
    told = [one.told for one in outbox.unrouted()][3:]
    lost: dict[str, Any] = {"phase": "unknown", "reason": "the analysis began anew", "distance_m": None, "gap_m": None}
    assert told == [replace(hazard("h-1"), **lost, sigma_m=None, breach_now=None, breach_ahead=None)]
    assert len(outbox.open_hazards()) == 3


def test_what_an_earlier_session_left_open_is_closed(outbox: Outbox) -> None:
    outbox.tell([hazard("h-1", session="s-0", phase="unknown"), hazard("h-2"), hazard("h-3", stream="crane")], moment())
    outbox.close_left("gate", "s-1", "its tracks were lost", moment(9.0))
    assert [one.latest.hazard_id for one in outbox.open_hazards()] == ["h-2", "h-3"]
    closed = outbox.unrouted()[-1].told
    assert closed == hazard("h-1", session="s-0", phase="closed", reason="its tracks were lost")
    outbox.close_left("gate", "s-1", "its tracks were lost", moment(10.0))
    assert len(outbox.unrouted()) == 4


@pytest.mark.parametrize("reason", ["x" * 5000, "half a letter: \ud800", "two\nlines", "\0", "ü" * 501, "🚧" * 501])
def test_no_reason_makes_what_was_written_unreadable(outbox: Outbox, reason: str) -> None:
    outbox.tell([hazard("h-1"), hazard("h-2", session="s-0")], moment())
    outbox.leave_unknown("gate", reason, moment(1.0))
    outbox.close_left("gate", "s-1", reason, moment(2.0))
    outbox.tell([hazard("h-3", reason=reason), health("gate", "lost", reason)], moment(3.0))
    assert len(outbox.unrouted()) == 7
    assert [one.latest.hazard_id for one in outbox.open_hazards()] == ["h-1", "h-3"]
    assert all(one.told.reason[:4] == reason[:4] for one in outbox.unrouted()[-2:])


def test_who_was_told_of_what_is_open_is_known_after_a_restart(outbox: Outbox, tmp_path: Path) -> None:
    one, two, three = outbox.tell([hazard("h-1"), hazard("h-2"), hazard("h-3")], moment())
    outbox.route(one, [letter("a", news_id=one, topic="y/device/wrist/alert"), letter("b", news_id=one, topic="y/z")])
    outbox.route(two, [letter("c", news_id=two, topic="y/device/foreman/alert")])
    outbox.route(three, [letter("d", news_id=three, topic="y/zone/pit/hazard")])
    outbox.delivered(["a", "c"], moment(1.0))
    outbox.tell([hazard("h-2", phase="closed")], moment(2.0))
    again = Outbox(tmp_path)
    assert again.devices_told("y/device/") == {"h-1": {"y/device/wrist/alert"}}
    again.close()


def test_whoever_takes_note_twice_has_taken_note(outbox: Outbox) -> None:
    assert outbox.acknowledged() == frozenset()
    for device, hazard_id in (("wrist", "h-1"), ("wrist", "h-1"), ("foreman", "h-1"), ("foreman", "h-2")):
        outbox.acknowledge(hazard_id, device, moment())
    assert outbox.acknowledged() == {"h-1", "h-2"}


def test_what_is_set_aside_is_so_for_a_while_or_until_it_is_taken_back(outbox: Outbox) -> None:
    outbox.shelve(shelf("s-1", 60.0))
    outbox.shelve(shelf("s-2", 30.0, zone="pit"))
    assert [one.id for one in outbox.shelves(moment(29.0))] == ["s-2", "s-1"]
    assert outbox.shelves(moment(31.0)) == [shelf("s-1", 60.0)]
    assert outbox.shelves(moment(60.0)) == []
    assert (outbox.unshelve("s-1"), outbox.unshelve("s-1"), outbox.unshelve("nobody's")) == (True, False, False)
    assert [one.id for one in outbox.shelves(moment(1.0))] == ["s-2"]


@pytest.mark.parametrize(
    ("parts", "holds"),
    [
        ({}, True),
        ({"stream": "crane"}, False),
        ({"stream": ""}, True),
        ({"zone": "pit"}, False),
        ({"hazard_id": "h-1"}, True),
        ({"hazard_id": "h-2"}, False),
    ],
)
def test_what_is_set_aside_is_what_all_its_parts_name(parts: dict[str, Any], holds: bool) -> None:
    assert shelf(**parts).holds(hazard("h-1")) == holds
    assert shelf(zone="pit").holds(hazard("h-1", zone="pit", rule="zone"))


def test_after_a_month_what_has_ended_is_forgotten_and_nothing_else(outbox: Outbox) -> None:
    month_s = 31 * 86_400.0
    (news_id, left) = outbox.tell([hazard("h-1"), hazard("h-2")], moment())
    outbox.route(news_id, [letter(f"{news_id}/a"), letter(f"{news_id}/b")])
    outbox.delivered([f"{news_id}/a"], moment(1.0))
    outbox.acknowledge("h-1", "wrist", moment())
    outbox.shelve(shelf())
    outbox.prune(moment(month_s - 2 * 86_400.0))
    assert outbox.counts() == {"delivered": 1, "waiting": 1} and outbox.acknowledged()
    outbox.prune(moment(month_s))
    assert outbox.counts() == {"waiting": 1} and not outbox.acknowledged() and not outbox.shelves(moment())
    assert [one.id for one in outbox.unrouted()] == [left] and len(outbox.open_hazards()) == 2


def test_two_processes_use_it_at_once(tmp_path: Path) -> None:
    analysis, messenger = Outbox(tmp_path), Outbox(tmp_path)
    for number in range(20):
        (news_id,) = analysis.tell([hazard(f"h-{number}")], moment(number))
        messenger.route(news_id, [letter(f"{news_id}/a")])
        messenger.acknowledge(f"h-{number}", "wrist", moment(number))
        analysis.tell([hazard(f"h-{number}", phase="closed")], moment(number + 0.5))
        messenger.delivered([f"{news_id}/a"], moment(number))
    assert messenger.counts() == {"delivered": 20}
    assert analysis.open_hazards() == messenger.open_hazards() == []
    assert len(messenger.unrouted()) == 20


def test_whoever_is_killed_while_writing_has_written_nothing_or_all(tmp_path: Path) -> None:
    (tmp_path / "state").mkdir()
    outbox = Outbox(tmp_path / "state")
    (news_id,) = outbox.tell([hazard()], moment())

    def letters() -> Iterator[Letter]:
        yield letter(f"{news_id}/a", topic="health", retained=True)
        shutil.copytree(tmp_path / "state", tmp_path / "killed")
        yield letter(f"{news_id}/b")

    outbox.route(news_id, letters())
    shutil.copytree(tmp_path / "state", tmp_path / "after")
    outbox.close()
    for folder, waiting, unrouted in (("killed", 0, 1), ("after", 2, 0)):
        left = Outbox(tmp_path / folder)
        assert (len(left.waiting()), len(left.unrouted()), len(left.open_hazards())) == (waiting, unrouted, 1)
        left.close()


def test_a_letter_that_cannot_be_written_leaves_none_of_its_news(outbox: Outbox) -> None:
    (news_id,) = outbox.tell([hazard()], moment())

    def letters() -> Iterator[Letter]:
        yield letter(f"{news_id}/a")
        raise RuntimeError("a bug of ours")

    with pytest.raises(RuntimeError):
        outbox.route(news_id, letters())
    assert outbox.waiting() == [] and [one.id for one in outbox.unrouted()] == [news_id]
    outbox.route(news_id, [letter(f"{news_id}/a")])
    assert len(outbox.waiting()) == 1


def test_a_file_that_is_no_database_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "outbox.sqlite").write_bytes(b"no database" * 100)
    with pytest.raises(OutputError, match="move the file away if it is damaged") as raised:
        Outbox(tmp_path)
    assert "\n" not in str(raised.value)
    with pytest.raises(OutputError, match="a database that can be written"):
        Outbox(tmp_path / "nowhere")


def test_each_commit_is_on_disk_before_anybody_goes_on(tmp_path: Path) -> None:
    outbox = Outbox(tmp_path)
    assert outbox._db.execute("PRAGMA synchronous").fetchone() == (2,)
    assert outbox._db.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    outbox.close()
    with pytest.raises(sqlite3.ProgrammingError):
        outbox.counts()
