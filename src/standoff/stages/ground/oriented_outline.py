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

from standoff.core.compiled import compiled
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray, NoGroundMap
from standoff.stages.ground.edges import Edges, Gradients
from standoff.stages.ground.lines import fit_line_robustly
from standoff.stages.ground.quadrilateral import NO_QUADRILATERAL, ORDERS, WALKS, crossings, join_lines, walk_around
from standoff.stages.ground.voting import agreeing, candidate_lines

RIVALS = "two outlines in the reference's box fit equally well"

_NOISE_HIGH, _NOISE_LOW = 3.5, 2.0
"""Canny's thresholds in medians of the gradient; of pure noise, one pixel in 5000 passes the upper one."""

_CANDIDATES = 12
_WALKS = np.array([[four[k] for k in walk] for four in combinations(range(_CANDIDATES), 4) for walk in WALKS])
"""(1485, 4) every way to walk around four of the candidate lines."""

_COVER_PX, _COVER_COSINE = 1.5, 0.9
_MIN_COVERED = 0.2
_MIN_SIDE = 0.15
_OUTSIDE = 0.05
_BEYOND_FROM_PX, _BEYOND_TO_PX = 2.0, 10.0
_BARE_COST, _BEYOND_COST = 0.5, 2.0
_MIXED_POLARITY = 0.8
_RIVAL_SCORE, _RIVAL_APART_PX, _LOOKED_AT = 0.95, 4.0, 12
"""A different quadrilateral with 95 % of the best one's score makes the answer a guess: none is given."""

_ALIKE_PX = 2.0

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
    covered = _covered_pixels(lines, points, direction, reach)
    # A slanted edge has fewer pixels than its length: a hole of one between two hits is covered too.
    covered[:, 1:-1] |= covered[:, :-2] & covered[:, 2:]
    count: FloatArray = np.zeros((len(lines), 2 * reach + 1))
    np.cumsum(covered, axis=1, out=count[:, 1:])
    return count


@compiled
def _covered_pixels(lines: FloatArray, points: FloatArray, direction: FloatArray, reach: int) -> BoolArray:
    covered = np.zeros((len(lines), 2 * reach), dtype=np.bool_)
    for row in range(len(lines)):
        mine = agreeing(lines[row], points, direction, _COVER_PX, _COVER_COSINE)
        for k in range(len(points)):
            if mine[k]:
                step = int(np.floor(points[k, 1] * lines[row, 0] - points[k, 0] * lines[row, 1])) + reach
                if 0 <= step < 2 * reach:
                    covered[row, step] = True
    return covered


def _best_four(
    lines: FloatArray, covered_before: FloatArray, size: FloatArray, believable: Callable[[FloatArray], bool]
) -> IntArray | NoGroundMap:
    """Return the indices of the four lines, in walking order, whose quadrilateral the edges support best."""
    return _first_believable(*_scored_walks(lines, covered_before, size), believable)


