from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from stages.hazard.frames_of_gaps import (
    CALM,
    CUT_OFF,
    FOLLOWED,
    GROUND,
    NAN,
    NO_GROUND,
    STEP_S,
    Gaps,
    events_of,
    events_of_likely,
    frame,
    pair_events,
    told,
)

from standoff.core.types import GroundPositions, Hazard, NoGroundMap, Proximities
from standoff.stages.hazard import HazardMonitor, HazardParams


def test_a_breach_is_opened_as_danger_once_it_has_lasted_and_closed_once_it_is_over() -> None:
    events = pair_events([10.0, *[-1.0] * 4, *[10.0] * 6])
    assert told(events) == [("opened", "danger", 0.375), ("closed", "danger", 1.125)]
    assert {event.rule for event in events} == {"proximity"}
    assert {event.track_ids for event in events} == {(1, 2)}
    assert (events[0].gap_m, events[0].distance_m, events[0].sigma_m) == (-1.0, 6.8, 0.1)
    assert events[-1].reason == "clear for 0.5 s"


def test_within_the_buffer_it_is_a_warning_that_can_become_danger_and_back() -> None:
    events = pair_events([*[0.5] * 4, *[-0.5] * 4, *[0.8] * 8, *[1.2] * 8, *[1.6] * 5])
    assert told(events) == [
        ("opened", "warning", 0.25),
        ("updated", "danger", 0.75),
        ("updated", "warning", 1.5),
        ("closed", "warning", 3.5),
    ]


def test_a_single_bad_frame_is_no_alarm_unless_asked_for() -> None:
    blip = [10.0, -5.0, 10.0, 10.0]
    assert pair_events(blip) == []
    assert pair_events(blip, HazardParams(min_duration_s=0.0))[0].severity == "danger"


@pytest.mark.parametrize(
    ("breaches", "opened_s"),
    [
        ([0.96, 0.96, 0.96], 0.0),  # who is first seen in the middle of a circle
        ([NAN, NAN, 0.96, 0.96], 0.25),
        ([0.94, 0.94, 0.94, 0.94], 0.25),  # perhaps a worker beside it
        ([0.01, 0.96, 0.96, 0.96], 0.375),  # has been clear: that he is inside may be one bad frame
        ([0.01, NAN, 0.96, 0.96, 0.96], 0.5),
    ],
)
def test_who_is_in_danger_beyond_doubt_when_first_measured_is_warned_of_at_once(
    breaches: list[float], opened_s: float
) -> None:
    events = events_of_likely(breaches, replace(CALM, rule="probability"))
    assert told(events) == [("opened", "danger", opened_s)]


def test_a_pair_that_comes_back_is_not_measured_for_the_first_time() -> None:
    monitor = HazardMonitor()
    events: list[Hazard] = []
    for index in range(20):
        likely = 0.01 if index < 8 else 0.97
        positions, pairs = frame({} if 8 <= index < 12 else {(1, 2): 0.0})
        known = replace(pairs, breach_now=np.full(len(pairs), likely), breach_ahead=np.full(len(pairs), likely))
        events += monitor.update(STEP_S * index, positions, known, GROUND, FOLLOWED)
    assert told(events)[0] == ("opened", "danger", 1.75)


def test_a_setting_that_would_switch_the_alarm_off_is_refused() -> None:
    with pytest.raises(ValueError, match="buffer_m must be a number from 0, not nan"):
        HazardParams(buffer_m=NAN)
    with pytest.raises(ValueError, match="release_s must be a number from 0, not -1"):
        HazardParams(release_s=-1.0)


def test_noise_around_the_limit_does_not_flicker() -> None:
    rng = np.random.default_rng(4)
    events = pair_events(1.0 + rng.uniform(-0.4, 0.4, 400))
    assert [event.phase for event in events] == ["opened"]


def test_caution_takes_the_gap_smaller_by_sigmas() -> None:
    params = HazardParams(rule="distance", caution_sigmas=2.0)
    for sigma_m, expected in ((0.1, 0), (1.0, 1)):
        monitor = HazardMonitor(params)
        events = [
            e for i in range(5) for e in monitor.update(STEP_S * i, *frame({(1, 2): 2.0}, sigma_m), GROUND, FOLLOWED)
        ]
        assert len(events) == expected


def test_a_cautious_monitor_cannot_measure_without_a_sigma() -> None:
    monitor = HazardMonitor(HazardParams(rule="distance", caution_sigmas=2.0))
    events = [e for i in range(12) for e in monitor.update(STEP_S * i, *frame({(1, 2): 9.0}, NAN), GROUND, FOLLOWED)]
    assert [(event.phase, event.severity, event.reason) for event in events] == [("opened", "unknown", "not measured")]


