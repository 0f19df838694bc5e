"""Zones: who is in them, who may be, and the life of what is said of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.types import GroundMap, GroundPositions, Hazard, NoGroundMap, Proximities
from standoff.core.zones import Zone, ZoneKind
from standoff.stages.hazard import HazardMonitor, HazardParams

GROUND = GroundMap(np.eye(3), np.zeros((9, 9)), (1920, 1080), "exact", 0.02, frame_stated=True)
ELSEWHERE = replace(GROUND, frame_stated=False)
FOLLOWED = np.zeros(1, dtype=np.bool_)
SQUARE = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
HOLE = np.array([[4.0, 4.0], [6.0, 4.0], [6.0, 6.0], [4.0, 6.0]])
CUT_OFF = "cut off by the picture's edge"
STEP_S = 0.125
CALM = HazardParams(min_duration_s=0.25, release_s=0.5, update_every_s=1000.0, unknown_after_s=1.0)
IN, NEAR, AWAY, UNSEEN = (5.0, 3.0), (5.0, -0.4), (5.0, -30.0), None

Place = tuple[float, float] | None
Frame = dict[int, Place]


def zone(kind: ZoneKind = "no_go", name: str = "pit", *holes: FloatArray) -> Zone:
    return Zone(name, kind, [[SQUARE, *holes]])


def located(frame: Frame, classes: dict[int, str], sigma_m: float = 0.1) -> GroundPositions:
    """Return the rows of one frame; None is a track that is seen but cut off."""
    tracks = sorted(frame)
    places = [frame[track] for track in tracks]
    valid = np.array([place is not None for place in places], dtype=np.bool_)
    xy_m = np.array([place or (math.nan, math.nan) for place in places]).reshape(-1, 2)
    return GroundPositions(
        track_id=np.array(tracks, dtype=np.int64),
        class_id=np.array([CLASS_BY_NAME[classes.get(track, "worker")].id for track in tracks], dtype=np.int64),
        xy_m=xy_m,
        velocity_mps=xy_m * 0.0,
        state_covariance=np.where(valid[:, None, None], np.eye(4) * sigma_m**2, np.nan),
        map_factor_m=np.zeros((len(tracks), 2, 10)),
        predicted=np.zeros(len(tracks), dtype=np.bool_),
        standing_s=np.zeros(len(tracks)),
        radius_m=np.zeros(len(tracks)),
        valid=valid,
        reason=np.where(valid, "", CUT_OFF).astype(object),
    )


def events_of(
    frames: Iterable[Frame | NoGroundMap],
    zones: Sequence[Zone] = (zone(),),
    classes: dict[int, str] | None = None,
    *,
    ground: GroundMap = GROUND,
    sigma_m: float = 0.1,
    params: HazardParams = CALM,
) -> list[Hazard]:
    """Run a monitor without pairs over frames of places by track; in a frame without a map nobody is located."""
    monitor = HazardMonitor(params, zones)
    events: list[Hazard] = []
    for index, frame in enumerate(frames):
        here: Frame = {1: UNSEEN} if isinstance(frame, NoGroundMap) else frame
        now = frame if isinstance(frame, NoGroundMap) else ground
        rows = located(here, classes or {}, sigma_m)
        events += monitor.update(STEP_S * index, rows, Proximities.empty(), now, FOLLOWED)
    return [event for event in events if event.rule == "zone"]


def worker(*places: Place) -> list[Frame]:
    return [{1: place} for place in places]


def told(events: Iterable[Hazard]) -> list[tuple[str, str, float]]:
    return [(event.phase, event.severity, event.time_s) for event in events]


def test_somebody_in_a_zone_is_danger_once_it_has_lasted_and_over_once_he_has_left() -> None:
    events = events_of(worker(AWAY, *[IN] * 4, *[AWAY] * 6))
    assert told(events) == [("opened", "danger", 0.375), ("closed", "danger", 1.125)]
    assert {(event.rule, event.zone, event.track_ids) for event in events} == {("zone", "pit", (1,))}
    assert len({event.hazard_id for event in events}) == 1
    assert (events[0].distance_m, events[0].gap_m) == (0.0, -3.0)
    assert events[0].sigma_m == pytest.approx(0.1)
    assert events[-1].reason == "clear for 0.5 s"


@pytest.mark.parametrize(
    ("sigma_m", "frames", "opened_s"),
    [
        (0.1, [{1: IN}] * 4, 0.0),
        (0.1, [{1: UNSEEN}] * 2 + [{1: IN}] * 4, 0.25),
        (6.0, [{1: IN}] * 4, 0.25),  # perhaps beside it
        (0.1, [{1: AWAY}] + [{1: IN}] * 4, 0.375),  # was elsewhere: that he is inside may be one bad frame
        (0.1, [{1: AWAY}, {}, {}] + [{1: IN}] * 4, 0.625),
    ],
)
def test_who_is_in_a_zone_beyond_doubt_when_first_located_is_warned_of_at_once(
    sigma_m: float, frames: list[Frame], opened_s: float
) -> None:
    events = events_of(frames, sigma_m=sigma_m)
    assert (events[0].phase, events[0].time_s) == ("opened", opened_s)


def test_near_a_zone_it_is_a_warning_that_becomes_danger_and_back() -> None:
    events = events_of(worker(*[NEAR] * 4, *[IN] * 4, *[(5.0, -0.9)] * 8, *[(5.0, -1.4)] * 8, *[AWAY] * 5))
    assert told(events) == [
        ("opened", "warning", 0.25),
        ("updated", "danger", 0.75),
        ("updated", "warning", 1.5),
        ("closed", "warning", 3.5),
    ]
    assert (events[2].distance_m, events[2].gap_m) == (0.9, 0.9)


@pytest.mark.parametrize(("warn_m", "expected"), [(0.0, []), (0.3, []), (0.5, ["warning"])])
def test_how_near_is_near_is_a_setting(warn_m: float, expected: list[str]) -> None:
    params = replace(CALM, zone_warn_m=warn_m)
    assert [event.severity for event in events_of(worker(*[NEAR] * 6), params=params)] == expected


def test_a_place_that_is_not_certain_is_danger_from_one_half_and_a_warning_from_a_tenth() -> None:
    # A straight edge far from corners: one half on it, a tenth 1.28 standard errors from it.
    for y_m, expected in ((0.05, ["danger"]), (-0.05, ["warning"]), (-2.5, ["warning"]), (-2.6, [])):
        assert [e.severity for e in events_of(worker(*[(5.0, y_m)] * 6), sigma_m=2.0)] == expected
    narrow = Zone("kerb", "no_go", [[np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 0.3], [0.0, 0.3]])]])
    found = events_of(worker(*[(5.0, 0.15)] * 6), [narrow], sigma_m=2.0)
    assert [event.severity for event in found] == ["warning"]


def test_in_a_hole_nobody_is_in_the_zone() -> None:
    holed = zone("no_go", "pit", np.array([[2.0, 2.0], [8.0, 2.0], [8.0, 8.0], [2.0, 8.0]]))
    assert events_of(worker(*[(5.0, 5.0)] * 6), [holed]) == []
    assert [e.severity for e in events_of(worker(*[(1.0, 5.0)] * 6), [holed])] == ["danger"]


@pytest.mark.parametrize(
    ("kind", "name", "expected"),
    [
        ("no_go", "worker", ["danger"]),
        ("no_go", "dump_truck", ["danger"]),
        ("no_go", "reference", []),
        ("machine_only", "worker", ["danger"]),
        ("machine_only", "dump_truck", []),
        ("crossing", "worker", []),
        ("crossing", "dump_truck", []),
    ],
)
def test_each_kind_is_for_those_whom_it_is_for(kind: ZoneKind, name: str, expected: list[str]) -> None:
    events = events_of(worker(*[IN] * 6), [zone(kind)], {1: name})
    assert [event.severity for event in events] == expected


def test_a_worker_and_a_machine_in_a_crossing_are_one_hazard_as_grave_as_the_one_further_out() -> None:
    crossing, classes = [zone("crossing", "gate")], {2: "wheel_loader", 3: "worker"}
    stages: list[Frame] = [
        {1: IN, 2: AWAY, 3: (5.0, 5.0)},
        {1: IN, 2: NEAR, 3: AWAY},
        {1: IN, 2: (6.0, 6.0), 3: AWAY},
        {1: AWAY, 2: IN, 3: AWAY},
    ]
    frames = [stage for stage, count in zip(stages, (4, 4, 4, 6), strict=True) for _ in range(count)]
    events = events_of(frames, crossing, classes)
    assert told(events) == [("opened", "warning", 0.75), ("updated", "danger", 1.25), ("closed", "danger", 2.0)]
    assert {(event.zone, event.track_ids) for event in events} == {("gate", (1, 2))}
    assert (events[0].distance_m, events[1].gap_m) == (0.4, -3.0)
    two_workers: list[Frame] = [{1: IN, 3: IN}] * 6
    assert events_of(two_workers, crossing, classes) == []


def test_who_is_in_a_zone_and_cannot_be_located_any_more_is_unknown_until_he_can() -> None:
    events = events_of(worker(*[IN] * 4, *[UNSEEN] * 20, *[IN] * 4))
    assert told(events) == [("opened", "danger", 0.0), ("unknown", "danger", 0.75), ("updated", "danger", 3.0)]
    assert len({event.hazard_id for event in events}) == 1
    assert events[1].reason == CUT_OFF
    assert math.isnan(events[1].distance_m) and math.isnan(events[1].gap_m)


def test_who_goes_out_of_sight_beside_a_zone_may_be_in_it_and_who_was_far_from_it_not_yet() -> None:
    # Half a second to run two metres, and a second of patience.
    beside = events_of(worker(*[(5.0, -3.0)] * 2, *[UNSEEN] * 16))
    assert told(beside) == [("opened", "unknown", 1.75)]
    assert beside[0].reason == CUT_OFF
    # Thirty metres are more than seven seconds of running.
    far = events_of(worker(AWAY, *[UNSEEN] * 80))
    assert [event.severity for event in far] == ["unknown"]
    assert 29.0 / 4.0 + 1.0 <= far[0].time_s <= 29.0 / 4.0 + 1.3


def test_somebody_who_was_never_located_may_be_anywhere_but_not_at_once() -> None:
    assert told(events_of(worker(*[UNSEEN] * 12))) == [("opened", "unknown", 1.0)]
    assert events_of(worker(*[UNSEEN] * 6, *[AWAY] * 6)) == []


def test_an_unknown_hazard_ends_once_he_is_located_elsewhere_and_takes_its_level_once_he_is_located_inside() -> None:
    assert told(events_of(worker(*[UNSEEN] * 10, *[AWAY] * 8)))[-1] == ("closed", "unknown", 1.75)
    inside = events_of(worker(*[UNSEEN] * 10, *[IN] * 8))
    assert [event.severity for event in inside] == ["unknown", "danger"]


def test_in_a_crossing_one_who_cannot_be_located_leaves_the_pair_unknown_only_while_the_other_is_there() -> None:
    crossing, classes = [zone("crossing", "gate")], {2: "wheel_loader"}
    there: list[Frame] = [{1: UNSEEN, 2: IN}] * 12
    assert told(events_of(there, crossing, classes)) == [("opened", "unknown", 1.0)]
    gone: list[Frame] = [{1: UNSEEN, 2: AWAY}] * 12
    assert events_of(gone, crossing, classes) == []
    neither: list[Frame] = [{1: UNSEEN, 2: UNSEEN}] * 12
    assert events_of(neither, crossing, classes) == []
    leaves = events_of([*there, *gone], crossing, classes)
    assert told(leaves)[-1] == ("closed", "unknown", 2.0)


def test_a_track_that_is_lost_in_a_zone_leaves_its_hazard_unknown_for_a_while() -> None:
    events = events_of([*worker(*[IN] * 4), *[{}] * 40])
    assert [event.reason for event in events] == ["", "track lost", "track lost for 3 s"]
    assert [event.phase for event in events] == ["opened", "unknown", "closed"]


def test_without_a_map_open_hazards_are_unknown_and_no_zone_opens_one() -> None:
    gone = NoGroundMap("reference not found")
    events = events_of([*worker(*[IN] * 4), *[gone] * 30, *worker(*[IN] * 4)])
    assert [event.phase for event in events] == ["opened", "unknown", "updated"]
    assert events_of([gone] * 30) == []


def test_where_nobody_stated_the_site_frame_all_zones_are_unknown_and_one_hazard_says_so() -> None:
    events = events_of(worker(*[IN] * 20), ground=ELSEWHERE)
    (event,) = events
    assert (event.phase, event.severity, event.time_s) == ("opened", "unknown", 0.0)
    assert (event.track_ids, event.zone) == ((), "")
    assert "nobody stated where the site frame lies" in events[0].reason
    monitor = HazardMonitor(CALM, [zone()])
    for index in range(20):
        ground = ELSEWHERE if 4 <= index < 14 else GROUND
        rows = located({1: IN}, {})
        events += monitor.update(STEP_S * index, rows, Proximities.empty(), ground, FOLLOWED)
    mine = [event for event in events[1:] if event.track_ids == (1,)]
    assert [event.phase for event in mine] == ["opened", "unknown", "updated"]
    assert monitor.describe()["warnings"] == [
        "zones were not watched in 10 of 20 frames with a ground map: nobody stated where the site frame lies; "
        "a survey, a marker, or a reference with first_corner_px would tell"
    ]


def test_without_zones_nothing_is_said_of_them() -> None:
    assert events_of(worker(*[IN] * 20), [], ground=ELSEWHERE) == []


def test_the_end_of_the_stream_closes_what_is_open() -> None:
    monitor = HazardMonitor(CALM, [zone(), zone("machine_only", "road")])
    opened = [
        event
        for index in range(4)
        for event in monitor.update(STEP_S * index, located({1: IN}, {}), Proximities.empty(), GROUND, FOLLOWED)
    ]
    closed = monitor.close(1.0)
    assert [(event.zone, event.phase, event.reason) for event in closed] == [
        ("pit", "closed", "end of stream"),
        ("road", "closed", "end of stream"),
    ]
    assert [event.hazard_id for event in closed] == [event.hazard_id for event in opened]
    assert monitor.close(1.1) == ()


# On no limit: there the last digit would decide.
_METRES = st.integers(-30, 130).map(lambda tenths: tenths / 10.0 + 0.037)
_PLACES = st.one_of(st.none(), st.tuples(_METRES, _METRES))
_WALKS = st.lists(st.fixed_dictionaries({1: _PLACES, 2: _PLACES}), min_size=1, max_size=25)


def lives(events: Iterable[Hazard]) -> list[tuple[object, ...]]:
    return [(e.zone, e.track_ids, e.phase, e.severity, e.time_s, f"{e.gap_m:.6f}", e.reason) for e in events]


@given(_WALKS, st.permutations(range(3)), st.floats(-1000.0, 1000.0))
@examples(30)
def test_the_order_of_zones_and_a_shift_of_the_whole_site_change_nothing(
    frames: list[Frame], order: list[int], shift_m: float
) -> None:
    zones = [zone("no_go", "pit", HOLE), zone("machine_only", "road"), zone("crossing", "gate")]
    classes = {2: "excavator"}
    expected = lives(events_of(frames, zones, classes))
    assert lives(events_of(frames, [zones[k] for k in order], classes)) == expected
    moved = [Zone(one.name, one.kind, [[ring + shift_m for ring in p] for p in one.polygons_m]) for one in zones]
    walked = [
        {track: None if at is None else (at[0] + shift_m, at[1] + shift_m) for track, at in frame.items()}
        for frame in frames
    ]
    assert lives(events_of(walked, moved, classes)) == expected


@given(_WALKS)
@examples(30)
def test_each_hazard_opens_first_closes_last_and_is_of_one_zone_and_the_same_tracks(frames: list[Frame]) -> None:
    monitor = HazardMonitor(CALM, [zone(), zone("crossing", "gate")])
    events: list[Hazard] = []
    for index, frame in enumerate(frames):
        rows = located(frame, {2: "excavator"})
        events += monitor.update(STEP_S * index, rows, Proximities.empty(), GROUND, FOLLOWED)
    events += monitor.close(STEP_S * len(frames))
    by_id: dict[str, list[Hazard]] = {}
    for event in events:
        by_id.setdefault(event.hazard_id, []).append(event)
    for life in by_id.values():
        assert life[0].phase == "opened" and life[-1].phase == "closed"
        assert {event.phase for event in life[1:-1]} <= {"updated", "unknown"}
        assert len({(event.zone, event.track_ids) for event in life}) == 1


@given(_WALKS, st.floats(0.0, 2.0))
@examples(30)
def test_warning_earlier_never_loses_a_hazard(frames: list[Frame], more_m: float) -> None:
    # Said at once, without patience: then an earlier warning is one of the same hazards or of more.
    prompt = HazardParams(min_duration_s=0.0, release_s=0.0, hysteresis_m=0.0, zone_warn_m=0.5)
    narrow = {(e.zone, e.track_ids) for e in events_of(frames, params=prompt)}
    wide = {(e.zone, e.track_ids) for e in events_of(frames, params=replace(prompt, zone_warn_m=0.5 + more_m))}
    assert narrow <= wide
