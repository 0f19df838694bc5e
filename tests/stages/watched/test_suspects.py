"""Where the detector sees what may be a worker, and no track shows him, ground is not called watched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from stages.watched.drawn_site import SIZE_PX, ground_map, site_picture
from stages.watched.test_watcher import FINDING, NOTHING, SEEDS, frame, machine, nobody

from standoff.core.homography import FloatArray
from standoff.core.types import Detections, GroundMap, GroundPositions, Hazard, NoGroundMap, Proximities, Tracks
from standoff.core.watched_ground import (
    MAYBE_SOMEBODY,
    REASONS,
    TOO_SMALL,
    WATCHED,
    CellArray,
    cell_middles_px,
    cell_of,
)
from standoff.stages.hazard import HazardMonitor
from standoff.stages.watched import GroundWatcher, WatchedParams
from standoff.stages.watched.suspects import Suspects

WORKER, EXCAVATOR = 0, 1
PARAMS = WatchedParams()
FOOT_PX = np.array([640.0, 500.0])


def seen(
    foot_px: FloatArray = FOOT_PX, score: float = 0.3, class_id: int = WORKER, tall_px: float = 60.0
) -> Detections:
    x, y = foot_px
    box = np.array([[x - tall_px / 4, y - tall_px, x + tall_px / 4, y]])
    return Detections(box, np.array([score]), np.array([class_id]))


def track(detection: Detections) -> tuple[Tracks, GroundPositions]:
    tracks, positions = machine(tuple(detection.xyxy_px[0]), (0.0, 0.0), 2.0)
    return replace(tracks, class_id=detection.class_id), replace(positions, class_id=detection.class_id)


def cells_of(
    watcher: GroundWatcher,
    detections: Detections,
    time_s: float = 0.0,
    ground: GroundMap | NoGroundMap | None = None,
    of: tuple[Tracks, GroundPositions] | None = None,
) -> CellArray:
    shown = frame(site_picture(0), time_s)
    mapped = ground_map() if ground is None else ground
    return watcher.update(shown, detections, mapped, *(of or nobody())).cells


def under(cells: CellArray, foot_px: FloatArray = FOOT_PX) -> int:
    place, _ = cell_of(foot_px[None], SIZE_PX)
    return int(cells[place[0, 0], place[0, 1]])


def watcher() -> GroundWatcher:
    return GroundWatcher(finding=FINDING)


@pytest.mark.parametrize("seed", SEEDS)
def test_ground_on_which_somebody_may_stand_is_not_watched_and_the_rest_is(seed: int) -> None:
    rng = np.random.default_rng(seed)
    foot_px = rng.uniform((100.0, 200.0), (1180.0, 700.0))
    cells = cells_of(watcher(), seen(foot_px))
    assert under(cells, foot_px) == MAYBE_SOMEBODY
    maybe = cells == MAYBE_SOMEBODY
    assert (cells[~maybe] == WATCHED).all()
    middles_px = cell_middles_px(SIZE_PX).reshape(*maybe.shape, 2)[maybe]
    far_m = np.linalg.norm(ground_map().to_ground(middles_px)[0] - spot(foot_px), axis=1)
    # A cell counts as soon as the circle about the place touches it.
    assert far_m.max() < PARAMS.suspect_radius_m + cell_m(foot_px)


def spot(foot_px: FloatArray) -> FloatArray:
    place_m: FloatArray = ground_map().to_ground(foot_px[None])[0][0]
    return place_m


def cell_m(foot_px: FloatArray) -> float:
    ends_m = ground_map().to_ground(foot_px + np.array([[-40.0, -40.0], [40.0, 40.0]]))[0]
    return float(np.linalg.norm(ends_m[1] - ends_m[0]))


def test_more_is_told_of_it_than_that_workers_would_be_too_small() -> None:
    cells = cells_of(watcher(), seen(), ground=ground_map(110.0))
    assert under(cells) == MAYBE_SOMEBODY
    assert TOO_SMALL in cells
    assert REASONS[MAYBE_SOMEBODY] == "somebody may stand there"


@pytest.mark.parametrize(
    ("detections", "tracks"),
    [
        (seen(score=0.19), nobody()),
        (seen(class_id=EXCAVATOR), nobody()),
        (seen(), track(seen())),
        # Half of whom a track shows whole, as detectors see people a second time.
        (seen(FOOT_PX - [0.0, 25.0], tall_px=30.0), track(seen())),
    ],
    ids=["too unsure", "a machine", "in a track", "a part of one in a track"],
)
def test_who_is_known_and_what_is_no_worker_is_no_suspect(
    detections: Detections, tracks: tuple[Tracks, GroundPositions]
) -> None:
    assert MAYBE_SOMEBODY not in cells_of(watcher(), detections, of=tracks)


def test_a_suspect_is_remembered_for_a_while_and_no_longer() -> None:
    one = watcher()
    cells_of(one, seen())
    told = {time_s: under(cells_of(one, NOTHING, time_s)) for time_s in (0.5, 1.9, 2.1)}
    assert told == {0.5: MAYBE_SOMEBODY, 1.9: MAYBE_SOMEBODY, 2.1: WATCHED}


def test_who_is_seen_again_and_again_is_remembered_once_as_of_the_last_time() -> None:
    rng, suspects = np.random.default_rng(0), Suspects(PARAMS)
    for number in range(200):
        suspects.note(number / 25.0, seen(FOOT_PX + rng.normal(0.0, 1.0, 2)), Tracks.empty(), ground_map())
        assert 1 <= len(suspects) <= 4
    suspects.note(199 / 25.0 + PARAMS.suspect_s + 0.1, NOTHING, Tracks.empty(), ground_map())
    assert len(suspects) == 0


def test_a_suspect_stays_where_he_is_on_the_ground_when_the_camera_turns() -> None:
    one, before, after = watcher(), ground_map(25.0, 50.0), ground_map(25.0, 55.0)
    cells_of(one, seen(), ground=before)
    now_px = after.to_image(before.to_ground(FOOT_PX[None])[0])[0][0]
    assert abs(now_px[1] - FOOT_PX[1]) > 80.0, "a law about nothing"
    cells = cells_of(one, NOTHING, 0.2, ground=after)
    assert (under(cells, now_px), under(cells)) == (MAYBE_SOMEBODY, WATCHED)


def test_a_suspect_whom_a_track_shows_now_is_none_any_more() -> None:
    one = watcher()
    cells_of(one, seen())
    assert MAYBE_SOMEBODY not in cells_of(one, seen(score=0.9), 0.2, of=track(seen(score=0.9)))
    assert MAYBE_SOMEBODY not in cells_of(one, NOTHING, 0.4)


def test_where_metres_begin_to_be_counted_from_elsewhere_places_are_forgotten() -> None:
    one = watcher()
    cells_of(one, seen())
    assert MAYBE_SOMEBODY not in cells_of(one, NOTHING, 0.2, ground=replace(ground_map(), site_frame=1))


def test_without_a_map_nothing_is_watched_and_suspects_are_remembered() -> None:
    one = watcher()
    cells_of(one, seen())
    assert MAYBE_SOMEBODY not in cells_of(one, NOTHING, 0.2, ground=NoGroundMap("lost"))
    assert under(cells_of(one, NOTHING, 0.4)) == MAYBE_SOMEBODY
    one.reset()
    assert MAYBE_SOMEBODY not in cells_of(one, NOTHING, 0.6)


def suspects_of(
    looks: Sequence[Detections], away_m: float, class_id: int = EXCAVATOR, *, step_s: float = 0.5
) -> list[bool]:
    """Return in which looks somebody at `FOOT_PX` is suspected near a machine so far from him."""
    ground, one = ground_map(), watcher()
    (foot_m,), _ = ground.to_ground(FOOT_PX[None])
    tracks, positions = machine((10.0, 10.0, 60.0, 60.0), (0.0, 0.0), 12.1)
    beside = replace(positions, xy_m=foot_m[None] + (away_m, 0.0), class_id=np.array([class_id]))
    return [
        bool(one.update(frame(site_picture(0), k * step_s), look, ground, tracks, beside).suspects[0])
        for k, look in enumerate(looks)
    ]


@pytest.mark.parametrize(
    ("away_m", "class_id", "expected"),
    [
        (13.9, EXCAVATOR, True),
        (14.3, EXCAVATOR, False),
        (2.6, EXCAVATOR, True),
        (2.4, EXCAVATOR, False),
        (3.0, WORKER, False),
    ],
)
def test_somebody_is_suspected_near_the_machines_that_could_reach_him_and_not_on_them(
    away_m: float, class_id: int, expected: bool
) -> None:
    assert suspects_of([seen()], away_m, class_id) == [expected]


def test_whoever_is_on_one_machine_is_not_near_another() -> None:
    ground = ground_map()
    (foot_m,), _ = ground.to_ground(FOOT_PX[None])
    tracks, positions = machine((10.0, 10.0, 60.0, 60.0), (0.0, 0.0), 12.1)
    both = np.array([0, 0])
    for away_m, expected in ((2.4, False), (2.6, True)):
        two = replace(positions[both], track_id=np.array([1, 2]), xy_m=foot_m + np.array([[away_m, 0.0], [9.0, 0.0]]))
        watched = watcher().update(frame(site_picture(0)), seen(), ground, tracks[both], two)
        assert watched.suspects.tolist() == [expected] * 2


def test_somebody_is_suspected_near_a_machine_for_two_seconds_after_he_was_seen() -> None:
    yes, no = seen(), NOTHING
    assert suspects_of([no, yes, no, no, no, no, no], 5.0) == [False, True, True, True, True, True, False]


def test_where_the_machine_has_no_place_and_where_there_is_no_map_nobody_is_suspected() -> None:
    tracks, positions = machine((10.0, 10.0, 60.0, 60.0), (0.0, 0.0), 12.1)
    nowhere = replace(positions, xy_m=np.full((1, 2), np.nan), valid=np.zeros(1, dtype=np.bool_))
    for ground in (ground_map(), NoGroundMap("none")):
        watched = watcher().update(frame(site_picture(0)), seen(), ground, tracks, nowhere)
        assert watched.suspects.tolist() == [False]


def test_what_may_be_a_worker_near_a_machine_is_one_hazard_while_he_is_seen_and_a_while_after() -> None:
    ground = ground_map()
    (foot_m,), _ = ground.to_ground(FOOT_PX[None])
    tracks, positions = machine((10.0, 10.0, 60.0, 60.0), (0.0, 0.0), 12.1)
    beside = replace(positions, xy_m=foot_m[None] + (5.0, 0.0))
    one, monitor = watcher(), HazardMonitor()
    events: list[Hazard] = []
    for k in range(12):
        found = seen() if 2 <= k < 6 else NOTHING
        watched = one.update(frame(site_picture(0), 0.5 * k), found, ground, tracks, beside)
        events += monitor.update(0.5 * k, beside, Proximities.empty(), ground, np.zeros(0, dtype=np.bool_), watched)
    told = [(event.phase, event.time_s) for event in events if event.rule == "proximity"]
    assert told == [("opened", 2.0), ("closed", 5.5)]
