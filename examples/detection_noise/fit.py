"""Fit `standoff.simulation.detection_noise` to what a detector finds on rendered clips.

    python examples/detection_noise/fit.py CLIP ... [--model site]

Prints a table as the module holds it, and how many truths and finds each row of it rests on.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq
from scipy.optimize import minimize
from scipy.special import logit

from standoff.core.boxes import areas_px2, shared_px2
from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff.simulation.detection_noise import GROUPS, ClassNoise, size_of
from standoff.stages.detect import OnnxDetector, find_model
from standoff.stages.frames import open_source

IntArray = npt.NDArray[np.int64]
Tracks = dict[tuple[str, int], list[tuple[float, FloatArray]]]

MATCH_IOU = 0.4
LEAST_PX = 16
"""Truths with fewer visible pixels are not looked for, as in the pictures the detector learned from."""
PRIOR = 0.05
"""Pull of slopes to zero: few truths are small and hidden."""


@dataclass
class Sample:
    """What was collected of one group of classes."""

    features: list[list[float]] = field(default_factory=list)
    found: list[bool] = field(default_factory=list)
    edges: list[FloatArray] = field(default_factory=list)
    sides: list[FloatArray] = field(default_factory=list)
    logits: list[float] = field(default_factory=list)
    found_features: list[list[float]] = field(default_factory=list)
    false_sizes: list[float] = field(default_factory=list)
    false_logits: list[float] = field(default_factory=list)


def collect(
    clip: Path,
    detector: OnnxDetector,
    samples: dict[str, Sample],
    tracks: Tracks,
) -> int:
    """Add one clip's truths and finds; return its number of frames."""
    rows = pq.read_table(clip / "truth.parquet").to_pylist()
    by_frame = defaultdict(list)
    for row in rows:
        if row["visible_px"] >= LEAST_PX:
            by_frame[row["frame"]].append(row)
    count = 0
    with open_source(clip / "video.mp4") as source:
        for frame in source:
            found = detector.detect(frame)
            truths = by_frame[frame.index]
            boxes = np.array([[row[f"{side}_px"] for side in ("x1", "y1", "x2", "y2")] for row in truths]).reshape(
                -1, 4
            )
            pairs = match(boxes, np.array([row["class_id"] for row in truths]), found.xyxy_px, found.class_id)
            for k, row in enumerate(truths):
                sample, sides = samples[GROUPS[row["class_name"]]], boxes[k, 2:] - boxes[k, :2]
                features = [1.0, size_of(sides), 1.0 - row["visible_share"]]
                sample.features.append(features)
                sample.found.append(k in pairs)
                if k in pairs:
                    outwards = (found.xyxy_px[pairs[k]] - boxes[k]) * [-1, -1, 1, 1]
                    sample.edges.append(outwards)
                    sample.sides.append(np.tile(sides, 2))
                    sample.logits.append(float(logit(np.clip(found.score[pairs[k]], 0.01, 0.999))))
                    sample.found_features.append(features)
                    tracks[clip.name, row["entity_id"]].append((frame.time_s, outwards / np.tile(sides, 2)))
            for k in set(range(len(found.score))) - set(pairs.values()):
                box = found.xyxy_px[k]
                sample = samples[GROUPS[CLASSES[found.class_id[k]].name]]
                sample.false_sizes.append(size_of(box[2:] - box[:2]))
                sample.false_logits.append(float(logit(np.clip(found.score[k], 0.01, 0.999))))
            count += 1
    return count


def match(truth_px: FloatArray, truth_class: IntArray, found_px: FloatArray, found_class: IntArray) -> dict[int, int]:
    """Pair truths with finds of their class, the largest overlap first."""
    shared = shared_px2(truth_px, found_px)
    overlap = shared / (areas_px2(truth_px)[:, None] + areas_px2(found_px)[None] - shared)
    overlap[truth_class[:, None] != found_class[None]] = 0.0
    pairs: dict[int, int] = {}
    for flat in np.argsort(-overlap, axis=None).tolist():
        k, j = divmod(flat, overlap.shape[1])
        if overlap[k, j] < MATCH_IOU:
            break
        if k not in pairs and j not in pairs.values():
            pairs[k] = j
    return pairs


