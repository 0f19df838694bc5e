"""The reference test of the rectification: how often and how well are exactly known corners found, how fast?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import NoGroundMap
from standoff.evaluation.drawn_quadrilaterals import DIFFICULTIES, Difficulty, DrawnQuadrilateral, draw_quadrilateral
from standoff.stages.ground import (
    Edges,
    OutlineFinder,
    Quadrilateral,
    ReferenceMethod,
    ReferenceParams,
    canny,
    line_through,
    ransac_contours,
    sample_pairs,
    sobel_gradients,
)

METHODS: tuple[ReferenceMethod, ...] = ("paper", "paper+tls", "oriented")
FAILURE_PX = 5.0
_TIMED_SCENES = 5
_TIMED_ROUNDS = 5


@dataclass(frozen=True, slots=True)
class MethodScore:
    """One method on one class of pictures.

    Attributes:
        method: Option of `ReferenceParams.method`.
        difficulty: "clean", "sand" or "hard".
        failed_percent: Scenes without an answer, or with a corner more than 5 px off.
        wrong_percent: The latter alone: answers that are believed and should not be.
        corner_rmse_px: Root mean squared distance of all corners of the other scenes from the truth; NaN if none.
        error_per_sigma: Root mean squared error of a coordinate in its stated standard errors; 1 is honest.
        median_ms: Of one picture: edges, lines, corners.
    """

    method: ReferenceMethod
    difficulty: Difficulty
    failed_percent: float
    wrong_percent: float
    corner_rmse_px: float
    error_per_sigma: float
    median_ms: float


@dataclass(frozen=True, slots=True)
class RectificationResult:
    """The whole test.

    Attributes:
        scenes: Of each class.
        seed: Of the scenes.
        scores: One for each method and class.
        ransac_ms: Four contours of 2000 hypotheses, median over the first clean scenes.
        loop_ms: The same hypotheses by `ransac_by_loop`, in the same run.
        same_lines: Whether both found exactly the same lines everywhere.
    """

    scenes: int
    seed: int
    scores: tuple[MethodScore, ...]
    ransac_ms: float
    loop_ms: float
    same_lines: bool

    @property
    def speed_up(self) -> float:
        """How many times faster the RANSAC is than the loop."""
        return self.loop_ms / self.ransac_ms

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers, strings and lists; None where nothing was found to measure."""
        scores = [
            {name: None if value != value else value for name, value in asdict(score).items()} for score in self.scores
        ]
        return {**asdict(self), "scores": scores, "speed_up": self.speed_up}


def evaluate_rectification(
    scenes: int = 300, seed: int = 0, methods: Sequence[ReferenceMethod] = METHODS
) -> RectificationResult:
    """Run every method on drawn quadrilaterals of every class.

    Args:
        scenes: Number of pictures of each class.
        seed: Another seed, other pictures.
        methods: Options of `ReferenceParams.method`.
    """
    if scenes < 1:
        raise ValueError(f"scenes must be 1 or more, not {scenes}")
    scores: list[MethodScore] = []
    finders = {method: OutlineFinder(ReferenceParams(method=method)) for method in methods}
    timed = [draw_quadrilateral("clean", seed, index) for index in range(min(scenes, _TIMED_SCENES))]
    for finder in finders.values():
        finder.find(timed[0].gray, timed[0].box_xyxy_px)  # compiles
    for difficulty in DIFFICULTIES:
        drawn = [draw_quadrilateral(difficulty, seed, index) for index in range(scenes)]
        scores.extend(_score(finder, difficulty, drawn) for finder in finders.values())
    fast_ms, loop_ms, same_lines = time_ransac(timed)
    scores.sort(key=lambda score: list(methods).index(score.method))
    return RectificationResult(scenes, seed, tuple(scores), median(fast_ms), median(loop_ms), same_lines)


