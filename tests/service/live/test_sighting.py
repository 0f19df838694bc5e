"""What the messenger hears of a frame is what the analysis saw."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from service.live.made_sightings import WORKER_M, ground, sighting, watched

from standoff.core.types import NoGroundMap, WatchedGround
from standoff.core.watched_ground import BEHIND_MACHINE, BLURRED, NO_GROUND, WATCHED
from standoff.core.zones import Zone
from standoff.messages import WatchedZone
from standoff.service.live.sighting import Sighting, ground_cells, share_watched
from standoff.service.live.zone_grid import zone_grid_m

FULL = sighting(zones=(WatchedZone("pit", 0.5, "blurred"),), open_hazards=("h-1",), watched=watched(right_half=BLURRED))


def again(one: Sighting) -> Sighting:
    return Sighting.read(json.loads(json.dumps(one.words())))


@pytest.mark.parametrize(
    "one",
    [FULL, replace(FULL, captured_s=None, delay="unknown"), replace(FULL, tracks=(), zones=(), open_hazards=())],
)
def test_a_frame_is_read_as_it_was_told(one: Sighting) -> None:
    read = again(one)
    for name in ("stream", "session", "frame", "time_s", "is_live", "captured_s", "delay", "seen_s", "is_placed",
                 "size_px", "tracks", "zones", "open_hazards"):  # fmt: skip
        assert getattr(read, name) == getattr(one, name)
    assert np.array_equal(read.watched.cells, one.watched.cells)
    for x_m in (5.0, 20.0, 40.0, 63.0):
        assert read.unwatched_at((x_m, 10.0)) == one.unwatched_at((x_m, 10.0))


def test_without_a_map_or_a_judgement_the_same_is_said_on_the_other_side() -> None:
    blind = replace(FULL, ground=NoGroundMap("too few points"), watched=WatchedGround())
    assert isinstance(again(blind).ground, NoGroundMap)
    assert again(blind).unwatched_at(WORKER_M) == "too few points"
    assert again(replace(FULL, ground=NoGroundMap(""))).unwatched_at(WORKER_M) == "no ground map"
    assert not again(replace(FULL, watched=WatchedGround())).watched.judged


def test_words_fit_into_one_ring_of_the_bell() -> None:
    crowd = replace(FULL, tracks=FULL.tracks * 200, open_hazards=("01J" + "X" * 23,) * 300)
    assert len(json.dumps(crowd.words())) < 1 << 17


@pytest.mark.parametrize(
    ("cells", "share", "reason"),
    [
        ([WATCHED] * 10, 1.0, ""),
        ([WATCHED] * 9 + [BLURRED], 0.9, "blurred"),
        ([BLURRED, BEHIND_MACHINE, BEHIND_MACHINE, WATCHED], 0.25, "behind a machine"),
        ([NO_GROUND] * 3, 0.0, "outside the picture"),
        ([], 0.0, ""),
    ],
)
def test_a_zone_is_watched_by_the_share_of_its_places_and_the_commonest_reason_is_told(
    cells: list[int], share: float, reason: str
) -> None:
    assert share_watched("pit", np.array(cells, np.int8)) == WatchedZone("pit", share, reason)


@pytest.mark.parametrize(
    "rings",
    [
        [[0, 0], [6, 0], [6, 4], [0, 4]],
        [[0, 0], [100, 0], [100, 0.2], [0, 0.2]],
        [[0, 0], [30, 29], [30, 30], [0, 1]],
        [[0, 0], [1e-3, 0], [1e-3, 1e-3]],
    ],
)
def test_the_places_of_a_zone_are_in_it_or_are_its_corners(rings: list[list[float]]) -> None:
    ring = np.array(rings, np.float64)
    zone = Zone("pit", "no_go", [[ring]])
    places = zone_grid_m(zone)
    assert 3 <= len(places) <= 1000
    corners = {tuple(corner) for corner in ring.tolist()}
    assert all(
        inside or tuple(place) in corners for inside, place in zip(zone.contains(places), places.tolist(), strict=True)
    )


def test_places_outside_the_picture_are_no_ground() -> None:
    places = np.array([WORKER_M, (-1.0, 10.0), (64.5, 10.0), (20.0, 40.0)])
    assert ground_cells(ground(), watched(), (640, 360), places).tolist() == [WATCHED, NO_GROUND, NO_GROUND, NO_GROUND]
