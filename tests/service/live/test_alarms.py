"""When a device sounds: for what is new or graver, not for what it told already, and who is next if nobody answers."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from service.live.made_news import UNIX_S, hazard, moment

from standoff.config import AlertSettings
from standoff.core.hazards import GRAVENESS, Severity
from standoff.service.live.alarms import Alarms, shelved_by
from standoff.service.live.outbox import OpenHazardRow, Shelf

SETTINGS = AlertSettings(cooldown_s=5.0, escalate_after_s=15.0, escalate_to=("foreman", "chief"))
PHASES = st.sampled_from(["opened", "updated", "unknown", "closed"])
LIVES = st.lists(
    st.tuples(
        st.sampled_from(["wrist", "foreman"]),
        st.sampled_from(["h-1", "h-2", "h-3"]),
        PHASES,
        st.sampled_from(GRAVENESS),
        st.floats(0.0, 8.0),
    ),
    max_size=30,
)


def shelf(**parts: Any) -> Shelf:
    return Shelf(**{"id": "s", "stream": "", "zone": "", "hazard_id": "", "author": "anna", "reason": "why",
                    "until_unix_s": UNIX_S + 60.0, **parts})  # fmt: skip


def sounds(alarms: Alarms, now_s: float, device: str = "wrist", **changes: Any) -> bool:
    return not alarms.is_silent(device, hazard(**changes), now_s)


def test_it_sounds_once_and_again_when_it_gets_graver() -> None:
    alarms = Alarms(SETTINGS)
    assert sounds(alarms, 0.0, severity="warning")
    assert not sounds(alarms, 1.0, severity="warning", phase="updated")
    assert not sounds(alarms, 100.0, severity="warning", phase="updated")
    assert sounds(alarms, 101.0, severity="danger", phase="updated")
    assert not sounds(alarms, 102.0, severity="warning", phase="updated")
    assert not sounds(alarms, 103.0, severity="danger", phase="updated")


@pytest.mark.parametrize("ending", [{"phase": "closed"}, {"phase": "unknown"}, {"severity": "unknown"}])
def test_an_end_and_what_nobody_knows_is_shown_only(ending: dict[str, Any]) -> None:
    alarms = Alarms(SETTINGS)
    assert not sounds(alarms, 0.0, **ending)
    assert sounds(alarms, 0.1)
    assert not sounds(alarms, 0.2, **ending)
    assert not sounds(alarms, 0.3, phase="updated")


def test_the_like_of_it_sounds_again_only_after_a_while_or_graver() -> None:
    alarms = Alarms(SETTINGS)
    assert sounds(alarms, 0.0, hazard_id="h-1", severity="warning")
    assert not sounds(alarms, 4.9, hazard_id="h-2", severity="warning")
    assert sounds(alarms, 5.1, hazard_id="h-3", severity="warning")
    assert sounds(alarms, 5.2, hazard_id="h-4", severity="danger")


def test_what_was_passed_over_as_the_like_of_another_sounds_if_it_lasts() -> None:
    alarms = Alarms(SETTINGS)
    sounds(alarms, 0.0, hazard_id="h-1")
    assert not sounds(alarms, 1.0, hazard_id="h-2")
    assert sounds(alarms, 6.0, hazard_id="h-2", phase="updated")


@pytest.mark.parametrize(
    "other",
    [
        {"device": "foreman"},
        {"stream": "crane"},
        {"rule": "zone", "zone": "pit"},
        {"classes": ("worker", "dump_truck")},
    ],
)
def test_what_is_not_alike_sounds_at_once(other: dict[str, Any]) -> None:
    alarms = Alarms(SETTINGS)
    assert sounds(alarms, 0.0)
    assert sounds(alarms, 0.1, **{"hazard_id": "h-2", **other})
    assert not sounds(alarms, 0.2, hazard_id="h-3", classes=("excavator", "worker"))


@examples(60)
@given(LIVES)
def test_a_device_never_sounds_twice_for_the_same_and_always_for_the_first_and_the_graver(
    life: list[tuple[str, str, Any, Severity, float]],
) -> None:
    alarms, told, now_s = Alarms(AlertSettings(cooldown_s=0.0)), dict[tuple[str, str], int](), 0.0
    for device, hazard_id, phase, severity, passed_s in life:
        now_s += passed_s
        grave = GRAVENESS.index(severity)
        is_heard = sounds(alarms, now_s, device, hazard_id=hazard_id, phase=phase, severity=severity)
        is_new = grave > told.get((device, hazard_id), 0)
        assert is_heard == (is_new and phase in ("opened", "updated"))
        if is_heard:
            told[device, hazard_id] = grave


def due(passed_s: float, *, acknowledged: bool = False, shelves: tuple[Shelf, ...] = (), **changes: Any) -> list[str]:
    rows = [OpenHazardRow(hazard(**changes), moment(0.0))]
    noted = {"h-1"} if acknowledged else set[str]()
    found = Alarms(SETTINGS).due(rows, noted, shelves, moment(passed_s))
    assert [step for _, step, _ in found] == list(range(len(found)))
    return [device for _, _, device in found]


@pytest.mark.parametrize(
    ("passed_s", "told"),
    [(0.0, []), (14.9, []), (15.1, ["foreman"]), (30.1, ["foreman", "chief"]), (1e6, ["foreman", "chief"]), (-9.0, [])],
)
def test_danger_that_nobody_answers_goes_down_the_line_one_after_another(passed_s: float, told: list[str]) -> None:
    assert due(passed_s) == told


def test_what_somebody_noted_or_set_aside_or_is_no_danger_goes_nowhere() -> None:
    assert due(99.0, acknowledged=True) == []
    assert due(99.0, severity="warning") == due(99.0, severity="unknown") == []
    assert due(99.0, shelves=(shelf(),)) == due(99.0, shelves=(shelf(hazard_id="h-1"),)) == []
    assert due(99.0, shelves=(shelf(stream="crane"),)) == ["foreman", "chief"]
    assert due(99.0, phase="unknown") == ["foreman", "chief"]


def test_danger_in_pictures_of_which_nobody_knows_how_late_they_are_goes_nowhere() -> None:
    assert due(99.0, delay="unknown") == []


def test_nobody_in_line_is_nobody_told() -> None:
    alarms = Alarms(AlertSettings())
    assert alarms.due([OpenHazardRow(hazard(), moment())], set(), (), moment(1e5)) == []


def test_who_has_set_it_aside_is_told() -> None:
    assert shelved_by(hazard(), []) == shelved_by(hazard(), [shelf(zone="pit")]) == ""
    assert shelved_by(hazard(), [shelf(zone="pit"), shelf(author="bert")]) == "bert"
    assert shelved_by(hazard(zone="pit", rule="zone"), [shelf(zone="pit")]) == "anna"


def test_what_was_an_hour_ago_is_forgotten_and_may_sound_again() -> None:
    alarms = Alarms(SETTINGS)
    assert sounds(alarms, 0.0)
    assert sounds(alarms, 3700.0, hazard_id="h-2")
    assert len(alarms._by_hazard) == len(alarms._by_cause) == 1
