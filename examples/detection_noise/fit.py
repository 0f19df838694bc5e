"""Fit `standoff_sim.clip.detection_noise` to what a detector finds on rendered clips.

    python examples/detection_noise/fit.py CLIP ... [--model site]

Prints a table as the module holds it, and how many truths and finds each row of it rests on.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq
from scipy.optimize import minimize
from scipy.special import expit, logit, ndtri
from scipy.stats import multivariate_normal

from standoff.core.boxes import areas_px2, shared_px2
from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff.core.types import Detections, Frame
from standoff.stages.detect import OnnxDetector, find_model
from standoff.stages.frames import frame_from_array, open_source
from standoff_sim.clip.detection_noise import GROUPS, ClassNoise, size_of

IntArray = npt.NDArray[np.int64]
Tracks = dict[tuple[str, int], list[tuple[float, FloatArray]]]
Looks = dict[tuple[str, int], list[tuple[float, str, list[float], bool]]]

MATCH_IOU = 0.4
LEAST_PX = 16
"""Truths with fewer visible pixels are not looked for, as in the pictures the detector learned from."""
PRIOR = 0.05
"""Pull of the slopes to `USUAL_FOUND` and `USUAL_SCORE`: hidden truths that are large enough are few."""
USUAL_FOUND, USUAL_SCORE = np.array([0.0, 1.0, -3.0]), np.array([0.0, 0.5, -2.0])
"""More is found, and surer, of what is large and in full view; the first entry is free."""
TILES = (1, 2, 3)
"""Pictures are looked at as they are, and as tilings of themselves: everything is as small as from further away."""
LAGS_S = (0.2, 1.0, 3.0)
"""How much later it is looked whether who was missed is missed still."""
SIDES = ("x1_px", "y1_px", "x2_px", "y2_px")


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


class Collector:
    """Compares what a detector finds with what is true.

    Attributes:
        samples: By group of classes.
        tracks: Edge errors of each entity of each clip, as shares of its sides, with their times.
        looks: Whether each entity of each clip was found, with its time, its group and its features.
        frames: Number of frames.
    """

    def __init__(self, detector: OnnxDetector) -> None:
        self._detector = detector
        self.samples = {group: Sample() for group in dict.fromkeys(GROUPS.values())}
        self.tracks: Tracks = defaultdict(list)
        self.looks: Looks = defaultdict(list)
        self.frames = 0

    def add(self, clip: Path) -> None:
        """Look at a clip's frames in every tiling."""
        by_frame = defaultdict(list)
        for row in pq.read_table(clip / "truth.parquet").to_pylist():
            if row["visible_px"]:
                by_frame[row["frame"]].append(row)
        with open_source(clip / "video.mp4") as source:
            for frame in source:
                self.frames += 1
                for tiles in TILES:
                    truths = [row for row in by_frame[frame.index] if row["visible_px"] >= LEAST_PX * tiles**2]
                    self._compare(frame, truths, tiles, clip.name)

    def _compare(self, frame: Frame, truths: list[dict[str, Any]], tiles: int, clip: str) -> None:
        small = cv2.resize(frame.image, None, fx=1 / tiles, fy=1 / tiles, interpolation=cv2.INTER_AREA)
        tiled = frame_from_array(np.tile(small, (tiles, tiles, 1)), index=frame.index, time_s=frame.time_s)
        found = self._detector.detect(tiled)
        boxes_px = np.array([[row[side] for side in SIDES] for row in truths]).reshape(-1, 4)
        boxes_px = (boxes_px + 0.5) / tiles - 0.5
        # one tile stands for all: those on the diagonal lie differently to the network's grid
        for k in range(tiles):
            offset = k * np.tile([small.shape[1], small.shape[0]], 2)
            classes = np.array([row["class_id"] for row in truths])
            pairs = match(boxes_px + offset, classes, found.xyxy_px, found.class_id)
            for number, row in enumerate(truths):
                find = pairs.get(number)
                box_px = None if find is None else found.xyxy_px[find] - offset
                score = 0.0 if find is None else float(found.score[find])
                entity = (clip, row["entity_id"]) if tiles == 1 else None
                self._add_truth(row, boxes_px[number], box_px, score, entity, frame.time_s)
            if tiles == 1:
                self._add_false(found[~np.isin(np.arange(len(found.score)), list(pairs.values()))])

    def _add_truth(
        self, row: dict[str, Any], truth_px: FloatArray, found_px: FloatArray | None, score: float,
        entity: tuple[str, int] | None, time_s: float,
    ) -> None:  # fmt: skip
        group = GROUPS[row["class_name"]]
        sample, sides_px = self.samples[group], truth_px[2:] - truth_px[:2]
        features = [1.0, size_of(sides_px), 1.0 - row["visible_share"]]
        sample.features.append(features)
        sample.found.append(found_px is not None)
        if entity is not None:
            self.looks[entity].append((time_s, group, features, found_px is not None))
        if found_px is None:
            return
        outwards_px = (found_px - truth_px) * [-1, -1, 1, 1]
        sample.edges.append(outwards_px)
        sample.sides.append(np.tile(sides_px, 2))
        sample.logits.append(log_odds(score))
        sample.found_features.append(features)
        if entity is not None:
            self.tracks[entity].append((time_s, outwards_px / np.tile(sides_px, 2)))

    def _add_false(self, false: Detections) -> None:
        for box_px, score, class_id in zip(false.xyxy_px, false.score, false.class_id, strict=True):
            sample = self.samples[GROUPS[CLASSES[class_id].name]]
            sample.false_sizes.append(size_of(box_px[2:] - box_px[:2]))
            sample.false_logits.append(log_odds(score))