def test_a_lasting_hazard_is_reported_again_at_most_so_often() -> None:
    events = pair_events([-1.0] * 33, HazardParams(min_duration_s=0.0, update_every_s=1.0))
    assert told(events) == [
        ("opened", "danger", 0.0),
        *[("updated", "danger", time_s) for time_s in (1.0, 2.0, 3.0, 4.0)],
    ]


def test_an_open_hazard_that_cannot_be_measured_is_unknown_until_it_can() -> None:
    events = pair_events([*[-1.0] * 4, *[NAN] * 20, *[-1.0] * 4])
    assert told(events) == [
        ("opened", "danger", 0.25),
        ("unknown", "danger", 0.75),
        ("updated", "danger", 3.0),
    ]
    assert len({event.hazard_id for event in events}) == 1
    assert events[1].reason == CUT_OFF
    assert math.isnan(events[1].distance_m) and math.isnan(events[1].gap_m) and math.isnan(events[1].sigma_m)
    assert events[2].reason == ""


def test_not_being_measured_never_counts_towards_the_end_of_a_hazard() -> None:
    events = pair_events([*[-1.0] * 4, 10.0, *[NAN] * 40, 10.0, NAN, 10.0])
    assert "closed" not in {event.phase for event in events}


def test_a_breach_that_is_lost_from_sight_before_it_was_said_is_said_as_unknown() -> None:
    events = pair_events([-1.0, *[NAN] * 4])
    assert told(events) == [("opened", "unknown", 0.375)]


def test_a_visible_pair_that_stays_unmeasured_opens_an_unknown_hazard() -> None:
    events = pair_events([*[20.0] * 2, *[NAN] * 20, *[20.0] * 10])
    assert told(events) == [("opened", "unknown", 1.25), ("closed", "unknown", 3.25)]
    assert [event.reason for event in events] == [CUT_OFF, "clear for 0.5 s"]
    assert math.isnan(events[0].gap_m)


def test_short_gaps_in_the_measurements_of_a_clear_pair_do_not_add_up() -> None:
    assert pair_events([*[NAN] * 7, 20.0] * 5) == []


@pytest.mark.parametrize(
    ("gap_m", "severities"), [(-1.0, ["warning", "danger"]), (0.5, ["warning"]), (1.2, ["warning"])]
)
def test_an_unknown_hazard_takes_its_level_as_soon_as_it_is_measured_near(gap_m: float, severities: list[str]) -> None:
    events = pair_events([*[NAN] * 10, *[gap_m] * 6])
    assert (events[0].phase, events[0].severity) == ("opened", "unknown")
    assert [(event.phase, event.severity) for event in events[1:]] == [("updated", level) for level in severities]
    assert events[1].time_s == 1.25


def test_a_track_that_is_lost_leaves_its_hazard_unknown_for_a_while() -> None:
    events = events_of([*[{(1, 2): -1.0}] * 4, *[{}] * 40])
    assert told(events) == [
        ("opened", "danger", 0.25),
        ("unknown", "danger", 0.5),
        ("closed", "danger", 3.5),
    ]
    assert [event.reason for event in events] == ["", "track lost", "track lost for 3 s"]


def test_a_track_that_comes_back_in_time_keeps_its_hazard() -> None:
    events = events_of([*[{(1, 2): -1.0}] * 4, *[{}] * 8, *[{(1, 2): -1.0}] * 3])
    assert [event.phase for event in events] == ["opened", "unknown", "updated"]
    assert len({event.hazard_id for event in events}) == 1


def test_a_pair_that_is_no_longer_watched_says_so() -> None:
    other: Gaps = {(1, 3): 30.0, (2, 3): 30.0}
    events = events_of([*[{(1, 2): -1.0, **other}] * 4, *[other] * 2])
    assert events[-1].reason == "pair not watched any more"


def test_a_lost_pair_without_a_hazard_is_forgotten_silently() -> None:
    assert events_of([*[{(1, 2): 20.0}] * 4, *[{}] * 40]) == []


def test_a_stream_that_starts_without_a_map_says_so_at_once() -> None:
    events = events_of([NO_GROUND] * 30)
    assert told(events) == [("opened", "unknown", 0.0)]
    assert (events[0].rule, events[0].track_ids, events[0].reason) == ("measurement", (), "reference not found")


