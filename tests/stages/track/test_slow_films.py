"""Films of few frames a second: whoever is seen is reported, and followed over the ground."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.types import Detections, GroundMap, NoCameraMotion, NoGroundMap
from standoff.stages.track import Tracker, TrackParams

STILL = NoCameraMotion("not estimated")
UNMAPPED = NoGroundMap("not looked for")
PX_PER_M = 40.0
WORKER, LOADER = CLASS_BY_NAME["worker"].id, CLASS_BY_NAME["wheel_loader"].id


def ground(shift_m: tuple[float, float] = (0.0, 0.0), site_frame: int = 0) -> GroundMap:
    """Return the map of a camera straight above that has moved by so much."""
    image_to_ground = np.array([[1 / PX_PER_M, 0.0, shift_m[0]], [0.0, 1 / PX_PER_M, shift_m[1]], [0.0, 0.0, 1.0]])
    return GroundMap(image_to_ground, np.zeros((9, 9)), (1920, 1080), "exact", 1 / PX_PER_M, site_frame=site_frame)


def seen(places_m: FloatArray, shift_m: tuple[float, float] = (0.0, 0.0), class_id: int = WORKER) -> Detections:
    """Return boxes 20 px wide and 30 px high that stand on places."""
    feet_px = (np.asarray(places_m).reshape(-1, 2) - shift_m) * PX_PER_M
    xyxy_px = np.column_stack([feet_px - np.array([10.0, 30.0]), feet_px + np.array([10.0, 0.0])])
    return Detections(xyxy_px, np.full(len(feet_px), 0.8), np.full(len(feet_px), class_id))


def test_whoever_is_seen_once_in_a_slow_film_is_reported_at_once() -> None:
    for step_s, reported in ((0.04, 0), (0.2, 0), (0.3, 1), (1.0, 1), (10.0, 1)):
        tracker = Tracker()
        tracker.update(0.0, Detections.empty(), STILL, UNMAPPED)
        tracker.update(step_s, Detections.empty(), STILL, UNMAPPED)
        assert len(tracker.update(2 * step_s, seen(np.array([[5.0, 5.0]])), STILL, UNMAPPED)) == reported


@given(
    speed_mps=st.floats(0.0, 3.0),
    angle=st.floats(0.0, 6.28),
    step_s=st.floats(0.5, 3.0),
    drift_mps=st.tuples(st.floats(-5, 5), st.floats(-5, 5)),
)
def test_a_walker_keeps_an_id_over_the_ground_however_the_camera_moves(
    speed_mps: float, angle: float, step_s: float, drift_mps: tuple[float, float]
) -> None:
    tracker = Tracker()
    for index in range(6):
        time_s = index * step_s
        place_m = 100.0 + speed_mps * time_s * np.array([np.cos(angle), np.sin(angle)])
        shift_m = drift_mps[0] * time_s, drift_mps[1] * time_s
        tracks = tracker.update(time_s, seen(place_m, shift_m), STILL, ground(shift_m))
        assert tracks.track_id.tolist() == [1]
        assert tracks.observed.all()


@pytest.mark.parametrize(("class_id", "speed_mps"), [(WORKER, 6.0), (LOADER, 11.0)])
def test_nobody_is_looked_for_out_of_reach(class_id: int, speed_mps: float) -> None:
    tracker = Tracker()
    for index in range(4):
        place_m = np.array([2.0 + speed_mps * index, 5.0])
        tracks = tracker.update(float(index), seen(place_m, class_id=class_id), STILL, ground())
    assert tracks.track_id.tolist() == [4]


def test_two_walkers_in_a_row_are_not_confused_once_their_pace_is_known() -> None:
    # Each comes to stand where the other one stood a second before.
    tracker = Tracker(TrackParams(min_overlap=0.9))
    places_m = [np.array([[1.5 * k, 5.0], [1.5 * k + 1.4, 5.0]]) for k in range(8)]
    tracker.update(0.0, seen(places_m[0]), STILL, ground())
    tracker.update(0.3, seen(places_m[0] + 0.3 * (places_m[1] - places_m[0])), STILL, ground())
    for k in range(1, 8):
        tracks = tracker.update(float(k), seen(places_m[k]), STILL, ground())
        assert tracks.track_id.tolist() == [1, 2]
        np.testing.assert_allclose(tracks.xyxy_px[:, 0] + 10.0, places_m[k][:, 0] * PX_PER_M, atol=0.3 * PX_PER_M)


def test_a_new_site_frame_or_no_map_joins_nothing_over_the_ground() -> None:
    for second, joined in ((ground(), True), (ground(site_frame=1), False), (UNMAPPED, False)):
        tracker = Tracker()
        tracker.update(0.0, seen(np.array([5.0, 5.0])), STILL, ground())
        tracks = tracker.update(1.0, seen(np.array([8.0, 5.0])), STILL, second)
        assert (1 in tracks.track_id[tracks.observed].tolist()) == joined
        assert tracks.observed.any()


def test_who_was_not_seen_at_the_last_look_is_not_looked_for_over_the_ground() -> None:
    tracker = Tracker()
    tracker.update(0.0, seen(np.array([5.0, 5.0])), STILL, ground())
    tracker.update(0.5, Detections.empty(), STILL, ground())
    tracks = tracker.update(1.0, seen(np.array([8.0, 5.0])), STILL, ground())
    assert 2 in tracks.track_id.tolist()
