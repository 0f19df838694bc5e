"""Finds the outline where the paper's steps fail: low contrast, sand, planks, shadows.

Same input and same answer as the paper's steps, four differences. Thresholds follow the noise in the box, not
its strongest edge. Edge points are located between pixels and vote for lines across their gradient (`voting`).
Of all quadrilaterals that the candidate lines make, the one wins whose sides are covered with edge points
between the corners and bare beyond them, bright or dark side inwards all around. Its sides are refitted with
Tukey's biweight, away from the corners, which every lens rounds.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import cv2
import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import IntArray, NoGroundMap
from standoff.stages.ground.edges import Edges, Gradients
from standoff.stages.ground.lines import fit_line_robustly
from standoff.stages.ground.quadrilateral import NO_QUADRILATERAL, join_lines
from standoff.stages.ground.voting import agreeing, candidate_lines

RIVALS = "two outlines in the reference's box fit equally well"

_NOISE_HIGH, _NOISE_LOW = 3.5, 2.0
"""Canny's thresholds in medians of the gradient; of pure noise, one pixel in 5000 passes the upper one."""

_CANDIDATES = 12
_WALKS = np.array(
    [
        [four[k] for k in walk]
        for four in combinations(range(_CANDIDATES), 4)
        for walk in ((0, 1, 2, 3), (0, 1, 3, 2), (0, 2, 1, 3))
    ]
)
"""(1485, 4) every way to walk around four of the candidate lines."""

_COVER_PX, _COVER_COSINE = 1.5, 0.9
_MIN_SINE = 0.05
_MIN_COVERED = 0.2
_MIN_SIDE = 0.15
_OUTSIDE = 0.05
_BEYOND_FROM_PX, _BEYOND_TO_PX = 2.0, 10.0
_BARE_COST, _BEYOND_COST = 0.5, 2.0
_MIXED_POLARITY = 0.8
_RIVAL_SCORE, _RIVAL_APART_PX, _LOOKED_AT = 0.95, 4.0, 12
"""A different quadrilateral with 95 % of the best one's score makes the answer a guess: none is given."""

_REFIT_PX, _REFIT_TRIM_PX, _REFIT_ROUNDS, _TUKEY_ROUNDS = 2.0, 3.0, 2, 4
_MIN_SCATTER_PX = 0.1


def noise_thresholds(gradients: Gradients) -> tuple[float, float]:
    """Return Canny's upper and lower threshold, as fractions of the largest gradient, that follow the noise."""
    magnitude = cv2.magnitude(gradients.dx, gradients.dy)[1:-1, 1:-1]
    largest, median = float(magnitude.max()), float(np.median(magnitude[::2, ::2]))
    if largest == 0.0:
        return 0.6, 0.24
    return min(_NOISE_HIGH * median / largest, 0.6), min(_NOISE_LOW * median / largest, 0.24)


def oriented_lines(
    edges: Edges, box_xyxy_px: FloatArray, believable: Callable[[FloatArray], bool]
) -> FloatArray | NoGroundMap:
    """Return the reference's four sides, or why there are none.

    Args:
        edges: Of the box, located between pixels.
        box_xyxy_px: (4,) in the same pixels as the edges.
        believable: Whether (4, 2) corners, a pixel or two off, could be the reference.

    Returns:
        (4, 3) a, b, c; side k on line k, counter-clockwise as seen.
    """
    centre, size = (box_xyxy_px[:2] + box_xyxy_px[2:]) / 2.0, box_xyxy_px[2:] - box_xyxy_px[:2]
    points, direction = edges.points_px - centre, edges.direction
    candidates = candidate_lines(points, direction, _CANDIDATES)
    if len(candidates) < 4:
        return NoGroundMap(NO_QUADRILATERAL)
    chosen = _best_four(
        candidates, _covered_before(candidates, points, direction, size), size, lambda at: believable(at + centre)
    )
    if isinstance(chosen, NoGroundMap):
        return chosen
    lines = _refitted(candidates[chosen], points, direction)
    if lines is None:
        return NoGroundMap(NO_QUADRILATERAL)
    lines[:, 2] -= lines[:, :2] @ centre
    return lines


def _covered_before(lines: FloatArray, points: FloatArray, direction: FloatArray, size: FloatArray) -> FloatArray:
    """Return (M, 2 R + 1): pixels of each line with an edge point on them, counted from R px before its foot."""
    reach = int(np.hypot(*size)) + int(_BEYOND_TO_PX)
    covered = np.zeros((len(lines), 2 * reach), dtype=bool)
    for row, line in zip(covered, lines, strict=True):
        mine = points[agreeing(line, points, direction, _COVER_PX, _COVER_COSINE)]
        steps = np.floor(mine @ (-line[1], line[0])).astype(int) + reach
        row[steps[(steps >= 0) & (steps < 2 * reach)]] = True
    # A slanted edge has fewer pixels than its length: a hole of one between two hits is covered too.
    covered[:, 1:-1] |= covered[:, :-2] & covered[:, 2:]
    count: FloatArray = np.zeros((len(lines), 2 * reach + 1))
    np.cumsum(covered, axis=1, out=count[:, 1:])
    return count


def _crossings(lines: FloatArray, size: FloatArray) -> FloatArray:
    """Return (M, M, 2) where lines cross; NaN where nearly parallel or out of the box."""
    meet = np.cross(lines[:, None], lines[None])
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings: FloatArray = meet[..., :2] / meet[..., 2:]
    reach = size / 2.0 + _OUTSIDE * size.max()
    with np.errstate(invalid="ignore"):
        crossings[(np.abs(meet[..., 2]) < _MIN_SINE) | (np.abs(crossings) > reach).any(axis=-1)] = np.nan
    return crossings


