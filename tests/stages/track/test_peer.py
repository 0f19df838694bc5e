"""The tracker beside the `trackers` package's ByteTrack: the same boxes into both, scored by trackeval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from standoff.core.homography import FloatArray
from standoff.core.types import Detections, IntArray
from standoff.stages.track import Tracker, TrackParams
from standoff.stages.track.association import overlaps

trackers = pytest.importorskip("trackers", reason="the peer is not installed: pip install --no-deps trackers")
supervision = pytest.importorskip("supervision", reason="the peer's boxes are not installed: pip install supervision")
trackeval = pytest.importorskip("trackeval", reason="the scorer is not installed: pip install trackeval")

pytestmark = pytest.mark.shared

FRAMES_PER_S = 10.0
SEEDS = range(6)
Seen = tuple[IntArray, FloatArray]
"""Ids (N,) and boxes (N, 4) of one frame."""


def read_truth(shared_data: Path, first: int, last: int) -> list[Seen]:
    rows = np.genfromtxt(shared_data / "pets2009" / "gt.csv", delimiter=",", names=True)
    frames = [rows[rows["frame"] == frame] for frame in range(first, last + 1)]
    return [
        (row["id"].astype(np.int64), np.column_stack([row["x"], row["y"], row["x"] + row["w"], row["y"] + row["h"]]))
        for row in frames
    ]


def imagine_detector(truth: Sequence[Seen], seed: int) -> list[Detections]:
    """Blur, lose and doubt the true boxes, and add clutter, as a detector does."""
    rng = np.random.default_rng(seed)
    seen = []
    for _, boxes in truth:
        boxes = boxes[rng.random(len(boxes)) > 0.1]
        sides = np.tile(boxes[:, 2:] - boxes[:, :2], 2)
        boxes = boxes + rng.normal(0.0, 0.04, boxes.shape) * sides
        doubtful = rng.random(len(boxes)) < 0.15
        scores = np.where(doubtful, rng.uniform(0.15, 0.4, len(boxes)), rng.uniform(0.65, 0.95, len(boxes)))
        corner = rng.uniform((0.0, 0.0), (730.0, 500.0), (rng.poisson(0.3), 2))
        clutter = np.column_stack([corner, corner + (30.0, 75.0)])
        seen.append(
            Detections(
                np.concatenate([boxes, clutter]),
                np.concatenate([scores, rng.uniform(0.15, 0.7, len(clutter))]),
                np.zeros(len(boxes) + len(clutter), np.int64),
            )
        )
    return seen


def follow(seen: Sequence[Detections]) -> list[Seen]:
    tracker = Tracker()
    tracks = [tracker.update(index / FRAMES_PER_S, detections) for index, detections in enumerate(seen)]
    return [(frame.track_id[frame.observed], frame.xyxy_px[frame.observed]) for frame in tracks]


def follow_with_peer(seen: Sequence[Detections]) -> list[Seen]:
    params = TrackParams()
    peer = trackers.ByteTrackTracker(
        lost_track_buffer=round(30 * params.max_coast_s),
        frame_rate=FRAMES_PER_S,
        track_activation_threshold=params.start_score,
        minimum_consecutive_frames=params.confirm_hits,
        high_conf_det_threshold=params.high_score,
    )
    result = []
    for boxes in seen:
        boxes = boxes[boxes.score >= params.low_score]
        tracks = peer.update(supervision.Detections(boxes.xyxy_px, confidence=boxes.score, class_id=boxes.class_id))
        followed = tracks.tracker_id >= 0
        result.append((tracks.tracker_id[followed].astype(np.int64), tracks.xyxy[followed]))
    return result


def score(truth: Sequence[Seen], tracks: Sequence[Seen]) -> tuple[float, int]:
    """Return IDF1 and the number of id switches by trackeval."""

    def renumbered(frames: Sequence[Seen]) -> tuple[list[IntArray], int]:
        ids = np.unique(np.concatenate([frame[0] for frame in frames]))
        return [np.searchsorted(ids, frame[0]) for frame in frames], len(ids)

    gt_ids, num_gt_ids = renumbered(truth)
    tracker_ids, num_tracker_ids = renumbered(tracks)
    data = {
        "gt_ids": gt_ids,
        "tracker_ids": tracker_ids,
        "num_gt_ids": num_gt_ids,
        "num_tracker_ids": num_tracker_ids,
        "num_gt_dets": sum(map(len, gt_ids)),
        "num_tracker_dets": sum(map(len, tracker_ids)),
        "num_timesteps": len(truth),
        "similarity_scores": [overlaps(true[1], track[1]) for true, track in zip(truth, tracks, strict=True)],
    }
    identity = trackeval.metrics.Identity({"PRINT_CONFIG": False}).eval_sequence(data)
    clear = trackeval.metrics.CLEAR({"PRINT_CONFIG": False}).eval_sequence(data)
    return float(identity["IDF1"]), int(clear["IDSW"])