def _scored_walks(
    lines: FloatArray, covered_before: FloatArray, size: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return all quadrilaterals with some support: (Q, 4) lines, (Q, 4, 2) corners, (Q,) scores."""
    meet = crossings(lines)
    reach = size / 2.0 + _OUTSIDE * size.max()
    meet[(np.abs(meet) > reach).any(axis=-1)] = np.nan
    walks = _WALKS[(len(lines) > _WALKS).all(axis=1)]
    corners = np.empty((len(walks), 4, 2))
    score = _fill_scores(lines, covered_before, meet, _MIN_SIDE * size.min(), walks, corners)
    hopeful = score > 0
    walks, corners, score = walks[hopeful], corners[hopeful], score[hopeful]
    fill = np.prod(np.ptp(corners, axis=1) / size, axis=1)
    return walks, corners, score * np.sqrt(np.minimum(fill, 1.0))


def likely_quadrilaterals(edges: Edges, box_xyxy_px: FloatArray, count: int) -> FloatArray:
    """Return (Q, 4, 2) corners of up to `count` quadrilaterals in a box, the best supported first.

    Args:
        edges: Of the box, located between pixels.
        box_xyxy_px: (4,) in the same pixels as the edges.
        count: At most so many, no two of them alike.
    """
    centre, size = (box_xyxy_px[:2] + box_xyxy_px[2:]) / 2.0, box_xyxy_px[2:] - box_xyxy_px[:2]
    points, direction = edges.points_px - centre, edges.direction
    lines = candidate_lines(points, direction, _CANDIDATES)
    if len(lines) < 4:
        return np.zeros((0, 4, 2))
    _, corners, score = _scored_walks(lines, _covered_before(lines, points, direction, size), size)
    chosen: list[FloatArray] = []
    for k in np.argsort(-score, kind="stable"):
        apart = [np.linalg.norm(one[ORDERS] - corners[k], axis=-1).max(axis=-1).min() for one in chosen]
        if not apart or min(apart) > _ALIKE_PX:
            chosen.append(corners[k])
        if len(chosen) == count:
            break
    return np.array(chosen).reshape(-1, 4, 2) + centre


def _first_believable(
    walks: IntArray, corners: FloatArray, score: FloatArray, believable: Callable[[FloatArray], bool]
) -> IntArray | NoGroundMap:
    """Return the best walk whose corners can be believed, unless another one is as good."""
    ranking = np.argsort(-score, kind="stable")[:_LOOKED_AT]
    best = next((k for k in ranking if believable(corners[k])), None)
    if best is None:
        return NoGroundMap(NO_QUADRILATERAL)
    rivals = [k for k in ranking if k != best and score[k] >= _RIVAL_SCORE * score[best]]
    apart = np.linalg.norm(corners[rivals][:, ORDERS] - corners[best], axis=-1).max(axis=-1).min(axis=-1)
    if any(believable(corners[k]) for k, distance in zip(rivals, apart, strict=True) if distance > _RIVAL_APART_PX):
        return NoGroundMap(RIVALS)
    chosen: IntArray = walks[best]
    return chosen


@compiled
def _fill_scores(
    lines: FloatArray,
    covered_before: FloatArray,
    meet: FloatArray,
    min_side_px: float,
    walks: IntArray,
    corners: FloatArray,
) -> FloatArray:
    """Return (Q,) scores of (Q, 4) walks, 0 where hopeless; fill in the (Q, 4, 2) corners."""
    scores = np.zeros(len(walks))
    for k in range(len(walks)):
        if walk_around(meet, walks[k], corners[k]):
            scores[k] = _score(lines, covered_before, min_side_px, walks[k], corners[k])
    return scores


@compiled
def _score(
    lines: FloatArray, covered_before: FloatArray, min_side_px: float, walk: IntArray, corners: FloatArray
) -> float:
    """Return pixels of outline that edges support, less what is bare and what runs on beyond a corner."""
    centre_x = (corners[0, 0] + corners[1, 0] + corners[2, 0] + corners[3, 0]) / 4.0
    centre_y = (corners[0, 1] + corners[1, 1] + corners[2, 1] + corners[3, 1]) / 4.0
    score, bright_inside = 0.0, 0
    for k in range(4):
        a, b, c = lines[walk[k], 0], lines[walk[k], 1], lines[walk[k], 2]
        start, end = corners[k, 1] * a - corners[k, 0] * b, corners[k - 3, 1] * a - corners[k - 3, 0] * b
        start, end = min(start, end), max(start, end)
        before, length = covered_before[walk[k]], end - start
        covered = _covered(before, start, end)
        if length < min_side_px or covered < _MIN_COVERED * length:
            return 0.0
        beyond = _covered(before, start - _BEYOND_TO_PX, start - _BEYOND_FROM_PX)
        beyond += _covered(before, end + _BEYOND_FROM_PX, end + _BEYOND_TO_PX)
        score += covered - _BARE_COST * (length - covered) - _BEYOND_COST * beyond
        bright_inside += centre_x * a + centre_y * b + c > 0
    return score if bright_inside == 0 or bright_inside == 4 else score * _MIXED_POLARITY


@compiled
def _covered(before: FloatArray, low: float, high: float) -> float:
    """Return how many of a line's pixels from `low` to `high` are covered."""
    most = len(before) - 1
    first, last = int(np.rint(low)) + most // 2, int(np.rint(high)) + most // 2
    count: float = before[min(max(last, 0), most)] - before[min(max(first, 0), most)]
    return count


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


@compiled
def _side_line(
    line: FloatArray, start: FloatArray, end: FloatArray, points: FloatArray, direction: FloatArray
) -> FloatArray:
    """Refit one side to the edge points between its corners."""
    along_x, along_y = end[0] - start[0], end[1] - start[1]
    length = np.hypot(along_x, along_y)
    mine = agreeing(line, points, direction, _REFIT_PX, _COVER_COSINE)
    for k in range(len(points)):
        position = ((points[k, 0] - start[0]) * along_x + (points[k, 1] - start[1]) * along_y) / length
        mine[k] &= _REFIT_TRIM_PX < position < length - _REFIT_TRIM_PX
    return fit_line_robustly(line, points[mine], _TUKEY_ROUNDS, _MIN_SCATTER_PX) if mine.sum() >= 4 else line