def _best_four(
    lines: FloatArray, covered_before: FloatArray, size: FloatArray, believable: Callable[[FloatArray], bool]
) -> IntArray | NoGroundMap:
    """Return the indices of the four lines, in walking order, whose quadrilateral the edges support best."""
    walks = _WALKS[(len(lines) > _WALKS).all(axis=1)]
    corners = _crossings(lines, size)[np.roll(walks, 1, axis=1), walks]
    known = np.isfinite(corners).all(axis=(1, 2))
    walks, corners = walks[known], corners[known]
    sides = np.roll(corners, -1, axis=1) - corners
    before = np.roll(sides, 1, axis=1)
    turns = before[..., 0] * sides[..., 1] - before[..., 1] * sides[..., 0]
    convex = (turns > 0).all(axis=1) | (turns < 0).all(axis=1)
    # Walked clockwise, turn around: corner order 0, 3, 2, 1 lies on sides 3, 2, 1, 0.
    clockwise = convex & (turns > 0).all(axis=1)
    corners[clockwise] = corners[clockwise][:, [0, 3, 2, 1]]
    walks[clockwise] = walks[clockwise][:, [3, 2, 1, 0]]
    walks, corners = walks[convex], corners[convex]
    score = _scores(lines[walks], covered_before, walks, corners, size)
    return _first_believable(walks, corners, score, believable)


def _first_believable(
    walks: IntArray, corners: FloatArray, score: FloatArray, believable: Callable[[FloatArray], bool]
) -> IntArray | NoGroundMap:
    """Return the best walk whose corners can be believed, unless another one is as good."""
    ranking = [k for k in np.argsort(-score, kind="stable")[:_LOOKED_AT] if score[k] > 0]
    best = next((k for k in ranking if believable(corners[k])), None)
    if best is None:
        return NoGroundMap(NO_QUADRILATERAL)
    rivals = [k for k in ranking if k != best and score[k] >= _RIVAL_SCORE * score[best]]
    orders = np.array([np.roll(np.arange(4), turn) for turn in range(4)])
    apart = np.linalg.norm(corners[rivals][:, orders] - corners[best], axis=-1).max(axis=-1).min(axis=-1)
    if any(believable(corners[k]) for k, distance in zip(rivals, apart, strict=True) if distance > _RIVAL_APART_PX):
        return NoGroundMap(RIVALS)
    chosen: IntArray = walks[best]
    return chosen


def _scores(
    sides: FloatArray, covered_before: FloatArray, walks: IntArray, corners: FloatArray, size: FloatArray
) -> FloatArray:
    """Return (Q,) pixels of outline that edges support, less what is bare and what runs on beyond a corner."""
    along = np.stack([-sides[..., 1], sides[..., 0]], axis=-1)
    start, end = (corners * along).sum(axis=-1), (np.roll(corners, -1, axis=1) * along).sum(axis=-1)
    start, end = np.minimum(start, end), np.maximum(start, end)
    reach = covered_before.shape[1] // 2

    def covered(low: FloatArray, high: FloatArray) -> FloatArray:
        at = (np.clip(np.rint(edge).astype(int) + reach, 0, 2 * reach) for edge in (high, low))
        high_count, low_count = (covered_before[walks, index] for index in at)
        difference: FloatArray = high_count - low_count
        return difference

    length, on_side = end - start, covered(start, end)
    beyond = covered(start - _BEYOND_TO_PX, start - _BEYOND_FROM_PX) + covered(
        end + _BEYOND_FROM_PX, end + _BEYOND_TO_PX
    )
    score = (on_side - _BARE_COST * (length - on_side) - _BEYOND_COST * beyond).sum(axis=1)
    centre = corners.mean(axis=1)[:, None]
    bright_inside = (sides[..., :2] * centre).sum(axis=-1) + sides[..., 2] > 0
    mixed = bright_inside.any(axis=1) & ~bright_inside.all(axis=1)
    fill = np.prod(np.ptp(corners, axis=1) / size, axis=1)
    score = score * np.where(mixed, _MIXED_POLARITY, 1.0) * np.sqrt(np.minimum(fill, 1.0))
    hopeless = (length < _MIN_SIDE * size.min()).any(axis=1) | (on_side < _MIN_COVERED * length).any(axis=1)
    scores: FloatArray = np.where(hopeless, 0.0, score)
    return scores


def _refitted(lines: FloatArray, points: FloatArray, direction: FloatArray) -> FloatArray | None:
    for _ in range(_REFIT_ROUNDS):
        joined = join_lines(lines)
        if joined is None:
            return None
        corners, old = joined
        sides = zip(old, corners, np.roll(corners, -1, axis=0), strict=True)
        lines = np.array([_side_line(line, start, end, points, direction) for line, start, end in sides])
    joined = join_lines(lines)
    return None if joined is None else joined[1]


def _side_line(
    line: FloatArray, start: FloatArray, end: FloatArray, points: FloatArray, direction: FloatArray
) -> FloatArray:
    """Refit one side to the edge points between its corners."""
    length = float(np.linalg.norm(end - start))
    position = (points - start) @ (end - start) / length
    between = (position > _REFIT_TRIM_PX) & (position < length - _REFIT_TRIM_PX)
    mine = between & agreeing(line, points, direction, _REFIT_PX, _COVER_COSINE)
    return fit_line_robustly(line, points[mine], _TUKEY_ROUNDS, _MIN_SCATTER_PX) if mine.sum() >= 4 else line
