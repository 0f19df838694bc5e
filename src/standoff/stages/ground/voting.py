"""Candidate lines by oriented voting: each edge point votes for the lines that run across its gradient.

Every point votes, so that nothing depends on which points chance samples; and light and dark sides are told
apart, so that the two edges of a narrow plank do not add up to one line.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from standoff.core.compiled import compiled
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.stages.ground.lines import facing, fit_line

_STEPS = 360
"""Directions of a line's normal, one a degree, over the full circle: the sign is the polarity."""

_SPREAD = 10
"""A point votes for normals within ten degrees of its gradient: the noise of a gradient in faint edges."""

_NEAR_PX = 1.5
_AGREE_COSINE = 0.94
_CLAIM_PX, _CLAIM_COSINE = 2.25, 0.89
"""A found line takes away all points that could have voted for it, a little more than those that it is fitted to."""

_MIN_VOTES = 8.0
_FIT_ROUNDS = 3
_MAX_TURN_COSINE = 0.98


@compiled
def _vote(
    table: npt.NDArray[np.float32],
    points: FloatArray,
    towards: IntArray,
    normals: FloatArray,
    voting: BoolArray,
    weight: float,
) -> None:
    """Add some points' votes to a (directions, offsets) table, each shared between the two nearest offsets."""
    steps = len(table)
    middle = table.shape[1] // 2
    for k in np.flatnonzero(voting):
        for step in range(towards[k] - _SPREAD, towards[k] + _SPREAD + 1):
            row = step if step >= 0 else step + steps
            offset = points[k, 0] * normals[row, 0] + points[k, 1] * normals[row, 1] + middle
            column = int(offset)
            share = offset - column
            table[row, column] += weight * (1.0 - share)
            table[row, column + 1] += weight * share


@compiled
def agreeing(line: FloatArray, points: FloatArray, direction: FloatArray, near_px: float, cosine: float) -> BoolArray:
    """Return which points lie near a line with the gradient along its normal, sign included.

    Args:
        line: (3,) a, b, c; the bright side is where a x + b y + c grows.
        points: (N, 2).
        direction: (N, 2) unit gradients.
        near_px: Largest distance.
        cosine: Of the largest angle between gradient and normal.
    """
    mask = np.empty(len(points), dtype=np.bool_)
    for k in range(len(points)):
        near = abs(points[k, 0] * line[0] + points[k, 1] * line[1] + line[2]) <= near_px
        mask[k] = near and direction[k, 0] * line[0] + direction[k, 1] * line[1] >= cosine
    return mask


@compiled
def _refined(line: FloatArray, points: FloatArray, direction: FloatArray, free: BoolArray) -> FloatArray:
    for _ in range(_FIT_ROUNDS):
        near = agreeing(line, points, direction, _NEAR_PX, _AGREE_COSINE) & free
        count = near.sum()
        if count < _MIN_VOTES:
            break
        better = facing(fit_line(points[near], np.ones(count)), line)
        if better[0] * line[0] + better[1] * line[1] < _MAX_TURN_COSINE:
            break
        line = better
    return line


def candidate_lines(points: FloatArray, direction: FloatArray, count: int) -> FloatArray:
    """Return up to `count` lines, those with most votes first; each takes its points' votes with it.

    Args:
        points: (N, 2) around the origin, in px.
        direction: (N, 2) unit gradients.
        count: At most so many lines.

    Returns:
        (M, 3) a, b, c with the normal pointing to the bright side.
    """
    reach = int(np.ceil(np.linalg.norm(points, axis=1).max(initial=0.0))) + 2
    angles = np.arange(_STEPS) * (2.0 * np.pi / _STEPS)
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    towards = np.rint(np.arctan2(direction[:, 1], direction[:, 0]) * (_STEPS / (2.0 * np.pi))).astype(np.int64)
    table = np.zeros((_STEPS, 2 * reach + 1), dtype=np.float32)
    free = np.ones(len(points), dtype=bool)
    _vote(table, points, towards, normals, free, 1.0)
    lines = []
    for _ in range(count):
        row, column = np.unravel_index(int(table.argmax()), table.shape)
        if table[row, column] < _MIN_VOTES:
            break
        coarse = np.array([*normals[row], float(reach - column)])
        line = _refined(coarse, points, direction, free)
        lines.append(line)
        claimed = free & agreeing(line, points, direction, _CLAIM_PX, _CLAIM_COSINE)
        _vote(table, points, towards, normals, claimed, -1.0)
        free &= ~claimed
        table[row, column] = 0.0
    return np.array(lines).reshape(-1, 3)
