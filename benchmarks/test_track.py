"""Milliseconds per frame of the tracker with 30 entities, beside the `trackers` package's ByteTrack in the same run."""

from __future__ import annotations

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from standoff.core.types import Detections, NoCameraMotion, NoGroundMap
from standoff.stages.track import Tracker, TrackParams

STILL = NoCameraMotion("not estimated")
UNMAPPED = NoGroundMap("not looked for")

ENTITIES = 30
FRAMES = 200
FRAMES_PER_S = 25.0


def walking_crowd() -> list[Detections]:
    rng = np.random.default_rng(0)
    start_px = rng.uniform((0.0, 0.0), (1900.0, 1000.0), (ENTITIES, 2))
    velocity_px_s = rng.normal(0.0, 40.0, (ENTITIES, 2))
    frames = []
    for index in range(FRAMES):
        left_top = start_px + velocity_px_s * index / FRAMES_PER_S
        boxes = np.concatenate([left_top, left_top + np.array([30.0, 75.0])], axis=1)
        boxes += rng.normal(0.0, 1.0, boxes.shape)
        seen = rng.random(ENTITIES) < 0.95
        frames.append(
            Detections(boxes, rng.uniform(0.3, 1.0, ENTITIES), np.zeros(ENTITIES, np.int64))[seen],
        )
    return frames


@pytest.mark.benchmark(group="track, 30 entities, 200 frames")
def test_standoff(benchmark: BenchmarkFixture) -> None:
    frames = walking_crowd()

    def follow() -> int:
        tracker = Tracker()
        return sum(
            len(tracker.update(index / FRAMES_PER_S, seen, STILL, UNMAPPED)) for index, seen in enumerate(frames)
        )

    assert benchmark(follow) > 0.9 * ENTITIES * FRAMES


@pytest.mark.benchmark(group="track, 30 entities, 200 frames")
def test_peer_byte_track(benchmark: BenchmarkFixture) -> None:
    trackers = pytest.importorskip("trackers", reason="the peer is not installed: pip install --no-deps trackers")
    supervision = pytest.importorskip("supervision", reason="the peer's boxes are not installed")
    params = TrackParams()
    frames = [
        supervision.Detections(seen.xyxy_px, confidence=seen.score, class_id=seen.class_id) for seen in walking_crowd()
    ]

    def follow() -> int:
        peer = trackers.ByteTrackTracker(
            lost_track_buffer=round(30 * params.max_lost_s),
            frame_rate=FRAMES_PER_S,
            track_activation_threshold=params.start_score,
            high_conf_det_threshold=params.high_score,
        )
        return sum(int((peer.update(seen).tracker_id >= 0).sum()) for seen in frames)

    assert benchmark(follow) > 0.8 * ENTITIES * FRAMES
