"""The motion that most points share: a robust homography, and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from standoff.core import homography
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray

MIN_PAIRS = 8
"""Fewer pairs than this that agree are no consensus."""

_RANSAC_ROUNDS = 300
_RANSAC_CONFIDENCE = 0.995
_CLOSELY, _MAJORITY = 1.0 / 3.0, 0.5
_ROUNDS = 5
_TUKEY = 4.0
_CONVERGED = 1e-5
"""Of a step, in normalised coordinates: some thousandths of a pixel."""

_BEYOND = 1e3
_PARAMETERS = 8
_SIGMA_FLOOR = 0.03
"""Standard error of a followed point at its best, in followed pixels: interpolation alone leaves this much."""

_BLOCKS = (4, 3)
"""Columns and rows of blocks within which errors of points may go together: relief, rolling shutter, a moved shadow."""

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


@dataclass(frozen=True, slots=True, eq=False)
class PlaneMotion:
    """The motion of a plane between two pictures.

    Attributes:
        matrix: (3, 3) signed homography, of unit norm.
        covariance: (9, 9) of its entries, row by row, as far as independent errors of the points tell.
        residual_px: (N, 2) how far each target lies from where the matrix puts its source.
        inlier: (N,) the points that share the motion.
    """

    matrix: FloatArray
    covariance: FloatArray
    residual_px: FloatArray
    inlier: BoolArray


def fit_plane(
    source: FloatArray, target: FloatArray, *, trusted: BoolArray, inlier_px: float, followed_px: float
) -> PlaneMotion | None:
    """Fit the homography that most point pairs share.

    Consensus by RANSAC or MAGSAC, then reweighted least squares of the distances in the target, with Tukey's weights at
    the scale of the residuals themselves.

    Args:
        source: (N, 2), exact.
        target: (N, 2) with errors, some of them large.
        trusted: (N,) the points among which consensus is sought, where they are enough; all take part after that.
        inlier_px: How far a point of the plane may be off.
        followed_px: Size of one pixel of the picture in which the points were followed.

    Returns:
        None where no eight pairs agree.
    """
    if len(source) < MIN_PAIRS:
        return None
    voters = trusted if np.count_nonzero(trusted) >= 2 * MIN_PAIRS else np.ones_like(trusted)
    start, reach_px = _consensus(source[voters], target[voters], inlier_px)
    if start is None:
        return None
    by_source, by_target = homography.normalisation(source), homography.normalisation(target)
    unit, back = by_target[0, 0], np.linalg.inv(by_target)
    try:
        refinement = _Refinement(by_source, source, by_target, target, followed_px * unit)
        refined = refinement.run(by_target @ start @ np.linalg.inv(by_source), reach_px * unit, inlier_px * unit)
    except np.linalg.LinAlgError:
        return None
    if refined is None:
        return None
    matrix = back @ refined.matrix @ by_source
    signed = homography.signed(matrix, source[refined.inlier].mean(axis=0))
    linear = float(signed.ravel() @ matrix.ravel()) / float((matrix**2).sum()) * np.kron(back, by_source.T)
    covariance = linear @ refined.covariance @ linear.T
    return PlaneMotion(signed, covariance, refined.residual_px / unit, refined.inlier)


def relief_covariance(plane: PlaneMotion, noise_px: float) -> FloatArray:
    """Return the (9, 9) covariance that heights above and below the plane add.

    Ground is not flat, and the plane that was found runs somewhere among its points, not through the one that
    matters: a point may be off by as much as the points are, beyond what following them badly explains. That is
    common to neighbours, so it does not average out. It is taken as an unknown shift of the whole picture; and where
    many points share another motion, a roof or a platform, by that.

    Args:
        plane: As fitted.
        noise_px: Standard error, along an axis, that following alone gives a point.
    """
    length = np.hypot(plane.residual_px[:, 0], plane.residual_px[:, 1])
    near = plane.residual_px[length <= _RELIEF_REACH * np.quantile(length, _RELIEF_SHARE)]
    excess, axes = np.linalg.eigh(near.T @ near / max(len(near), 1) - _NOISE_MARGIN * noise_px**2 * np.eye(2))
    shift = _RELIEF_PART * (axes * np.maximum(excess, 0.0)) @ axes.T + _second_shift(plane)
    by_shift = np.zeros((9, 2))
    by_shift[0:3, 0] = by_shift[3:6, 1] = plane.matrix[2]
    covariance: FloatArray = by_shift @ shift @ by_shift.T
    return covariance


def _second_shift(plane: PlaneMotion) -> FloatArray:
    """Return (2, 2) the spread of a mixture of the plane and of a second motion, weighted by their points.

    As a shift: a homography of few points close together says nothing of the rest of the picture.
    """
    others = ~plane.inlier
    inliers = int(np.count_nonzero(plane.inlier))
    least = max(_SECOND_SHARE * inliers, MIN_PAIRS)
    if np.count_nonzero(others) < least:
        return np.zeros((2, 2))
    residual = plane.residual_px[others]
    middle = np.median(residual, axis=0)
    spread = np.median(np.abs(residual - middle)) * 2.0
    shared = (np.abs(residual - middle) <= 2.0 * spread).all(axis=1)
    count = int(np.count_nonzero(shared))
    if count < least or float(np.hypot(*middle)) < 2.0 * spread:
        return np.zeros((2, 2))
    return count / (count + inliers) * np.outer(middle, middle)


def _consensus(source: FloatArray, target: FloatArray, inlier_px: float) -> tuple[FloatArray | None, float]:
    """Return a matrix that many pairs agree with, and how far off they may be; None where too few agree.

    A majority that agrees closely goes first, by plain counting: a loose one, and MAGSAC's, which looks further than
    its limit, may bend to take in a second, slower motion beside it.
    """
    for method, reach_px, least in (
        (cv2.RANSAC, _CLOSELY * inlier_px, _MAJORITY * len(source)),
        (cv2.USAC_MAGSAC, inlier_px, 0.0),
    ):
        start, consenting = cv2.findHomography(
            source, target, method, reach_px, maxIters=_RANSAC_ROUNDS, confidence=_RANSAC_CONFIDENCE
        )
        if start is not None and np.count_nonzero(consenting) >= max(least, MIN_PAIRS):
            return start, reach_px
    return None, inlier_px


@dataclass(slots=True, eq=False)
class _Linear:
    """Residuals (2, N) of a matrix and their Jacobian (2, N, 8); points beyond the horizon are far off."""

    residual: FloatArray
    jacobian: FloatArray
    length: FloatArray


class _Refinement:
    """Least squares in normalised coordinates, where the lower right entry of the matrix is 1.

    Args:
        by_source: (3, 3) normalisation.
        source: (N, 2).
        by_target: (3, 3) normalisation.
        target: (N, 2).
        followed: One followed pixel, in the normalised target's units.
    """

    def __init__(
        self, by_source: FloatArray, source: FloatArray, by_target: FloatArray, target: FloatArray, followed: float
    ) -> None:
        self._source = np.column_stack([source, np.ones(len(source))]) @ by_source.T
        self._target = by_target[:2, :2] @ target.T + by_target[:2, 2:]
        self._followed = followed

    def run(self, start: FloatArray, reach: float, inlier: float) -> PlaneMotion | None:
        """Refine from a first matrix, good to `reach`; points much further off than `inlier` never take part."""
        matrix, sigma = start / start[2, 2], reach / 3.0
        for _ in range(_ROUNDS):
            now = self._linear(matrix)
            weight = np.maximum(1.0 - (now.length / (_TUKEY * min(sigma, inlier / 2.0))) ** 2, 0.0) ** 2
            close = now.length[weight > 0.0]
            if len(close) < MIN_PAIRS:
                return None
            rows = now.jacobian.reshape(-1, _PARAMETERS)
            weighted = (now.jacobian * weight[:, None]).reshape(-1, _PARAMETERS)
            step = np.linalg.solve(weighted.T @ rows, weighted.T @ now.residual.ravel())
            matrix = matrix + np.append(step, 0.0).reshape(3, 3)
            # The median length of a plane normal error is 1.177 of its standard error along one axis.
            sigma = max(float(np.partition(close, len(close) // 2)[len(close) // 2]) / 1.177, self._floor)
            if float(np.abs(step).max()) < _CONVERGED:
                break
        return self._judged(matrix, min(sigma, inlier / 2.0))

    @property
    def _floor(self) -> float:
        return _SIGMA_FLOOR * self._followed

    def _linear(self, matrix: FloatArray) -> _Linear:
        x, y, w = matrix @ self._source.T
        seen = w > 0.0
        over_w = np.where(seen, 1.0 / np.where(seen, w, 1.0), 0.0)
        mapped = np.stack([x * over_w, y * over_w])
        scaled = self._source * over_w[:, None]
        jacobian = np.zeros((2, len(scaled), _PARAMETERS))
        jacobian[0, :, 0:3] = jacobian[1, :, 3:6] = scaled
        jacobian[:, :, 6:8] = -mapped[:, :, None] * scaled[:, :2]
        residual = np.where(seen, self._target - mapped, _BEYOND)
        return _Linear(residual, jacobian, np.hypot(residual[0], residual[1]))

    def _judged(self, matrix: FloatArray, sigma: float) -> PlaneMotion | None:
        now = self._linear(matrix)
        inlier = now.length < 3.0 * sigma
        if np.count_nonzero(inlier) < MIN_PAIRS:
            return None
        residual, jacobian = now.residual[:, inlier], now.jacobian[:, inlier]
        rows = jacobian.reshape(-1, _PARAMETERS)
        parameters = np.asarray(np.linalg.inv(rows.T @ rows), dtype=np.float64)
        variance = max(float((residual**2).sum()) / max(residual.size - _PARAMETERS, 1), self._floor**2)
        block = _blocks(self._source[:, :2])[inlier]
        covariance = np.zeros((9, 9))
        covariance[:8, :8] = variance * _inflation(residual, jacobian, parameters, block, variance) * parameters
        return PlaneMotion(matrix, covariance, now.residual.T, inlier)


def _inflation(
    residual: FloatArray, jacobian: FloatArray, parameters: FloatArray, block: IntArray, variance: float
) -> float:
    """Return by how much errors that go together within a block raise the variance over independent ones.

    A fit turns independent errors into residuals that go against each other; the hat matrix says by how much.

    Args:
        residual: (2, N).
        jacobian: (2, N, 8).
        parameters: (8, 8) covariance of the parameters for errors of unit variance.
        block: (N,) numbers.
        variance: Of a residual along one axis.
    """
    member = (np.arange(_BLOCKS[0] * _BLOCKS[1])[:, None] == block).astype(np.float64)
    sizes = member.sum(axis=1)
    pairs = float((sizes * (sizes - 1.0)).sum())
    if not pairs:
        return 1.0
    summed = residual @ member.T
    together = float((summed**2).sum() - (residual**2).sum()) / variance
    # Rows of the Jacobian summed over a block stand for all of its pairs at once.
    rows, own = (member @ jacobian).reshape(-1, _PARAMETERS), jacobian.reshape(-1, _PARAMETERS)
    hat = float(((rows @ parameters) * rows).sum() - ((own @ parameters) * own).sum())
    correlation = min(max((together + hat) / (2.0 * pairs), _CORRELATION_FLOOR), 1.0)
    return 1.0 + pairs / len(block) * correlation


def _blocks(points: FloatArray) -> IntArray:
    """Return (N,) the number of the block of the points' own extent that each lies in."""
    low, high = points.min(axis=0), points.max(axis=0)
    share = (points - low) / np.maximum(high - low, 1e-9)
    cell = np.minimum((share * _BLOCKS).astype(np.int64), np.array(_BLOCKS) - 1)
    numbers: IntArray = cell[:, 1] * _BLOCKS[0] + cell[:, 0]
    return numbers
