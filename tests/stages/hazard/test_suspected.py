"""A machine near which somebody may stand whom no track shows has a hazard of its own, of unknown severity."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from stages.hazard.test_zone import FOLLOWED, GROUND, STEP_S, located

from standoff.core.classes import CLASS_BY_NAME, CLASSES
from standoff.core.homography import BoolArray
from standoff.core.roles import IS_EQUIPMENT
from standoff.core.types import PARKED, GroundMap, Hazard, NoGroundMap, Proximities, WatchedGround
from standoff.core.watched_ground import COLUMNS, ROWS
from standoff.stages.hazard import HazardMonitor, HazardParams
from standoff.stages.hazard.suspected import NOBODY_NEAR, SOMEBODY_NEAR

CALM = HazardParams(release_s=0.5, unknown_after_s=1.0, unknown_timeout_s=1.0)
NO_MAP, NOT_JUDGED = NoGroundMap("reference not found"), None
Look = bool | None


def ground(suspects: Sequence[bool]) -> WatchedGround:
    cells = np.zeros((ROWS, COLUMNS), dtype=np.int8)
    return WatchedGround(cells, np.ones(cells.shape), np.ones(len(suspects)), np.array(suspects, dtype=np.bool_))


def events_of(
    looks: Iterable[Look],
    *,
    name: str = "excavator",
    standing_s: Sequence[float] = (0.0,),
    machines: BoolArray = IS_EQUIPMENT,
    maps: Sequence[GroundMap | NoGroundMap] = (GROUND,),
    placed: Sequence[bool] = (True,),
    parked_after_s: float | None = 60.0,
) -> list[Hazard]:
    """Run a monitor over looks at one machine, track 7; the last map, place and standing time stay."""
    monitor = HazardMonitor(CALM, (), machines, parked_after_s)
    events: list[Hazard] = []
    for index, look in enumerate(looks):
        is_placed = placed[min(index, len(placed) - 1)]
        positions = located({7: (0.0, 0.0) if is_placed else None}, {7: name})
        positions = replace(positions, standing_s=np.array([standing_s[min(index, len(standing_s) - 1)]]))
        watched = WatchedGround() if look is NOT_JUDGED else ground([look])
        mapped = maps[min(index, len(maps) - 1)]
        events += monitor.update(STEP_S * index, positions, Proximities.empty(), mapped, FOLLOWED, watched)
    return of_machines(events)


def of_machines(events: Iterable[Hazard]) -> list[Hazard]:
    return [event for event in events if event.rule == "proximity"]


def told(events: Iterable[Hazard]) -> list[tuple[str, float]]:
    return [(event.phase, event.time_s) for event in events]


def test_somebody_who_may_stand_near_a_machine_for_a_while_is_an_unknown_hazard_until_he_is_gone() -> None:
    opened, closed = events_of([True] * 12 + [False] * 8)
    assert (opened.phase, opened.severity, opened.track_ids) == ("opened", "unknown", (7,))
    assert (opened.time_s, opened.reason) == (1.0, SOMEBODY_NEAR)
    assert math.isnan(opened.distance_m) and math.isnan(opened.gap_m) and not opened.zone
    assert (closed.phase, closed.severity, closed.time_s) == ("closed", "unknown", 12 * STEP_S + 0.5)
    assert closed.reason == NOBODY_NEAR
    assert closed.hazard_id == opened.hazard_id


def test_who_is_in_a_track_before_is_no_hazard_and_a_short_break_ends_none() -> None:
    assert events_of([True] * 8 + [False] + [True] * 8) == []
    assert told(events_of([True] * 9 + [False] * 4 + [True] * 9)) == [("opened", 1.0)]


@pytest.mark.parametrize("name", [one.name for one in CLASSES if one.name not in ("worker", "reference")])
def test_a_parked_machine_is_suspected_of_nobody_and_an_excavator_is_never_parked(name: str) -> None:
    looks = [True] * 12
    assert len(events_of(looks, name=name, standing_s=[59.0])) == 1
    assert len(events_of(looks, name=name, standing_s=[61.0])) == (name == "excavator")
    assert len(events_of(looks, name=name, standing_s=[61.0], parked_after_s=None)) == 1


def test_the_hazard_of_a_machine_that_parks_is_over_because_it_parks() -> None:
    events = events_of([True] * 20, name="dump_truck", standing_s=[59.0] * 12 + [60.0])
    assert [(event.phase, event.reason) for event in events] == [("opened", SOMEBODY_NEAR), ("closed", PARKED)]


def test_machines_that_nobody_is_measured_against_have_none() -> None:
    others = np.arange(len(CLASSES)) == CLASS_BY_NAME["dump_truck"].id
    assert events_of([True] * 12, machines=others) == []
    assert len(events_of([True] * 12, machines=others, name="dump_truck")) == 1


@pytest.mark.parametrize(
    "then",
    [
        {"looks": [NOT_JUDGED] * 20},
        {"looks": [False] * 20, "maps": [GROUND] * 12 + [NO_MAP], "placed": [True] * 12 + [False]},
        {"looks": [False] * 20, "placed": [True] * 12 + [False]},
    ],
)
def test_what_is_not_known_any_more_is_not_over(then: dict[str, list[Look]]) -> None:
    looks = [True] * 12 + then.pop("looks")
    assert told(events_of(looks, **then)) == [("opened", 1.0)]  # type: ignore[arg-type]


def test_the_time_without_a_map_does_not_count() -> None:
    maps = [GROUND] * 4 + [NO_MAP] * 20 + [GROUND]
    looks = [True] * 4 + [False] * 20 + [True] * 12
    assert told(events_of(looks, maps=maps, placed=[bool(one) for one in maps])) == [("opened", 24 * STEP_S + 1.0)]


@pytest.mark.parametrize("mapped", [GROUND, NO_MAP])
def test_a_machine_that_is_lost_leaves_its_hazard_unknown_for_a_while(mapped: GroundMap | NoGroundMap) -> None:
    monitor = HazardMonitor(CALM)
    events: list[Hazard] = []
    for index in range(40):
        is_seen = index < 12
        positions = located({7: (0.0, 0.0)} if is_seen else {}, {7: "excavator"})
        now = GROUND if is_seen else mapped
        events += monitor.update(
            STEP_S * index, positions, Proximities.empty(), now, FOLLOWED, ground([True] * is_seen)
        )
    assert told(of_machines(events)) == [("opened", 1.0), ("unknown", 1.5), ("closed", 2.5)]
    assert [event.reason for event in of_machines(events)] == [SOMEBODY_NEAR, "track lost", "track lost for 1 s"]


def test_a_machine_that_comes_back_says_again_why_it_is_unknown() -> None:
    monitor = HazardMonitor(CALM)
    events: list[Hazard] = []
    for index in range(24):
        is_seen = not 12 <= index < 16
        positions = located({7: (0.0, 0.0)} if is_seen else {}, {7: "excavator"})
        events += monitor.update(
            STEP_S * index, positions, Proximities.empty(), GROUND, FOLLOWED, ground([True] * is_seen)
        )
    assert [(event.phase, event.reason) for event in events] == [
        ("opened", SOMEBODY_NEAR),
        ("unknown", "track lost"),
        ("unknown", SOMEBODY_NEAR),
    ]


def test_the_end_of_the_stream_closes_it_and_a_reset_forgets_it() -> None:
    for forgets, phases in ((False, ["closed"]), (True, [])):
        monitor = HazardMonitor(CALM)
        for index in range(12):
            positions = located({7: (0.0, 0.0)}, {7: "excavator"})
            monitor.update(STEP_S * index, positions, Proximities.empty(), GROUND, FOLLOWED, ground([True]))
        if forgets:
            monitor.reset()
        assert [event.phase for event in monitor.close(2.0)] == phases
