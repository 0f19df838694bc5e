"""The motion that most points share: a robust homography, and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from standoff.core import homography
from standoff.core.homography import BoolArray, FloatArray
from standoff.stages.motion.plane_rounds import MIN_PAIRS, normalised, refine

_RANSAC_ROUNDS = 300
_RANSAC_CONFIDENCE = 0.995
_CLOSELY, _MAJORITY = 1.0 / 3.0, 0.5

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
    (places, by_source), (wanted, by_target) = normalised(source), normalised(target)
    unit, back = by_target[0, 0], np.linalg.inv(by_target)
    begun = by_target @ start @ np.linalg.inv(by_source)
    lengths = reach_px * unit, inlier_px * unit, followed_px * unit
    agree, matrix, parameters, residual, inlier = refine(places, wanted, begun / begun[2, 2], *lengths)
    if not (agree and np.isfinite(parameters).all()):
        return None
    matrix, covariance = back @ matrix @ by_source, np.zeros((9, 9))
    covariance[:8, :8] = parameters
    signed = homography.signed(matrix, source[inlier].mean(axis=0))
    # The entry (i, l) in pixels is back[i, j] by_source[k, l] of the entry (j, k).
    in_pixels = back[:, None, :, None] * by_source.T[None, :, None, :]
    linear = float(signed.ravel() @ matrix.ravel()) / float((matrix**2).sum()) * in_pixels.reshape(9, 9)
    return PlaneMotion(signed, linear @ covariance @ linear.T, residual / unit, inlier)


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
    near = plane.residual_px[length <= _RELIEF_REACH * _quantile(length, _RELIEF_SHARE)]
    excess, axes = np.linalg.eigh(near.T @ near / max(len(near), 1) - _NOISE_MARGIN * noise_px**2 * np.eye(2))
    shift = _RELIEF_PART * (axes * np.maximum(excess, 0.0)) @ axes.T + _second_shift(plane)
    by_shift = np.zeros((9, 2))
    by_shift[0:3, 0] = by_shift[3:6, 1] = plane.matrix[2]
    covariance: FloatArray = by_shift @ shift @ by_shift.T
    return covariance


def _quantile(values: FloatArray, share: float) -> float:
    """Return `np.quantile` of (N,), N >= 2; of so few values sorting is quicker."""
    ordered, place = np.sort(values), share * (len(values) - 1)
    below = int(place)
    return float(ordered[below] + (place - below) * (ordered[below + 1] - ordered[below]))


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
