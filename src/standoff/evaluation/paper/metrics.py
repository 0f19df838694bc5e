"""The paper's error measures as functions of arrays, and the score of a series of distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.homography import BoolArray, FloatArray


def made_m(truth_m: FloatArray, estimate_m: FloatArray) -> float:
    """Return the mean absolute distance error.

    Args:
        truth_m: (N,) what is compared with, finite.
        estimate_m: (N,) finite.

    Source:
        Paper, section 6.1, Eq. 8.

    >>> made_m(np.array([10.0, 20.0]), np.array([11.0, 18.0]))
    1.5
    """
    return float(np.mean(np.abs(truth_m - estimate_m)))


def mape_percent(truth_m: FloatArray, estimate_m: FloatArray) -> float:
    """Return the mean absolute percentage error.

    Args:
        truth_m: (N,) what is compared with, none 0.
        estimate_m: (N,) finite.

    Source:
        Paper, section 6.1, Eq. 9.

    >>> mape_percent(np.array([10.0, 20.0]), np.array([11.0, 18.0]))
    10.0
    """
    return float(100.0 * np.mean(np.abs(truth_m - estimate_m) / truth_m))


def ale_m(scale_m_per_px: FloatArray, truth_px: FloatArray, estimate_px: FloatArray) -> float:
    """Return the average localisation error.

    Args:
        scale_m_per_px: (N,) metres a pixel in each frame.
        truth_px: (N, 2) true centres in the picture.
        estimate_px: (N, 2) estimated ones.

    Source:
        Paper, section 4.2, Eq. 3.

    >>> ale_m(np.array([0.1, 0.2]), np.zeros((2, 2)), np.array([[3.0, 4.0], [0.0, 5.0]]))
    0.75
    """
    return float(np.mean(scale_m_per_px * np.linalg.norm(truth_px - estimate_px, axis=-1)))


def fill_as_the_filter(estimate_m: FloatArray, missing: BoolArray) -> FloatArray:
    """Put the mean of the previous two estimates where a rectification failed, as the paper's outlier filter does.

    The paper's rectification always gave some homography; its filter replaced what a wrong one made of the distance.
    Where this one gives none, the same replacement makes series of the same length comparable.

    Args:
        estimate_m: (N,) in the order of time; NaN where not measured.
        missing: (N,) where to fill; a gap elsewhere stays, and forgets what was before it.

    Source:
        Paper, section 5.1, step v.

    >>> fill_as_the_filter(np.array([10.0, 11.0, np.nan, 12.0]), np.array([False, False, True, False])).tolist()
    [10.0, 11.0, 10.5, 12.0]
    """
    filled = estimate_m.copy()
    for row in range(2, len(filled)):
        if missing[row] and np.isnan(filled[row]):
            filled[row] = (filled[row - 1] + filled[row - 2]) / 2.0
    return filled


@dataclass(frozen=True, slots=True)
class DistanceScore:
    """How well a series of distances agrees with another one.

    Attributes:
        frames: Frames of all pairs in which there is something to compare with.
        measured: Of these, with an estimate; the errors are over them.
        made_m: Eq. 8; NaN, as the others, where nothing was measured.
        mape_percent: Eq. 9.
        median_m: Median residual, estimate less truth.
        p95_m: 95th percentile of the absolute error.
        worst_m: Largest absolute error.
    """

    frames: int
    measured: int
    made_m: float
    mape_percent: float
    median_m: float
    p95_m: float
    worst_m: float


def score_distances(truth_m: FloatArray, estimate_m: FloatArray) -> DistanceScore:
    """Compare two series of distances of any shape; NaN in either means that there is none.

    >>> score_distances(np.array([10.0, 20.0, 5.0]), np.array([11.0, 18.0, np.nan]))
    DistanceScore(frames=3, measured=2, made_m=1.5, mape_percent=10.0, median_m=-0.5, p95_m=1.95, worst_m=2.0)
    """
    comparable = np.isfinite(truth_m)
    measured = comparable & np.isfinite(estimate_m)
    if not measured.any():
        return DistanceScore(int(comparable.sum()), 0, *[float("nan")] * 5)
    truth_m, estimate_m = truth_m[measured], estimate_m[measured]
    residual_m = estimate_m - truth_m
    return DistanceScore(
        frames=int(comparable.sum()),
        measured=int(measured.sum()),
        made_m=made_m(truth_m, estimate_m),
        mape_percent=mape_percent(truth_m, estimate_m),
        median_m=float(np.median(residual_m)),
        p95_m=float(np.percentile(np.abs(residual_m), 95)),
        worst_m=float(np.abs(residual_m).max()),
    )
