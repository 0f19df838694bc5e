"""Where hardly any ground is watched, silence is no safety, and the stream says so."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from standoff.core.types import GroundMap, GroundPositions, Hazard, NoGroundMap, Proximities, WatchedGround
from standoff.core.watched_ground import COLUMNS, NO_CONTRAST, NO_GROUND, ROWS, TOO_SMALL, WATCHED
from standoff.stages.hazard import HazardMonitor

GROUND = GroundMap(np.eye(3), np.zeros((9, 9)), (1920, 1080), "exact", 0.02)
STEP_S = 0.1
NOBODY = np.zeros(0, dtype=np.bool_)


def ground(share: float, reason: int = NO_CONTRAST) -> WatchedGround:
    row = np.full(ROWS * COLUMNS, reason, dtype=np.int8)
    row[:COLUMNS] = NO_GROUND
    row[COLUMNS : COLUMNS + round(share * (ROWS - 1) * COLUMNS)] = WATCHED
    cells = row.reshape(ROWS, COLUMNS)
    return WatchedGround(cells, np.where(cells == WATCHED, 0.95, np.nan))


def events_of(frames: Sequence[tuple[GroundMap | NoGroundMap, WatchedGround]]) -> list[Hazard]:
    monitor = HazardMonitor()
    events: list[Hazard] = []
    for k, (map_, watched) in enumerate(frames):
        rows = GroundPositions.empty(), Proximities.empty()
        events += monitor.update(STEP_S * k, *rows, map_, NOBODY, watched)
    return [*events, *monitor.close(STEP_S * len(frames))]


def test_a_stream_that_watches_nothing_says_so_at_once_and_why() -> None:
    (opened, closed) = events_of([(GROUND, ground(0.0, TOO_SMALL))] * 10)
    assert (opened.rule, opened.severity, opened.phase, opened.time_s) == ("measurement", "unknown", "opened", 0.0)
    assert opened.reason == "no ground is watched: workers would be too small"
    assert closed.phase == "closed"


def test_fog_that_comes_and_goes_is_one_hazard() -> None:
    frames = [(GROUND, ground(share)) for share in [0.8] * 10 + [0.01] * 10 + [0.8] * 20]
    opened, closed = events_of(frames)
    assert 1.0 <= opened.time_s <= 1.5 and 2.0 <= closed.time_s <= 3.0
    assert opened.reason.startswith("hardly any ground is watched: ") and "fog" in opened.reason
    assert closed.reason == "ground is watched again"


def test_enough_watched_ground_and_frames_that_nobody_judged_say_nothing() -> None:
    assert events_of([(GROUND, ground(0.06))] * 10) == []
    assert events_of([(GROUND, WatchedGround())] * 10) == []


def test_a_missing_map_is_told_once_not_twice() -> None:
    events = events_of([(NoGroundMap("reference not found"), ground(0.0))] * 10)
    assert [event.reason for event in events if event.phase == "opened"] == ["reference not found"]


def test_a_share_about_the_limit_does_not_flicker() -> None:
    shares = [0.04] * 10 + [0.06, 0.04, 0.07] * 20
    events = events_of([(GROUND, ground(share)) for share in shares])
    assert [event.phase for event in events] == ["opened", "closed"]
    assert events[-1].reason == "end of stream"
