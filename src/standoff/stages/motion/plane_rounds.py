"""The arithmetic of a plane's motion, compiled: some hundred points, where numpy takes longer to begin than to work.

Matrices are worked on in Hartley's normalised coordinates, where their lower right entry is 1.
"""

from __future__ import annotations

import numpy as np

from standoff.core.compiled import compiled
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray

MIN_PAIRS = 8
"""Fewer pairs than this that agree are no consensus."""

_ROUNDS = 5
_TUKEY = 4.0
_CONVERGED = 1e-5
"""Of a step, in normalised coordinates: some thousandths of a pixel."""

_BEYOND = 1e3
_PARAMETERS = 8
_SIGMA_FLOOR = 0.03
"""Standard error of a followed point at its best, in followed pixels: interpolation alone leaves this much."""

_COLUMNS, _ROWS = 4, 3
"""Blocks within which errors of points may go together: relief, rolling shutter, a moved shadow."""

_CORRELATION_FLOOR = 0.02
"""Least correlation of two errors in a block: what few points cannot show, they may have."""

_RELIEF_SHARE = 0.68
_RELIEF_REACH = 2.5
"""Points further off than so many times the reach of the nearer two thirds do not count as relief."""

_RELIEF_PART = 0.5
"""Share of the points' variance in height that the plane as a whole may be off by; chosen on the simulated clips."""

_NOISE_MARGIN = 1.2
"""Times the noise's variance: neither it nor the residuals' is known better from a hundred points."""

_SECOND_SHARE = 0.2
"""Share of the points from which a second motion that they share makes the first one doubtful."""


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
        x, y, w = pose @ np.array([points[n, 0], points[n, 1], 1.0])
        if not w > 0.0:
            continue
        x, y = x / w, y / w
        expected[n, 0], expected[n, 1] = x, y
        before_x, before_y, before_w = back @ np.array([x, y, 1.0])
        if before_w > 0.0:
            expected[n, 0] += ratio * (x - before_x / before_w)
            expected[n, 1] += ratio * (y - before_y / before_w)
    return expected


