"""What somebody who marks pictures would mark: the rule for pictures whose truth is known to the pixel."""

from __future__ import annotations

import numpy as np

from standoff.core.homography import BoolArray, FloatArray

_LEAST_PX, _LEAST_SIDE_PX = 16, 6
_LEAST_SHARE = 0.15
_PLAIN_PX = 1500
"""Of a machine is plain to see, however small a share of it that is."""


def would_be_marked(xyxy_px: FloatArray, visible_px: FloatArray, visible_share: FloatArray) -> BoolArray:
    """Tell which things are neither too small nor too hidden to be marked.

    Args:
        xyxy_px: (N, 4) boxes of what is seen.
        visible_px: (N,) pixels that are seen.
        visible_share: (N,) of the thing that is seen, 0 to 1.

    Returns:
        (N,).
    """
    side_px = (xyxy_px[:, 2:] - xyxy_px[:, :2]).max(axis=1, initial=0.0)
    is_large = (visible_px >= _LEAST_PX) & (side_px >= _LEAST_SIDE_PX)
    return np.asarray(is_large & ((visible_share >= _LEAST_SHARE) | (visible_px >= _PLAIN_PX)))
