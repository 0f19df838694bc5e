"""Outlines of strokes, in loops that are compiled."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from standoff.core.compiled import compiled
from standoff.core.homography import FloatArray
from standoff.drawing.fixed_point import FAR_PX, SHIFT


@compiled
def strip(points_px: FloatArray, width_px: float) -> npt.NDArray[np.int32]:
    """Return the outline of the stroke of a curve (N, 2) in fixed point, (2 N, 2): up one side, back down the other.

    Filled in one go, it costs half of cv2.polylines with its many joints.
    """
    count = len(points_px)
    outline = np.empty((2 * count, 2), dtype=np.int32)
    for i in range(count):
        along_x = points_px[min(i + 1, count - 1), 0] - points_px[max(i - 1, 0), 0]
        along_y = points_px[min(i + 1, count - 1), 1] - points_px[max(i - 1, 0), 1]
        length = max(math.sqrt(along_x * along_x + along_y * along_y), 1e-9)
        aside_x, aside_y = 0.5 * width_px * along_y / length, -0.5 * width_px * along_x / length
        for place, sign in ((i, 1.0), (2 * count - 1 - i, -1.0)):
            x, y = points_px[i, 0] + sign * aside_x, points_px[i, 1] + sign * aside_y
            outline[place, 0] = round(min(max(x, -FAR_PX), FAR_PX) * (1 << SHIFT))
            outline[place, 1] = round(min(max(y, -FAR_PX), FAR_PX) * (1 << SHIFT))
    return outline