@compiled
def refine(
    source: FloatArray, target: FloatArray, start: FloatArray, reach_px: float, inlier_px: float, followed_px: float
) -> tuple[bool, FloatArray, FloatArray, FloatArray, BoolArray]:
    """Refine a homography by reweighted least squares of the distances in the target, with Tukey's weights.

    Args:
        source: (N, 2), exact.
        target: (N, 2) with errors, some of them large.
        start: (3, 3) good to `reach_px`.
        reach_px: See `start`.
        inlier_px: Points much further off than this never take part.
        followed_px: Size of one pixel of the picture in which the points were followed.

    Returns:
        Whether enough pairs agree, and what `PlaneMotion` holds: (3, 3), (9, 9), (N, 2) and (N,).
    """
    by_source, by_target = _normalisation(source), _normalisation(target)
    unit, back = by_target[0, 0], np.linalg.inv(by_target)
    places, wanted = _normalised(by_source, source), _normalised(by_target, target)
    matrix = by_target @ start @ np.linalg.inv(by_source)
    matrix /= matrix[2, 2]
    sigma, most, floor = reach_px * unit / 3.0, inlier_px * unit / 2.0, _SIGMA_FLOOR * followed_px * unit
    nothing = False, matrix, np.zeros((9, 9)), wanted, np.zeros(len(source), dtype=np.bool_)
    for _ in range(_ROUNDS):
        residual, jacobian, length = _linear(matrix, places, wanted)
        weight = np.maximum(1.0 - (length / (_TUKEY * min(sigma, most))) ** 2, 0.0) ** 2
        close = np.sort(length[weight > 0.0])
        if len(close) < MIN_PAIRS:
            return nothing
        information, pull = _normal_equations(jacobian, residual, weight)
        step = np.linalg.solve(information, pull)
        for k in range(_PARAMETERS):
            matrix[k // 3, k % 3] += step[k]
        # The median length of a plane normal error is 1.177 of its standard error along one axis.
        sigma = max(close[len(close) // 2] / 1.177, floor)
        if np.abs(step).max() < _CONVERGED:
            break
    residual, jacobian, length = _linear(matrix, places, wanted)
    inlier = length < 3.0 * min(sigma, most)
    if inlier.sum() < MIN_PAIRS:
        return nothing
    information, _ = _normal_equations(jacobian, residual, inlier.astype(np.float64))
    parameters = np.linalg.inv(information)
    variance = max((residual[inlier] ** 2).sum() / max(2 * inlier.sum() - _PARAMETERS, 1), floor**2)
    block = _blocks(places)
    together = _inflation(residual[inlier], jacobian[inlier], parameters, block[inlier], variance)
    covariance = np.zeros((9, 9))
    covariance[:8, :8] = variance * together * parameters
    signed, by_entries = _in_pixels(matrix, by_source, back, source[inlier])
    return True, signed, by_entries @ covariance @ by_entries.T, residual / unit, inlier


@compiled
def _normalisation(points: FloatArray) -> FloatArray:
    """Return the (3, 3) of `homography.normalisation`."""
    x, y = points[:, 0].mean(), points[:, 1].mean()
    scale = np.sqrt(2.0) / np.sqrt(((points[:, 0] - x) ** 2 + (points[:, 1] - y) ** 2).mean())
    return np.array([[scale, 0.0, -scale * x], [0.0, scale, -scale * y], [0.0, 0.0, 1.0]])


@compiled
def _normalised(similarity: FloatArray, points: FloatArray) -> FloatArray:
    places = np.empty_like(points)
    for axis in range(2):
        places[:, axis] = similarity[axis, axis] * points[:, axis] + similarity[axis, 2]
    return places


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
    """Return (8, 8) and (8,)."""
    information, pull = np.zeros((_PARAMETERS, _PARAMETERS)), np.zeros(_PARAMETERS)
    for n in range(len(weight)):
        if not weight[n] > 0.0:
            continue
        for axis in range(2):
            for i in range(_PARAMETERS):
                weighted = weight[n] * jacobian[n, axis, i]
                pull[i] += weighted * residual[n, axis]
                for j in range(_PARAMETERS):
                    information[i, j] += weighted * jacobian[n, axis, j]
    return information, pull


@compiled
def _in_pixels(
    matrix: FloatArray, by_source: FloatArray, back: FloatArray, in_front: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the (3, 3) in pixels, of unit norm and signed by points (K, 2) in front, and (9, 9) by the entries."""
    in_pixels = back @ matrix @ by_source
    scale = 1.0 / np.sqrt((in_pixels**2).sum())
    if in_pixels[2, 0] * in_front[:, 0].mean() + in_pixels[2, 1] * in_front[:, 1].mean() + in_pixels[2, 2] <= 0.0:
        scale = -scale
    by_entries = np.empty((9, 9))
    for row in range(9):
        for entry in range(9):
            by_entries[row, entry] = scale * back[row // 3, entry // 3] * by_source[entry % 3, row % 3]
    return scale * in_pixels, by_entries


@compiled
def _inflation(
    residual: FloatArray, jacobian: FloatArray, parameters: FloatArray, block: IntArray, variance: float
) -> float:
    """Return by how much errors that go together within a block raise the variance over independent ones.

    A fit turns independent errors into residuals that go against each other; the hat matrix says by how much.

    Args:
        residual: (K, 2).
        jacobian: (K, 2, 8).
        parameters: (8, 8) covariance of the parameters for errors of unit variance.
        block: (K,) numbers.
        variance: Of a residual along one axis.
    """
    blocks = _COLUMNS * _ROWS
    sizes, summed, rows = np.zeros(blocks), np.zeros((blocks, 2)), np.zeros((blocks, 2, _PARAMETERS))
    for n in range(len(block)):
        sizes[block[n]] += 1.0
        summed[block[n]] += residual[n]
        # Rows of the Jacobian summed over a block stand for all of its pairs at once.
        rows[block[n]] += jacobian[n]
    pairs = (sizes * (sizes - 1.0)).sum()
    if pairs == 0.0:
        return 1.0
    together = ((summed**2).sum() - (residual**2).sum()) / variance
    summed_rows, own = rows.reshape(-1, _PARAMETERS), jacobian.copy().reshape(-1, _PARAMETERS)
    hat = ((summed_rows @ parameters) * summed_rows).sum() - ((own @ parameters) * own).sum()
    correlation = min(max((together + hat) / (2.0 * pairs), _CORRELATION_FLOOR), 1.0)
    return 1.0 + pairs / len(block) * correlation


@compiled
def _blocks(points: FloatArray) -> IntArray:
    """Return (N,) the number of the block of the points' own extent that each lies in."""
    low_x, low_y = points[:, 0].min(), points[:, 1].min()
    wide, high = max(points[:, 0].max() - low_x, 1e-9), max(points[:, 1].max() - low_y, 1e-9)
    numbers = np.empty(len(points), dtype=np.int64)
    for n in range(len(points)):
        column = min(int((points[n, 0] - low_x) / wide * _COLUMNS), _COLUMNS - 1)
        row = min(int((points[n, 1] - low_y) / high * _ROWS), _ROWS - 1)
        numbers[n] = row * _COLUMNS + column
    return numbers


@compiled
def relief_of(matrix: FloatArray, residual_px: FloatArray, inlier: BoolArray, noise_px: float) -> FloatArray:
    """Return what `plane.relief_covariance` does."""
    length = np.sqrt(residual_px[:, 0] ** 2 + residual_px[:, 1] ** 2)
    near = residual_px[length <= _RELIEF_REACH * np.quantile(length, _RELIEF_SHARE)]
    excess, axes = np.linalg.eigh(near.T @ near / max(len(near), 1) - _NOISE_MARGIN * noise_px**2 * np.eye(2))
    shift = _RELIEF_PART * (axes * np.maximum(excess, 0.0)) @ axes.T + _second_shift(residual_px, inlier)
    by_shift = np.zeros((9, 2))
    by_shift[0:3, 0] = by_shift[3:6, 1] = matrix[2]
    return by_shift @ shift @ by_shift.T


@compiled
def _second_shift(residual_px: FloatArray, inlier: BoolArray) -> FloatArray:
    """Return (2, 2) the spread of a mixture of the plane and of a second motion, weighted by their points.

    As a shift: a homography of few points close together says nothing of the rest of the picture.
    """
    inliers = inlier.sum()
    least = max(_SECOND_SHARE * inliers, MIN_PAIRS)
    if len(inlier) - inliers < least:
        return np.zeros((2, 2))
    residual = residual_px[~inlier]
    middle = np.array([np.median(residual[:, 0]), np.median(residual[:, 1])])
    off = np.abs(residual - middle)
    spread = np.median(off) * 2.0
    count = 0
    for n in range(len(off)):
        count += max(off[n, 0], off[n, 1]) <= 2.0 * spread
    if count < least or np.hypot(middle[0], middle[1]) < 2.0 * spread:
        return np.zeros((2, 2))
    return count / (count + inliers) * np.outer(middle, middle)
