"""The arithmetic of a plane's motion, compiled: some hundred points, where numpy takes longer to begin than to work.

Matrices are worked on in Hartley's normalised coordinates, where their lower right entry is 1.
"""

from __future__ import annotations

import numpy as np

from standoff.core.compiled import compiled, solved
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray

MIN_PAIRS = 8
"""Fewer pairs than this that agree are no consensus."""

_ROUNDS = 5
_TUKEY = 4.0
_CONVERGED = 1e-5
"""A step that is shorter ends the rounds, in normalised coordinates: some thousandths of a pixel."""

_BEYOND = 1e3
_PARAMETERS = 8
_SIGMA_FLOOR = 0.03
"""Standard error of a followed point at its best, in followed pixels: interpolation alone leaves this much."""

_COLUMNS, _ROWS = 4, 3
"""Blocks within which errors of points may go together: relief, rolling shutter, a moved shadow."""

_CORRELATION_FLOOR = 0.02
"""Least correlation of two errors in a block: what few points cannot show, they may have."""


@compiled
def expect_points(points: FloatArray, pose: FloatArray, back: FloatArray, ratio: float) -> FloatArray:
    """Return (N, 2) where points are after a motion, moved on by a share of the last step.

    Args:
        points: (N, 2).
        pose: (3, 3) the motion, signed.
        back: (3, 3) from where it takes them to where they were a step before.
        ratio: How many times that step; none where there is no place a step before. NaN beyond the horizon.
    """
    expected = np.full((len(points), 2), np.nan)
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        w = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2]
        if not w > 0.0:
            continue
        x, y = (
            (pose[0, 0] * x + pose[0, 1] * y + pose[0, 2]) / w,
            (pose[1, 0] * x + pose[1, 1] * y + pose[1, 2]) / w,
        )
        expected[n, 0], expected[n, 1] = x, y
        w = back[2, 0] * x + back[2, 1] * y + back[2, 2]
        if w > 0.0:
            expected[n, 0] += ratio * (x - (back[0, 0] * x + back[0, 1] * y + back[0, 2]) / w)
            expected[n, 1] += ratio * (y - (back[1, 0] * x + back[1, 1] * y + back[1, 2]) / w)
    return expected


@compiled
def normalised(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points (N, 2) in normalised coordinates, and the (3, 3) of `homography.normalisation`."""
    count, middle, squares = len(points), np.zeros(2), 0.0
    for n in range(count):
        for axis in range(2):
            middle[axis] += points[n, axis] / count
    for n in range(count):
        squares += (points[n, 0] - middle[0]) ** 2 + (points[n, 1] - middle[1]) ** 2
    scale = np.sqrt(2.0 * count / squares)
    places, similarity = np.empty((count, 2)), np.eye(3)
    for axis in range(2):
        similarity[axis, axis], similarity[axis, 2] = scale, -scale * middle[axis]
        for n in range(count):
            places[n, axis] = scale * (points[n, axis] - middle[axis])
    return places, similarity


@compiled
def refine(
    places: FloatArray, wanted: FloatArray, matrix: FloatArray, reach: float, inlier: float, followed: float
) -> tuple[bool, FloatArray, FloatArray, FloatArray, BoolArray]:
    """Refine a homography by reweighted least squares of the distances in the target, with Tukey's weights.

    Args:
        places: (N, 2), exact.
        wanted: (N, 2) where they should come to lie, with errors, some of them large.
        matrix: (3, 3) to begin with, good to `reach`; its lower right entry is 1.
        reach: See `matrix`.
        inlier: Points much further off than this never take part.
        followed: One pixel of the picture in which the points were followed.

    Returns:
        Whether enough pairs agree; (3, 3) the matrix; (8, 8) covariance of its entries but the last; (N, 2) how far
        off the points are; (N,) which of them share the motion.
    """
    count, matrix = len(places), matrix.copy()
    sigma, most, floor = reach / 3.0, inlier / 2.0, _SIGMA_FLOOR * followed
    weight, inliers, unit = np.empty(count), np.zeros(count, dtype=np.bool_), np.eye(_PARAMETERS)
    for _ in range(_ROUNDS):
        residual, jacobian, length = _linear(matrix, places, wanted)
        close = 0
        for n in range(count):
            weight[n] = max(1.0 - (length[n] / (_TUKEY * min(sigma, most))) ** 2, 0.0) ** 2
            # Those that take part come first once sorted.
            length[n] = length[n] if weight[n] > 0.0 else np.inf
            close += weight[n] > 0.0
        if close < MIN_PAIRS:
            return False, matrix, unit, residual, inliers
        information, pull = _normal_equations(jacobian, residual, weight)
        step, largest = solved(information, pull), 0.0
        for k in range(_PARAMETERS):
            matrix[k // 3, k % 3] += step[k, 0]
            largest = max(largest, abs(step[k, 0]))
        # The median length of a plane normal error is 1.177 of its standard error along one axis.
        sigma = max(np.sort(length)[close // 2] / 1.177, floor)
        if largest < _CONVERGED:
            break
    residual, jacobian, length = _linear(matrix, places, wanted)
    agreeing, squares = 0, 0.0
    for n in range(count):
        inliers[n] = length[n] < 3.0 * min(sigma, most)
        weight[n] = 1.0 if inliers[n] else 0.0
        agreeing += inliers[n]
        squares += weight[n] * length[n] ** 2
    information, _ = _normal_equations(jacobian, residual, weight)
    parameters = solved(information, unit)
    variance = max(squares / max(2 * agreeing - _PARAMETERS, 1), floor**2)
    inflation = _inflation(residual, jacobian, weight, parameters, _blocks(places), variance)
    return agreeing >= MIN_PAIRS, matrix, variance * inflation * parameters, residual, inliers


@compiled
def _linear(matrix: FloatArray, places: FloatArray, wanted: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return residuals (N, 2) of a matrix, their Jacobian (N, 2, 8), and their lengths (N,).

    Points beyond the horizon are far off.
    """
    count = len(places)
    residual, length = np.full((count, 2), _BEYOND), np.empty(count)
    jacobian = np.zeros((count, 2, _PARAMETERS))
    for n in range(count):
        x, y = places[n, 0], places[n, 1]
        w = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2]
        if w > 0.0:
            for axis in range(2):
                mapped = (matrix[axis, 0] * x + matrix[axis, 1] * y + matrix[axis, 2]) / w
                residual[n, axis] = wanted[n, axis] - mapped
                first = 3 * axis
                jacobian[n, axis, first], jacobian[n, axis, first + 1] = x / w, y / w
                jacobian[n, axis, first + 2] = 1.0 / w
                jacobian[n, axis, 6], jacobian[n, axis, 7] = -mapped * x / w, -mapped * y / w
        length[n] = np.hypot(residual[n, 0], residual[n, 1])
    return residual, jacobian, length


