"""The reference's contours: straight lines through edge points by RANSAC (paper, section 5.1).

A line is (a, b, c) with a x + b y + c = 0 and a^2 + b^2 = 1, in the pixels of the points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.compiled import compiled
from standoff.core.homography import FloatArray
from standoff.core.types import IntArray

CONTOURS = 4

TUKEY = 4.685
"""Tukey's biweight at 95 % efficiency for normal errors, in standard deviations."""


@dataclass(frozen=True, slots=True, eq=False)
class Contours:
    """Four lines in the order in which they were found.

    Attributes:
        lines: (4, 3) a, b, c of each.
        label: (N,) index of the line whose inlier each point is; -1: of none.
    """

    lines: FloatArray
    label: IntArray


def sample_pairs(iterations: int, seed: int) -> FloatArray:
    """Draw the hypotheses of all four contours, once for all frames: the same frame gives the same answer.

    Returns:
        (4, iterations, 2) uniform in [0, 1), to be scaled by the number of points that are left.
    """
    return np.random.default_rng(seed).random((CONTOURS, iterations, 2))


@compiled
def _most_supported_pair(x: FloatArray, y: FloatArray, pairs: FloatArray, inlier_px: float) -> tuple[int, int, int]:
    """Return the two points whose line has the most inliers, the first of equals, and how many."""
    count = len(x)
    best_i, best_j, best_votes = -1, -1, -1
    for k in range(len(pairs)):
        i = int(pairs[k, 0] * count)
        j = int(pairs[k, 1] * (count - 1))
        if j >= i:
            j += 1
        a = y[i] - y[j]
        b = x[j] - x[i]
        reach = inlier_px * np.sqrt(a * a + b * b)
        if reach == 0.0:
            continue
        c = -(a * x[i] + b * y[i])
        votes = 0
        for n in range(count):
            votes += abs(a * x[n] + b * y[n] + c) <= reach
        if votes > best_votes:
            best_i, best_j, best_votes = i, j, votes
    return best_i, best_j, best_votes


def line_through(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return (a, b, c) of the line through two different points.

    >>> line_through(np.array([0.0, 2.0]), np.array([5.0, 2.0])).tolist()
    [0.0, 1.0, -2.0]
    """
    a, b = first[1] - second[1], second[0] - first[0]
    line: FloatArray = np.array([a, b, -(a * first[0] + b * first[1])]) / np.hypot(a, b)
    return line


def ransac_contours(points_px: FloatArray, pairs: FloatArray, inlier_px: float) -> Contours | None:
    """Fit four lines one after another, each to the points that the lines before it left over.

    The line is the one through the two sampled points, as in the paper: no refit.

    Args:
        points_px: (N, 2) edge points.
        pairs: (4, iterations, 2) from `sample_pairs`.
        inlier_px: Largest distance from its line at which a point counts.

    Returns:
        The contours, or None if the points run out first.

    Source:
        Paper, section 5.1, line fitting: 2000 iterations a contour, inlier distance one pixel.
    """
    label = np.full(len(points_px), -1, dtype=np.int64)
    lines = np.empty((CONTOURS, 3))
    for contour in range(CONTOURS):
        left = np.flatnonzero(label < 0)
        if len(left) < 2:
            return None
        x, y = np.ascontiguousarray(points_px[left, 0]), np.ascontiguousarray(points_px[left, 1])
        i, j, votes = _most_supported_pair(x, y, pairs[contour], inlier_px)
        if votes < 2:
            return None
        lines[contour] = line_through(points_px[left[i]], points_px[left[j]])
        # The votes were counted with this very expression; the unit line could round a point in or out.
        a, b = y[i] - y[j], x[j] - x[i]
        distance = np.abs(a * x + b * y - (a * x[i] + b * y[i]))
        label[left[distance <= inlier_px * np.sqrt(a * a + b * b)]] = contour
    return Contours(lines, label)


@compiled
def fit_line(points_px: FloatArray, weights: FloatArray) -> FloatArray:
    """Fit a line by weighted total least squares.

    Args:
        points_px: (N, 2), N >= 2.
        weights: (N,), not all 0.

    Returns:
        (3,) a, b, c with b >= 0.
    """
    x, y = points_px[:, 0], points_px[:, 1]
    total = weights.sum()
    centre_x, centre_y = (weights * x).sum() / total, (weights * y).sum() / total
    x, y = x - centre_x, y - centre_y
    xx, xy, yy = (weights * x * x).sum(), (weights * x * y).sum(), (weights * y * y).sum()
    along = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    a, b = -np.sin(along), np.cos(along)
    return np.array([a, b, -(a * centre_x + b * centre_y)])


@compiled
def facing(line: FloatArray, other: FloatArray) -> FloatArray:
    """Return the line with its normal turned to the side that the other's points to."""
    return line if line[0] * other[0] + line[1] * other[1] >= 0 else -line


@compiled
def fit_line_robustly(line: FloatArray, points_px: FloatArray, rounds: int, min_scatter_px: float) -> FloatArray:
    """Refit a line by iterated total least squares with Tukey's biweight.

    Args:
        line: (3,) to start from; the result's normal points the same way.
        points_px: (N, 2), N >= 2.
        rounds: Iterations.
        min_scatter_px: The scatter, from the median distance, is taken to be at least this.
    """
    for _ in range(rounds):
        distance = points_px[:, 0] * line[0] + points_px[:, 1] * line[1] + line[2]
        scatter = max(1.4826 * np.median(np.abs(distance)), min_scatter_px)
        weights = np.maximum(1.0 - (distance / (TUKEY * scatter)) ** 2, 0.0) ** 2
        if weights.sum() < 3.0:
            break
        line = facing(fit_line(points_px, weights), line)
    return line


def refit(points_px: FloatArray, contours: Contours) -> Contours:
    """Replace each contour by the total-least-squares line through its inliers."""
    inliers = [points_px[contours.label == k] for k in range(CONTOURS)]
    return Contours(np.array([fit_line(points, np.ones(len(points))) for points in inliers]), contours.label)