def fit_odds(features: FloatArray, found: FloatArray) -> FloatArray:
    """Return the coefficients of a logistic regression with a weak prior on the slopes."""

    def loss(weights: FloatArray) -> float:
        odds = features @ weights
        return float(
            np.logaddexp(0.0, odds).sum() - odds @ found + PRIOR * len(found) ** 0.5 * (weights[1:] ** 2).sum()
        )

    return np.asarray(minimize(loss, np.zeros(features.shape[1])).x)


def fit_edges(edges: FloatArray, sides: FloatArray) -> tuple[FloatArray, float, float]:
    """Return bias of each side, and the share and px of the rest: maximum likelihood, outliers cut at 4 sigma."""
    bias = np.median(edges / sides, axis=0)
    rest = edges - bias * sides

    def loss(logs: FloatArray) -> float:
        sigma = np.hypot(np.exp(logs[0]) * sides, np.exp(logs[1]))
        return float((np.log(sigma) + 0.5 * np.minimum((rest / sigma) ** 2, 16.0)).sum())

    share, px = np.exp(minimize(loss, np.log([0.03, 1.0]), method="Nelder-Mead").x)
    return bias, float(share), float(px)


def fit_scores(features: FloatArray, logits: FloatArray) -> tuple[FloatArray, float]:
    """Return the coefficients of the scores' log odds, slopes pulled to zero a little, and their deviation."""
    pull = np.diag([0.0, 1.0, 1.0]) * PRIOR * len(logits) ** 0.5
    weights = np.linalg.solve(features.T @ features + pull, features.T @ logits)
    return weights, float(np.std(logits - features @ weights))


def memory_s(tracks: Tracks) -> float:
    """Return the time after which the correlation of one entity's edge errors falls to 1/e."""
    first, second, gaps = [], [], []
    for track in tracks.values():
        for (start_s, one), (stop_s, other) in pairwise(track):
            first.append(one)
            second.append(other)
            gaps.append(stop_s - start_s)
    pooled = np.concatenate([first, second])
    one, other = (np.clip((np.array(part) - np.median(pooled, axis=0)), -0.3, 0.3).ravel() for part in (first, second))
    kept = float(np.clip(np.corrcoef(one, other)[0, 1], 0.02, 0.98))
    return float(-np.median(gaps) / np.log(kept))


def summarised(sample: Sample, frames: int, classes: int) -> ClassNoise:
    """Return the row of the table for one group."""
    bias, share, px = fit_edges(np.array(sample.edges), np.array(sample.sides))
    scores, sigma = fit_scores(np.array(sample.found_features), np.array(sample.logits))
    found = fit_odds(np.array(sample.features), np.array(sample.found, float))
    sizes, logits = np.array(sample.false_sizes), np.array(sample.false_logits)
    if len(sizes) < 3:
        sizes, logits = np.append(sizes, [0.0, 1.0, 2.0]), np.append(logits, [-2.0, -1.5, -1.0])
    rounded = [tuple(np.round(part, 3).tolist()) for part in (found, bias, scores)]
    return ClassNoise(
        rounded[0], rounded[1], round(share, 4), round(px, 2), rounded[2], round(sigma, 2),
        round(max(len(sample.false_sizes), 0.5) / frames / classes, 4),
        (round(float(sizes.mean()), 2), round(float(sizes.std()), 2)),
        (round(float(logits.mean()), 2), round(float(logits.std()), 2)),
    )  # fmt: skip


def main() -> None:
    """Fit and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", nargs="+", type=Path)
    parser.add_argument("--model", default="site")
    arguments = parser.parse_args()
    detector = OnnxDetector(find_model(arguments.model))
    samples: dict[str, Sample] = {group: Sample() for group in dict.fromkeys(GROUPS.values())}
    tracks: Tracks = defaultdict(list)
    frames = sum(collect(clip, detector, samples, tracks) for clip in arguments.clips)
    print(f"# {frames} frames\nMEMORY_S = {memory_s(tracks):.2f}")
    for group, sample in samples.items():
        classes = list(GROUPS.values()).count(group)
        print(f"# {group}: {len(sample.found)} truths, {sum(sample.found)} found, {len(sample.false_sizes)} false")
        if sample.edges:
            print(f'"{group}": {summarised(sample, frames, classes)},')


if __name__ == "__main__":
    main()