def test_a_map_that_is_lost_is_one_hazard_for_the_stream_and_unknown_for_open_pairs() -> None:
    breach: Gaps = {(1, 2): -1.0}
    events = events_of([*[breach] * 8, *[NO_GROUND] * 20, *[breach] * 8])
    assert [(event.rule, event.phase, event.time_s) for event in events] == [
        ("proximity", "opened", 0.25),
        ("measurement", "opened", 1.25),
        ("proximity", "unknown", 1.25),
        ("proximity", "updated", 3.5),
        ("measurement", "closed", 4.0),
    ]
    assert events[-1].reason == "ground map is back"


def test_a_lost_map_opens_nothing_for_pairs_that_were_clear() -> None:
    clear: Gaps = {(1, 2): 30.0}
    events = events_of([*[clear] * 8, *[NO_GROUND] * 40])
    assert [event.rule for event in events] == ["measurement"]


def test_a_map_that_fails_in_one_frame_is_no_alarm() -> None:
    clear: Gaps = {(1, 2): 30.0}
    assert events_of([*[clear] * 8, NO_GROUND, *[clear] * 8]) == []


def test_another_reason_for_the_missing_map_is_an_update() -> None:
    stale = NoGroundMap("map is stale")
    events = events_of([*[NO_GROUND] * 10, *[stale] * 10], HazardParams(update_every_s=1.0))
    assert [(event.phase, event.reason, event.time_s) for event in events] == [
        ("opened", "reference not found", 0.0),
        ("updated", "map is stale", 1.25),
    ]


def test_the_end_of_the_stream_closes_everything_that_is_open() -> None:
    monitor = HazardMonitor()
    opened = [
        event
        for index in range(4)
        for event in monitor.update(STEP_S * index, *frame({(1, 2): -1.0, (3, 4): 0.5, (5, 6): 30.0}), GROUND, FOLLOWED)
    ]
    closed = monitor.close(1.0)
    assert [(event.phase, event.time_s, event.reason) for event in closed] == [("closed", 1.0, "end of stream")] * 2
    assert [event.hazard_id for event in closed] == [event.hazard_id for event in opened]
    assert [event.gap_m for event in closed] == [-1.0, 0.5]
    assert monitor.close(1.0) == ()
    unmapped = HazardMonitor()
    unmapped.update(0.0, GroundPositions.empty(), Proximities.empty(), NO_GROUND, FOLLOWED)
    assert [(event.rule, event.phase) for event in unmapped.close(0.1)] == [("measurement", "closed")]


def test_a_reset_forgets_and_leaves_other_streams_alone() -> None:
    first, second = HazardMonitor(CALM), HazardMonitor(CALM)
    for monitor in (first, second):
        for index in range(4):
            monitor.update(STEP_S * index, *frame({(1, 2): -1.0}), GROUND, FOLLOWED)
    first.reset()
    assert first.close(1.0) == ()
    assert len(second.close(1.0)) == 1


def test_where_looks_are_rare_a_breach_is_said_at_the_look_that_shows_it() -> None:
    """One look every two seconds: a second one would come too late."""
    events = events_of([{(1, 2): 9.0}, {(1, 2): -1.8}, {(1, 2): 9.0}, {(1, 2): 9.0}], step_s=2.0)
    assert next((e.phase, e.severity, e.time_s) for e in events) == ("opened", "danger", 2.0)


@pytest.mark.parametrize("looks", [1, 2])
def test_what_a_film_shows_in_all_its_few_looks_is_said_at_its_end(looks: int) -> None:
    monitor = HazardMonitor(CALM)
    for k in range(looks):
        assert monitor.update(STEP_S * k, *frame({(1, 2): -2.0}), GROUND, FOLLOWED) == ()
    assert [(e.phase, e.severity) for e in monitor.close(STEP_S * looks)] == [
        ("opened", "danger"),
        ("closed", "danger"),
    ]


def test_noise_in_the_last_frame_is_not_said_at_the_end() -> None:
    monitor = HazardMonitor(CALM)
    for k in range(10):
        monitor.update(STEP_S * k, *frame({(1, 2): 9.0 if k < 9 else -2.0}), GROUND, FOLLOWED)
    assert monitor.close(STEP_S * 10) == ()


def test_one_bad_frame_of_five_a_second_is_no_alarm_whenever_it_comes() -> None:
    """Frame times are rounded: a step of a fifth of a second is no rare look."""
    for first in range(40):
        monitor = HazardMonitor(HazardParams(rule="distance", min_duration_s=0.2))
        for k in range(first, first + 6):
            positions, pairs = frame({(1, 2): -1.0 if k == first + 3 else 9.0})
            assert monitor.update(k / 5.0, positions, pairs, GROUND, FOLLOWED) == ()
