"""Where the detector sees what may be a worker, and no track shows him, ground is not called watched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from stages.watched.drawn_site import SIZE_PX, ground_map, site_picture
from stages.watched.test_watcher import FINDING, NOTHING, SEEDS, frame, machine, nobody

from standoff.core.homography import FloatArray
from standoff.core.types import Detections, GroundMap, GroundPositions, NoGroundMap, Tracks
from standoff.core.watched_ground import (
    MAYBE_SOMEBODY,
    REASONS,
    TOO_SMALL,
    WATCHED,
    CellArray,
    cell_middles_px,
    cell_of,
)
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
