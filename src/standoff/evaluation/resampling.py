"""How far chance moves a figure: whole groups drawn again and again from those that there are.

What belongs to one scene or one clip is right or wrong together, so groups are drawn and never single samples.
"""

from __future__ import annotations

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import IntArray

LEAST_GROUPS = 5
"""With fewer groups an interval says more about the bootstrap than about what was measured."""
RESAMPLES = 1000
_TAILS_PERCENT = (2.5, 97.5)


def draw_groups(groups: int, *, resamples: int = RESAMPLES, seed: int = 0) -> IntArray:
    """Return (R, G) how often each group is in each draw of as many groups, with repetition.

    Source:
        Efron and Tibshirani, An Introduction to the Bootstrap (1993), chapters 8 and 13: the percentile interval of
        whole clusters.
    """
    return np.random.default_rng(seed).multinomial(groups, np.full(groups, 1.0 / groups), size=resamples)


def interval_of(values: FloatArray) -> tuple[float, float]:
    """Return what 95 % of the draws gave; NaN where none gave a number.

    >>> interval_of(np.array([np.nan, *range(101)]))
    (2.5, 97.5)
    """
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, _TAILS_PERCENT) if len(known) else (np.nan, np.nan)
    return float(low), float(high)
