"""The motion that most points share: a robust homography, and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.stages.motion.plane_rounds import MIN_PAIRS, refine, relief_of

_RANSAC_ROUNDS = 300
_RANSAC_CONFIDENCE = 0.995
_CLOSELY, _MAJORITY = 1.0 / 3.0, 0.5


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
    try:
        agree, *refined = refine(source, target, start, reach_px, inlier_px, followed_px)
    except np.linalg.LinAlgError:
        return None
    return PlaneMotion(*refined) if agree else None


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
    return relief_of(plane.matrix, plane.residual_px, plane.inlier, noise_px)


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
