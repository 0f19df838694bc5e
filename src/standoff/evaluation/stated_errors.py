"""Whether a stated standard error is true: how often the truth lies within as many of them as it should."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from standoff.core.homography import FloatArray

ONE_SIGMA = math.erf(math.sqrt(0.5))
"""The share of a normal distribution within one standard error of its middle, 68.27 %."""

PROBABILITIES = (*(k / 20 for k in range(1, 20)), 0.99)
"""The stated probabilities at which a reliability curve is read."""


def sigmas_around(probability: float) -> float:
    """Return within how many standard errors a normal distribution lies with a probability.

    >>> round(sigmas_around(0.95), 2), round(sigmas_around(ONE_SIGMA), 12)
    (1.96, 1.0)
    """
    return NormalDist().inv_cdf((1.0 + probability) / 2.0)


def plane_sigmas2_around(probability: float) -> float:
    """Return the same for a point of a plane, as the square of its Mahalanobis distance.

    Source:
        The chi-square distribution with 2 degrees of freedom.

    >>> round(plane_sigmas2_around(0.95), 2)
    5.99
    """
    return -2.0 * math.log(1.0 - probability)


def sigmas_off(error_m: FloatArray, sigma_m: FloatArray) -> FloatArray:
    """Return (N,) the size of errors in stated standard errors; infinite where none is stated.

    Args:
        error_m: (N,) finite.
        sigma_m: (N,) NaN where none is stated.

    >>> sigmas_off(np.array([-1.0, 0.0, 0.0, 1.0]), np.array([0.5, 0.0, np.nan, 0.0])).tolist()
    [2.0, 0.0, inf, inf]
    """
    off_m = np.abs(error_m)
    off = np.divide(off_m, sigma_m, out=np.full(len(off_m), np.inf), where=sigma_m > 0.0)
    return np.where((off_m == 0.0) & (sigma_m == 0.0), 0.0, off)


def plane_sigmas(off: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return (N,) the Mahalanobis distances of errors in a plane, on the ground or in the picture.

    Args:
        off: (N, 2) m or px.
        covariance: (N, 2, 2) as stated, m^2 or px^2.

    >>> plane_sigmas(np.array([[3.0, 4.0]]), 25.0 * np.eye(2)[None])
    array([1.])
    """
    inverse = np.linalg.pinv(covariance, hermitian=True)
    distances: FloatArray = np.sqrt(np.einsum("ni,nij,nj->n", off, inverse, off))
    return distances


@dataclass(frozen=True, slots=True)
class Coverage:
    """How true the stated errors of a series of distances are; NaN where nothing was measured.

    Attributes:
        inside_68: Share of the measured whose error is within one stated standard error; 68.3 % would be true.
        inside_95: Share within 1.96 of them; 95 % would be true.
        sigma_m: Median of the stated standard error.
        observed: Share within the interval of each of `PROBABILITIES`: the reliability curve.
    """

    inside_68: float
    inside_95: float
    sigma_m: float
    observed: tuple[float, ...]


def score_coverage(truth_m: FloatArray, estimate_m: FloatArray, sigma_m: FloatArray) -> Coverage:
    """Compare the errors of distances of any shape with the stated ones; a distance without an error is never inside.

    Args:
        truth_m: NaN where there is none.
        estimate_m: NaN where not measured.
        sigma_m: Stated standard error; NaN where none is.

    >>> found = score_coverage(np.array([10.0, 20.0]), np.array([11.0, 20.5]), np.array([0.7, 0.7]))
    >>> found.inside_68, found.inside_95
    (0.5, 1.0)
    """
    measured = np.isfinite(truth_m) & np.isfinite(estimate_m)
    if not measured.any():
        return Coverage(math.nan, math.nan, math.nan, (math.nan,) * len(PROBABILITIES))
    off = sigmas_off((estimate_m - truth_m)[measured], sigma_m[measured])
    stated_m = sigma_m[measured][np.isfinite(sigma_m[measured])]
    inside = [float(np.mean(off <= sigmas_around(p))) for p in (ONE_SIGMA, 0.95, *PROBABILITIES)]
    return Coverage(
        inside_68=inside[0],
        inside_95=inside[1],
        sigma_m=float(np.median(stated_m)) if len(stated_m) else math.nan,
        observed=tuple(inside[2:]),
    )
