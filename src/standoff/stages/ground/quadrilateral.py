"""Four contours become four anchor points, or a reason why not.

Corners go counter-clockwise as one sees them in the picture (its y axis points down); side k runs from
corner k to corner k + 1 and lies on line k.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.compiled import compiled
from standoff.core.homography import FloatArray
from standoff.core.types import IntArray, NoGroundMap

NO_QUADRILATERAL = "the contours make no convex quadrilateral"
OUTSIDE_BOX = "a corner lies outside the reference's box"
TOO_SMALL = "the quadrilateral is too small for the reference's box"
UNSUPPORTED = "a side of the quadrilateral has too few edge points"

WALKS = np.array([[0, 1, 2, 3], [0, 1, 3, 2], [0, 2, 1, 3]])
"""The three ways to walk around four lines."""

ORDERS = (np.arange(4)[:, None] + np.arange(4)) % 4
"""(4, 4) row k: the corners starting with corner k."""

_MIN_SINE = 0.05
"""Neighbouring sides meet at three degrees or more; a flatter crossing is not an anchor point."""

_CORRELATED = 4.0
"""Edge points next to each other share the blur's noise: so many count as one independent observation."""

_MIN_OFFSET_PX = 0.02
"""No side is known better than this, whatever its points' scatter: lens blur, shading and compression pull it."""

_OUTSIDE_FRACTION = 0.1
_MIN_FILL = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Quadrilateral:
    """The reference object's outline in one picture.

    Attributes:
        corners_px: (4, 2) anchor points.
        covariance_px2: (4, 2, 2) of each.
        lines: (4, 3) a, b, c of the sides.
        support: (4,) share of each side's length that has edge points on it, 0 to 1.
    """

    corners_px: FloatArray
    covariance_px2: FloatArray
    lines: FloatArray
    support: FloatArray


