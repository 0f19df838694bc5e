"""Four contours become four anchor points, or a reason why not.

Corners go counter-clockwise as one sees them in the picture (its y axis points down); side k runs from
corner k to corner k + 1 and lies on line k.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import NoGroundMap

NO_QUADRILATERAL = "the contours make no convex quadrilateral"
OUTSIDE_BOX = "a corner lies outside the reference's box"
TOO_SMALL = "the quadrilateral is too small for the reference's box"
UNSUPPORTED = "a side of the quadrilateral has too few edge points"

_PAIRINGS = np.array([[0, 1, 2, 3], [0, 1, 3, 2], [0, 2, 1, 3]])
"""The three ways to walk around four lines."""

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
    for pairing in _PAIRINGS:
        around = lines[pairing]
        meet = np.cross(np.roll(around, 1, axis=0), around)
        if (np.abs(meet[:, 2]) < _MIN_SINE).any():
            continue
        corners = meet[:, :2] / meet[:, 2:]
        sides = np.roll(corners, -1, axis=0) - corners
        before = np.roll(sides, 1, axis=0)
        turns = before[:, 0] * sides[:, 1] - before[:, 1] * sides[:, 0]
        if (turns < 0).all():
            return corners, around
        if (turns > 0).all():
            # Walked the other way, side k runs from old corner -k to old corner -k - 1: along old line -k - 1.
            return corners[[0, 3, 2, 1]], around[[3, 2, 1, 0]]
    return None


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
    support, errors = np.zeros(4), np.full((4, 2), inlier_px**2)
    for side, line in enumerate(lines):
        near = points_px[np.abs(points_px @ line[:2] + line[2]) <= inlier_px]
        start, end = corners[side], corners[(side + 1) % 4]
        length = float(np.linalg.norm(end - start))
        position = (near - start) @ (end - start) / length
        between = (position >= 0) & (position <= length)
        support[side] = min(len(np.unique(np.floor(position[between]))) / length, 1.0)
        if between.sum() > 2 and np.ptp(position[between]) > 1.0:
            errors[side] = _end_variances(near[between] @ line[:2] + line[2], position[between], length)
    if sigma_px is not None:
        covariance = np.tile(np.eye(2) * sigma_px**2, (4, 1, 1))
    else:
        covariance = _corner_covariances(lines, errors)
    return Quadrilateral(corners, covariance, lines, support)


def _end_variances(offset: FloatArray, position: FloatArray, length: float) -> FloatArray:
    """Return (2,) variances of a fitted line's offset at both ends of its side."""
    independent = max(len(offset) / _CORRELATED, 1.0)
    variance = float(np.mean(offset**2)) / independent
    spread = float(np.var(position))
    ends = np.array([0.0, length]) - position.mean()
    variances: FloatArray = variance * (1.0 + ends**2 / spread) + _MIN_OFFSET_PX**2
    return variances


def _corner_covariances(lines: FloatArray, end_variances: FloatArray) -> FloatArray:
    """Carry the sides' errors to the corners where they cross."""
    covariances = np.empty((4, 2, 2))
    for corner in range(4):
        to_corner = np.linalg.inv(lines[[corner - 1, corner], :2])
        errors = np.diag([end_variances[corner - 1, 1], end_variances[corner, 0]])
        covariances[corner] = to_corner @ errors @ to_corner.T
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