def log_odds(score: float) -> float:
    """Return the log odds of a score, those of 0 and 1 kept finite."""
    return float(logit(np.clip(score, 0.01, 0.999)))


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
    """Return the coefficients of a logistic regression whose slopes are pulled to the usual ones."""

    def loss(weights: FloatArray) -> float:
        odds = features @ weights
        pull = PRIOR * len(found) ** 0.5 * ((weights - USUAL_FOUND)[1:] ** 2).sum() + 1e-3 * weights[0] ** 2
        return float(np.logaddexp(0.0, odds).sum() - odds @ found + pull)

    limits = [(None, None), (0.0, None), (None, 0.0)]
    return np.asarray(minimize(loss, USUAL_FOUND, method="L-BFGS-B", bounds=limits).x)


def fit_edges(edges: FloatArray, sides: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return bias and share of each edge, and px of all: maximum likelihood, outliers cut at 4 sigma."""
    bias = np.median(edges / sides, axis=0)
    rest = edges - bias * sides

    def loss(logs: FloatArray) -> float:
        sigma = np.hypot(np.exp(logs[:4]) * sides, np.exp(logs[4]))
        return float((np.log(sigma) + 0.5 * np.minimum((rest / sigma) ** 2, 16.0)).sum())

    start, limits = np.log([0.05] * 4 + [1.0]), [(np.log(0.003), np.log(0.5))] * 4 + [(np.log(0.2), np.log(8.0))]
    logs = minimize(loss, start, method="L-BFGS-B", bounds=limits).x
    return bias, np.exp(logs[:4]), float(np.exp(logs[4]))


def fit_scores(features: FloatArray, logits: FloatArray) -> tuple[FloatArray, float]:
    """Return the coefficients of the scores' log odds, slopes pulled to the usual ones, and their deviation."""
    pull = np.diag([0.0, 1.0, 1.0]) * PRIOR * len(logits) ** 0.5
    weights = np.linalg.solve(features.T @ features + pull, features.T @ logits + pull @ USUAL_SCORE)
    if weights[2] > 0.0:
        weights = np.append(np.linalg.lstsq(features[:, :2], logits, rcond=None)[0], 0.0)
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


def miss_memory_s(looks: Looks, odds: dict[str, FloatArray]) -> float:
    """Return the time after which a miss is forgotten to 1/e, by what is found again `LAGS_S` later.

    Args:
        looks: Of each entity.
        odds: By group, coefficients of the log odds of being found.
    """
    limits, found, gaps_s = [], [], []
    for entity in looks.values():
        for row, (time_s, group, features, is_found) in enumerate(entity):
            for later_s, _, later_features, is_found_later in entity[row + 1 :]:
                if any(abs(later_s - time_s - lag_s) < 0.05 for lag_s in LAGS_S):
                    limits.append(np.clip(np.array([features, later_features]) @ odds[group], -6.0, 6.0))
                    found.append((is_found, is_found_later))
                    gaps_s.append(round(later_s - time_s, 1))
    limit, seen, gap_s = ndtri(expit(np.array(limits))), np.array(found), np.array(gaps_s)

    def likelihood(memory_s: float) -> float:
        total = 0.0
        for lag_s in np.unique(gap_s):
            rows, kept = gap_s == lag_s, np.exp(-lag_s / memory_s)
            # Whoever is missed is beyond the limit: the other side of it.
            side = np.where(seen[rows], 1.0, -1.0)
            alike = kept * side.prod(axis=1)
            for sign in (-1.0, 1.0):
                of = np.sign(alike) == sign
                if of.any():
                    covariance = [[1.0, sign * kept], [sign * kept, 1.0]]
                    chance = multivariate_normal(cov=covariance).cdf((limit[rows] * side)[of])
                    total += float(np.log(np.maximum(chance, 1e-6)).sum())
        return total

    return float(max(np.geomspace(0.1, 100.0, 31), key=likelihood))


def summarised(sample: Sample, found: FloatArray, frames: int, classes: int) -> ClassNoise:
    """Return the row of the table for one group, whose coefficients of being found are known."""
    bias, shares, px = fit_edges(np.array(sample.edges), np.array(sample.sides))
    scores, sigma = fit_scores(np.array(sample.found_features), np.array(sample.logits))
    sizes, logits = np.array(sample.false_sizes), np.array(sample.false_logits)
    if len(sizes) < 3:
        sizes, logits = np.append(sizes, [0.0, 1.0, 2.0]), np.append(logits, [-2.0, -1.5, -1.0])
    rounded = [tuple(np.round(part, 3).tolist()) for part in (found, bias, shares, scores)]
    return ClassNoise(
        rounded[0], rounded[1], rounded[2], round(px, 2), rounded[3], round(sigma, 2),
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
    collector = Collector(OnnxDetector(find_model(arguments.model)))
    for clip in arguments.clips:
        collector.add(clip)
    print(f"# {collector.frames} frames\nMEMORY_S = {memory_s(collector.tracks):.2f}")
    odds = {
        group: fit_odds(np.array(sample.features), np.array(sample.found, float))
        for group, sample in collector.samples.items()
        if sample.found
    }
    print(f"MISS_MEMORY_S = {miss_memory_s(collector.looks, odds):.2f}")
    for group, sample in collector.samples.items():
        classes = list(GROUPS.values()).count(group)
        print(f"# {group}: {len(sample.found)} truths, {sum(sample.found)} found, {len(sample.false_sizes)} false")
        if sample.edges:
            print(f'"{group}": {summarised(sample, odds[group], collector.frames, classes)},')


if __name__ == "__main__":
    main()