def join_lines(lines: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Cross four lines into the one convex quadrilateral that they make.

    Four lines in general position bound one convex, one concave and one self-crossing quadrilateral, so that
    which lines are opposite each other needs no guess.

    Args:
        lines: (4, 3) a, b, c, in any order.

    Returns:
        (4, 2) corners and (4, 3) lines, side k on line k, counter-clockwise as seen; None if there is none.

    >>> lines = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, -4.0], [0.0, 1.0, 0.0], [0.0, 1.0, -3.0]])
    >>> sorted(map(tuple, (join_lines(lines)[0] + 0.0).tolist()))
    [(0.0, 0.0), (0.0, 3.0), (4.0, 0.0), (4.0, 3.0)]
    """
    meet = crossings(lines)
    corners = np.empty((4, 2))
    for walk in WALKS.copy():
        if walk_around(meet, walk, corners):
            return corners, lines[walk]
    return None


@compiled
def crossings(lines: FloatArray) -> FloatArray:
    """Return (M, M, 2) where each two of (M, 3) lines cross; NaN where they are nearly parallel."""
    count = len(lines)
    meet = np.full((count, count, 2), np.nan)
    for i in range(count):
        for j in range(count):
            sine = lines[i, 0] * lines[j, 1] - lines[i, 1] * lines[j, 0]
            if abs(sine) >= _MIN_SINE:
                meet[i, j, 0] = (lines[i, 1] * lines[j, 2] - lines[i, 2] * lines[j, 1]) / sine
                meet[i, j, 1] = (lines[i, 2] * lines[j, 0] - lines[i, 0] * lines[j, 2]) / sine
    return meet


@compiled
def walk_around(meet: FloatArray, walk: IntArray, corners: FloatArray) -> bool:
    """Find the quadrilateral that one walk along four lines makes, and whether it is convex.

    Args:
        meet: (M, M, 2) from `crossings`.
        walk: (4,) lines; turned around in place if need be, so that side k lies on line `walk[k]`.
        corners: (4, 2) to be filled, counter-clockwise as seen.
    """
    for k in range(4):
        corners[k, 0], corners[k, 1] = meet[walk[k - 1], walk[k], 0], meet[walk[k - 1], walk[k], 1]
    left, right = 0, 0
    for k in range(4):
        before_x, before_y = corners[k - 1, 0] - corners[k - 2, 0], corners[k - 1, 1] - corners[k - 2, 1]
        x, y = corners[k, 0] - corners[k - 1, 0], corners[k, 1] - corners[k - 1, 1]
        turn = before_x * y - before_y * x
        left, right = left + (turn < 0), right + (turn > 0)
    if right == 4:
        # Walked the other way, side k runs from old corner -k to old corner -k - 1: along old line -k - 1.
        for axis in range(2):
            corners[1, axis], corners[3, axis] = corners[3, axis], corners[1, axis]
        walk[0], walk[1], walk[2], walk[3] = walk[3], walk[2], walk[1], walk[0]
    return left == 4 or right == 4


def quadrilateral_from_lines(
    lines: FloatArray, points_px: FloatArray, inlier_px: float, sigma_px: float | None
) -> Quadrilateral | None:
    """Join four lines, and say how well edge points support each side and fix each corner.

    Args:
        lines: (4, 3) in any order.
        points_px: (N, 2) edge points.
        inlier_px: Distance within which a point belongs to a side.
        sigma_px: Standard error of each corner coordinate; None: estimated from the points' scatter about the
            sides, as if one point in `_CORRELATED` were independent of its neighbours.

    Returns:
        The quadrilateral, or None if the lines make no convex one.
    """
    joined = join_lines(lines)
    if joined is None:
        return None
    corners, lines = joined
    support, errors = np.empty(4), np.empty((4, 2))
    for side, line in enumerate(lines):
        start, end = corners[side], corners[(side + 1) % 4]
        support[side], *errors[side] = _supported(line, start, end, points_px, inlier_px)
    if sigma_px is not None:
        covariance = np.tile(np.eye(2) * sigma_px**2, (4, 1, 1))
    else:
        covariance = _corner_covariances(lines, errors)
    return Quadrilateral(corners, covariance, lines, support)


@compiled
def _supported(
    line: FloatArray, start: FloatArray, end: FloatArray, points_px: FloatArray, inlier_px: float
) -> tuple[float, float, float]:
    """Return the share of a side's length that has edge points, and its line's offset variances at both ends."""
    along_x, along_y = end[0] - start[0], end[1] - start[1]
    length = np.hypot(along_x, along_y)
    hit = np.zeros(int(length) + 1, dtype=np.bool_)
    low, high = length, 0.0
    count, offset2, position1, position2 = 0, 0.0, 0.0, 0.0
    for k in range(len(points_px)):
        offset = points_px[k, 0] * line[0] + points_px[k, 1] * line[1] + line[2]
        position = ((points_px[k, 0] - start[0]) * along_x + (points_px[k, 1] - start[1]) * along_y) / length
        if abs(offset) <= inlier_px and 0.0 <= position <= length:
            hit[int(position)] = True
            low, high = min(low, position), max(high, position)
            count, offset2 = count + 1, offset2 + offset**2
            position1, position2 = position1 + position, position2 + position**2
    support = min(hit.sum() / length, 1.0)
    if count <= 2 or high - low <= 1.0:
        return support, inlier_px**2, inlier_px**2
    centre = position1 / count
    spread = position2 / count - centre**2
    independent = max(count / _CORRELATED, 1.0)
    variance = offset2 / count / independent
    at_start, at_end = variance * (1.0 + centre**2 / spread), variance * (1.0 + (length - centre) ** 2 / spread)
    return support, at_start + _MIN_OFFSET_PX**2, at_end + _MIN_OFFSET_PX**2


def _corner_covariances(lines: FloatArray, end_variances: FloatArray) -> FloatArray:
    """Carry the sides' errors to the corners where they cross."""
    before = np.arange(4) - 1
    to_corner = np.linalg.inv(np.stack([lines[before, :2], lines[:, :2]], axis=1))
    variances = np.column_stack([end_variances[before, 1], end_variances[:, 0]])
    covariances: FloatArray = (to_corner * variances[:, None]) @ to_corner.transpose(0, 2, 1)
    return covariances


def why_implausible(
    quadrilateral: Quadrilateral, picture_corners_px: FloatArray, box_xyxy_px: FloatArray, min_support: float
) -> NoGroundMap | None:
    """Return why a quadrilateral cannot be the reference in this box, or None if it can.

    Args:
        quadrilateral: The candidate.
        picture_corners_px: (4, 2) its corners as seen in the picture (lens distortion included).
        box_xyxy_px: (4,) of the reference in the picture.
        min_support: Every side needs at least this share of its length in edge points.
    """
    size = box_xyxy_px[2:] - box_xyxy_px[:2]
    slack = _OUTSIDE_FRACTION * float(size.max())
    low, high = picture_corners_px.min(axis=0), picture_corners_px.max(axis=0)
    if (low < box_xyxy_px[:2] - slack).any() or (high > box_xyxy_px[2:] + slack).any():
        return NoGroundMap(OUTSIDE_BOX)
    if np.prod(high - low) < _MIN_FILL * np.prod(size):
        return NoGroundMap(TOO_SMALL)
    if (quadrilateral.support < min_support).any():
        return NoGroundMap(UNSUPPORTED)
    return None
