"""Whether something has lasted long enough, and how times are said.

Times of frames are sums and differences of rounded numbers. A fifth of a second after 0.4 s is 0.6000000000000001 s, or
0.19999999999999996 s later: compared to the letter, every other frame of a film at five frames a second would be too
early.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from standoff.core.homography import BoolArray, FloatArray

ROUNDING_S: Final = 1e-6
"""No two frames are so near, and no sum of a day of frame times is off by so much."""


def has_lasted(since_s: float, time_s: float, duration_s: float) -> bool:
    """Tell whether a duration is over.

    >>> has_lasted(0.4, 0.7, 0.3), 0.7 - 0.4 >= 0.3
    (True, False)
    """
    return time_s - since_s >= duration_s - ROUNDING_S


def have_lasted(lasting_s: FloatArray, duration_s: float) -> BoolArray:
    """Tell (N,) which of some times (N,) are as long as a duration; NaN is not.

    >>> have_lasted(np.array([59.9999999, 59.9, np.nan]), 60.0).tolist()
    [True, False, False]
    """
    lasted: BoolArray = np.asarray(lasting_s >= duration_s - ROUNDING_S)
    return lasted


def is_apart(before_s: float, time_s: float, longest_s: float) -> bool:
    """Tell whether two moments are further apart than a duration.

    >>> is_apart(0.4, 0.6000000000000001, 0.2), 0.6000000000000001 - 0.4 > 0.2
    (False, True)
    """
    return time_s - before_s > longest_s + ROUNDING_S


def minutes_text(time_s: float, _position: object = None) -> str:
    """Return minutes and seconds, for a table, or the tick of an axis.

    >>> minutes_text(75.25), minutes_text(float("nan"))
    ('1:15.2', 'unknown')
    """
    if not np.isfinite(time_s):
        return "unknown"
    minutes, seconds = divmod(round(time_s, 1), 60.0)
    return f"{int(minutes)}:{seconds:04.1f}"
