"""The tracker beside the `trackers` package's ByteTrack: the same boxes into both, scored by trackeval."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
import tolerances

from standoff.core.boxes import overlaps
from standoff.core.homography import FloatArray
from standoff.core.types import Detections, IntArray, NoCameraMotion, NoGroundMap
from standoff.stages.track import Tracker, TrackParams

STILL = NoCameraMotion("not estimated")
UNMAPPED = NoGroundMap("not looked for")

trackers = pytest.importorskip("trackers", reason="the peer is not installed: pip install --no-deps trackers")
supervision = pytest.importorskip("supervision", reason="the peer's boxes are not installed: pip install supervision")
trackeval = pytest.importorskip("trackeval", reason="the scorer is not installed: pip install trackeval")

pytestmark = pytest.mark.shared

FRAMES_PER_S = 10.0
SEEDS = range(12)
STRETCHES = ((1, 219), (388, 554))
"""First and last frame of what is completely labelled."""
REAL_STRETCH = (430, 500)
"""All labels are to be scored here, and people cross; the whole stretch would take OpenCV a minute."""
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
        left_top = rng.uniform((0.0, 0.0), (730.0, 500.0), (rng.poisson(0.3), 2))
        clutter = np.column_stack([left_top, left_top + np.array([30.0, 75.0])])
        seen.append(
            Detections(
                np.concatenate([boxes, clutter]),
                np.concatenate([scores, rng.uniform(0.15, 0.7, len(clutter))]),
                np.zeros(len(boxes) + len(clutter), np.int64),
            )
        )
    return seen


def detect_people(shared_data: Path, first: int, last: int) -> list[Detections]:
    """Run the shared COCO weights through OpenCV's Darknet importer."""
    weights = shared_data / "weights" / "yolo-fastest-1.1-xl" / "yolo-fastest-1.1-xl.weights"
    net = cv2.dnn.readNetFromDarknet(str(weights.with_suffix(".cfg")), str(weights))
    video = cv2.VideoCapture(str(shared_data / "pets2009" / "vtest.avi"))
    seen = []
    for frame in range(1, last + 1):
        _, image = video.read()
        if frame < first:
            continue
        size = np.array([image.shape[1], image.shape[0]] * 2)
        net.setInput(cv2.dnn.blobFromImage(image, 1 / 255, (768, 576), swapRB=True))
        rows = np.concatenate([head.reshape(-1, 85) for head in net.forward(net.getUnconnectedOutLayersNames())])
        rows = rows[rows[:, 5] > 0.1]
        boxes = np.concatenate([rows[:, :2] - rows[:, 2:4] / 2, rows[:, :2] + rows[:, 2:4] / 2], axis=1) * size
        xywh = np.concatenate([boxes[:, :2], boxes[:, 2:] - boxes[:, :2]], axis=1)
        kept = np.array(cv2.dnn.NMSBoxes(xywh.tolist(), rows[:, 5].tolist(), 0.1, 0.45), dtype=np.int64)
        seen.append(Detections(boxes[kept], rows[kept, 5], np.zeros(len(kept), np.int64)))
    return seen


def follow(seen: Sequence[Detections]) -> list[Seen]:
    tracker = Tracker()
    tracks = [
        tracker.update(index / FRAMES_PER_S, detections, STILL, UNMAPPED) for index, detections in enumerate(seen)
    ]
    return [(frame.track_id[frame.observed], frame.xyxy_px[frame.observed]) for frame in tracks]


def follow_with_peer(seen: Sequence[Detections]) -> list[Seen]:
    params = TrackParams()
    peer = trackers.ByteTrackTracker(
        lost_track_buffer=round(30 * params.max_lost_s),
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


@pytest.mark.live
def test_ids_hold_no_worse_than_the_peers_on_simulated_detections(shared_data: Path) -> None:
    ours, peers = [], []
    for first, last in STRETCHES:
        truth = read_truth(shared_data, first, last)
        for seed in SEEDS:
            seen = imagine_detector(truth, seed)
            ours.append(score(truth, follow(seen)))
            peers.append(score(truth, follow_with_peer(seen)))
    (idf1, switches), (peer_idf1, peer_switches) = np.sum(ours, axis=0), np.sum(peers, axis=0)
    assert idf1 >= peer_idf1
    assert switches <= peer_switches


@pytest.mark.live
def test_ids_hold_no_worse_than_the_peers_on_a_real_detector(shared_data: Path) -> None:
    first, last = REAL_STRETCH
    truth = read_truth(shared_data, first, last)
    seen = detect_people(shared_data, first, last)
    idf1, switches = score(truth, follow(seen))
    peer_idf1, peer_switches = score(truth, follow_with_peer(seen))
    assert idf1 >= peer_idf1
    assert switches <= peer_switches


def test_overlaps_agree_with_the_peers() -> None:
    rng = np.random.default_rng(1)
    corners = rng.uniform(0.0, 80.0, (2, 40, 2))
    first, second = np.concatenate([corners, corners + rng.uniform(1.0, 50.0, (2, 40, 2))], axis=2)
    expected = supervision.box_iou_batch(first, second)
    assert overlaps(first, second) == pytest.approx(expected, abs=tolerances.PEER_OVERLAP)