@compiled
def _normal_equations(jacobian: FloatArray, residual: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (8, 8) and (8, 1)."""
    information, pull = np.zeros((_PARAMETERS, _PARAMETERS)), np.zeros((_PARAMETERS, 1))
    for n in range(len(weight)):
        if not weight[n] > 0.0:
            continue
        for axis in range(2):
            for i in range(_PARAMETERS):
                weighted = weight[n] * jacobian[n, axis, i]
                pull[i, 0] += weighted * residual[n, axis]
                for j in range(_PARAMETERS):
                    information[i, j] += weighted * jacobian[n, axis, j]
    return information, pull


@compiled
def _inflation(
    residual: FloatArray,
    jacobian: FloatArray,
    weight: FloatArray,
    parameters: FloatArray,
    block: IntArray,
    variance: float,
) -> float:
    """Return by how much errors that go together within a block raise the variance over independent ones.

    A fit turns independent errors into residuals that go against each other; the hat matrix says by how much.

    Args:
        residual: (N, 2).
        jacobian: (N, 2, 8).
        weight: (N,) 1 for those that count, 0 for all others.
        parameters: (8, 8) covariance of the parameters for errors of unit variance.
        block: (N,) numbers.
        variance: Of a residual along one axis.
    """
    blocks = _COLUMNS * _ROWS
    sizes, summed, rows = np.zeros(blocks), np.zeros((blocks, 2)), np.zeros((blocks, 2, _PARAMETERS))
    together, hat, counted, pairs = 0.0, 0.0, 0.0, 0.0
    for n in range(len(block)):
        if not weight[n] > 0.0:
            continue
        counted += 1.0
        sizes[block[n]] += 1.0
        for axis in range(2):
            summed[block[n], axis] += residual[n, axis]
            together -= residual[n, axis] ** 2
            hat -= _spread(jacobian[n, axis], parameters)
            # Rows of the Jacobian summed over a block stand for all of its pairs at once.
            for k in range(_PARAMETERS):
                rows[block[n], axis, k] += jacobian[n, axis, k]
    for k in range(blocks):
        pairs += sizes[k] * (sizes[k] - 1.0)
        for axis in range(2):
            together += summed[k, axis] ** 2
            hat += _spread(rows[k, axis], parameters)
    if pairs == 0.0:
        return 1.0
    correlation = min(max((together / variance + hat) / (2.0 * pairs), _CORRELATION_FLOOR), 1.0)
    return 1.0 + pairs / counted * correlation


@compiled
def _spread(row: FloatArray, covariance: FloatArray) -> float:
    """Return the variance of a weighted sum (P,) of parameters."""
    variance = 0.0
    for i in range(len(row)):
        for k in range(len(row)):
            variance += row[i] * covariance[i, k] * row[k]
    return variance


@compiled
def _blocks(points: FloatArray) -> IntArray:
    """Return (N,) the number of the block of the points' own extent that each lies in."""
    low_x, low_y, high_x, high_y = points[0, 0], points[0, 1], points[0, 0], points[0, 1]
    for n in range(len(points)):
        low_x, high_x = min(low_x, points[n, 0]), max(high_x, points[n, 0])
        low_y, high_y = min(low_y, points[n, 1]), max(high_y, points[n, 1])
    numbers = np.empty(len(points), dtype=np.int64)
    for n in range(len(points)):
        column = min(int((points[n, 0] - low_x) / max(high_x - low_x, 1e-9) * _COLUMNS), _COLUMNS - 1)
        row = min(int((points[n, 1] - low_y) / max(high_y - low_y, 1e-9) * _ROWS), _ROWS - 1)
        numbers[n] = row * _COLUMNS + column
    return numbers