def _score(finder: OutlineFinder, difficulty: Difficulty, scenes: Sequence[DrawnQuadrilateral]) -> MethodScore:
    milliseconds: list[float] = []
    squared_px: list[float] = []
    squared_sigmas: list[float] = []
    missing = wrong = 0
    for scene in scenes:
        start = perf_counter()
        outline = finder.find(scene.gray, scene.box_xyxy_px)
        milliseconds.append((perf_counter() - start) * 1e3)
        if isinstance(outline, NoGroundMap):
            missing += 1
            continue
        errors, covariance = corner_errors(outline, scene.corners_px)
        if np.linalg.norm(errors, axis=1).max() > FAILURE_PX:
            wrong += 1
            continue
        squared_px.append(float((errors**2).sum(axis=1).mean()))
        squared_sigmas.append(float(np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariance), errors).mean() / 2.0))
    return MethodScore(
        method=finder.params.method,
        difficulty=difficulty,
        failed_percent=100.0 * (missing + wrong) / len(scenes),
        wrong_percent=100.0 * wrong / len(scenes),
        corner_rmse_px=_root_mean(squared_px),
        error_per_sigma=_root_mean(squared_sigmas),
        median_ms=median(milliseconds),
    )


def _root_mean(squares: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(squares))) if squares else float("nan")


def corner_errors(outline: Quadrilateral, truth_px: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return found minus true corners and their covariance, in the cyclic order that suits best.

    Args:
        outline: As found.
        truth_px: (4, 2) counter-clockwise as seen.

    Returns:
        (4, 2) px and (4, 2, 2) px squared.
    """
    orders = [np.roll(np.arange(4), turn) for turn in range(4)]
    order = min(orders, key=lambda by: float(((outline.corners_px[by] - truth_px) ** 2).sum()))
    return outline.corners_px[order] - truth_px, outline.covariance_px2[order]


def ransac_by_loop(points_px: FloatArray, pairs: FloatArray, inlier_px: float) -> FloatArray:
    """Fit the four contours as the paper describes it: the baseline that `ransac_contours` is timed against.

    A Python loop over the hypotheses; numpy counts the inliers of each.

    Args:
        points_px: (N, 2) edge points.
        pairs: (4, iterations, 2) from `sample_pairs`.
        inlier_px: Inlier distance.

    Returns:
        (4, 3) lines a, b, c.
    """
    lines = []
    left = points_px
    for hypotheses in pairs:
        x, y = left[:, 0].copy(), left[:, 1].copy()
        most, best, best_inliers = -1, (0, 0), np.zeros(len(left), dtype=bool)
        for u, v in hypotheses:
            i, j = int(u * len(left)), int(v * (len(left) - 1))
            j += j >= i
            a, b = y[i] - y[j], x[j] - x[i]
            c = -(a * x[i] + b * y[i])
            inliers = np.abs(a * x + b * y + c) <= inlier_px * np.sqrt(a * a + b * b)
            votes = int(np.count_nonzero(inliers))
            if votes > most:
                most, best, best_inliers = votes, (i, j), inliers
        lines.append(line_through(left[best[0]], left[best[1]]))
        left = left[~best_inliers]
    return np.array(lines)


def time_ransac(scenes: Sequence[DrawnQuadrilateral]) -> tuple[list[float], list[float], bool]:
    """Return milliseconds of the RANSAC and of the same hypotheses by a Python loop, and whether both agree exactly."""
    params = ReferenceParams(method="paper")
    pairs = sample_pairs(params.iterations, params.seed)
    fast_ms: list[float] = []
    loop_ms: list[float] = []
    same_lines = True
    for scene in scenes:
        points = paper_edges(scene).points_px
        for _ in range(_TIMED_ROUNDS):
            start = perf_counter()
            contours = ransac_contours(points, pairs, params.inlier_px)
            fast_ms.append((perf_counter() - start) * 1e3)
        start = perf_counter()
        lines = ransac_by_loop(points, pairs, params.inlier_px)
        loop_ms.append((perf_counter() - start) * 1e3)
        same_lines &= contours is not None and bool((contours.lines == lines).all())
    return fast_ms, loop_ms, same_lines


def paper_edges(scene: DrawnQuadrilateral) -> Edges:
    """Return the paper's edge points of a drawn scene."""
    params = ReferenceParams(method="paper")
    gradients = sobel_gradients(scene.gray, scene.box_xyxy_px)
    assert gradients is not None, "a drawn scene's box lies in its picture"
    return canny(gradients, params.high_threshold, params.low_threshold)
