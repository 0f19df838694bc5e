"""The paper's substitute for true distances: a polynomial through its own estimates (section 6.1, Fig. 10).

The paper took annotated positions through each frame's own homography and smoothed what came out. Whatever the
homographies share (a wrong height, a lens, the centre of a box) stays in the result; only exact truth shows it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from scipy.ndimage import median_filter

from standoff.core.homography import BoolArray, FloatArray

DEGREE = 9
KEPT_SD = 1.0
MEDIAN_FRAMES = 31
"""The paper gives no threshold for its first step; here it is its outlier filter's 50 px, measured from a running
median over so many frames, so that a real approach is not taken for an outlier."""

_LEAST_POINTS = 2 * (DEGREE + 1)


@dataclass(frozen=True, slots=True, eq=False)
class Benchmark:
    """What became of the raw estimates.

    Attributes:
        raw_m: (F,) annotated centres through each frame's own map; NaN where there is none.
        kept: (F,) which of them the last fit used.
        baseline_m: (F,) the first fit; NaN as for `trend_m`.
        trend_m: (F,) the final fit: the paper's truth; NaN before the first and after the last used estimate,
            and everywhere when there are too few of them for a polynomial of this degree.
    """

    raw_m: FloatArray
    kept: BoolArray
    baseline_m: FloatArray
    trend_m: FloatArray


def fit_benchmark(raw_m: FloatArray, threshold_m: FloatArray) -> Benchmark:
    """Drop outliers by a threshold, fit, drop what is more than one standard deviation off, fit again.

    Args:
        raw_m: (F,) estimates, one a frame; NaN where there is none.
        threshold_m: (F,) how far from the running median an outlier begins.

    Source:
        Paper, section 6.1, steps i to iv.
    """
    frame = np.arange(len(raw_m), dtype=np.float64)
    nothing = np.full(len(raw_m), np.nan)
    kept = within_threshold(raw_m, threshold_m)
    if kept.sum() < _LEAST_POINTS:
        return Benchmark(raw_m, np.zeros(len(raw_m), np.bool_), nothing, nothing)
    baseline = Polynomial.fit(frame[kept], raw_m[kept], DEGREE)
    residual_m = np.where(kept, raw_m - baseline(frame), np.nan)
    near = kept & (np.abs(residual_m) <= KEPT_SD * np.nanstd(residual_m))
    if near.sum() >= _LEAST_POINTS:
        kept = near
    trend = Polynomial.fit(frame[kept], raw_m[kept], DEGREE)
    used = np.flatnonzero(kept)
    inside = (frame >= used[0]) & (frame <= used[-1])
    # An extrapolated polynomial of ninth degree means nothing.
    return Benchmark(raw_m, kept, np.where(inside, baseline(frame), np.nan), np.where(inside, trend(frame), np.nan))


def within_threshold(raw_m: FloatArray, threshold_m: FloatArray) -> BoolArray:
    """Return (F,) which estimates are near the running median of those around them; False where there is none.

    >>> within_threshold(np.array([5.0, 5.1, 40.0, np.nan, 5.2]), np.full(5, 1.0))
    array([ True,  True, False, False,  True])
    """
    measured = np.isfinite(raw_m)
    near = np.zeros(len(raw_m), dtype=np.bool_)
    values_m = raw_m[measured]
    if len(values_m):
        middle_m = median_filter(values_m, size=min(MEDIAN_FRAMES, 2 * len(values_m) - 1), mode="nearest")
        near[measured] = np.abs(values_m - middle_m) <= threshold_m[measured]
    return near
