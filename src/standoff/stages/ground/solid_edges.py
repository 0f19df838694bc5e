"""Look across the expected edges of a solid for the edges that the picture has there."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.compiled import compiled
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import Luma
from standoff.stages.ground.edges import interpolated
from standoff.stages.ground.solid import EdgeSamples

CANDIDATES = 4
"""So many edges are remembered for each look."""

_MARGIN_PX = 4
_STEP_PX = 0.5
_NOISE_FACTOR = 3.0
_LEAST_STEEPNESS = 1.5
"""Grey levels a pixel: less than this is compression, not an edge."""

Smooth = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Looks:
    """What was found across each sample of `EdgeSamples`.

    Attributes:
        offset_px: (N, K) places of edges along the sample's normal, steepest first; NaN where there are fewer.
        steepness: (N, K) grey levels a pixel there, positive where it gets brighter along the normal.
        inside: (N,) whether the picture holds the whole look.
    """

    offset_px: FloatArray
    steepness: FloatArray
    inside: BoolArray


@dataclass(frozen=True, slots=True, eq=False)
class Blurred:
    """A part of a picture, smoothed.

    Attributes:
        values: (H, W) grey levels.
        left_px: Picture column of `values[:, 0]`.
        top_px: Picture row of `values[0]`.
        least_steepness: Grey levels a pixel below which an edge is not told from the texture of the ground.
    """

    values: Smooth
    left_px: int
    top_px: int
    least_steepness: float

    @classmethod
    def around(cls, gray: Luma, points_px: FloatArray, margin_px: float) -> Blurred | None:
        """Smooth what lies around points (N, 2), or return None where next to nothing of it is in the picture."""
        height, width = gray.shape
        low = np.floor(points_px.min(axis=0) - margin_px).astype(int) - _MARGIN_PX
        high = np.ceil(points_px.max(axis=0) + margin_px).astype(int) + _MARGIN_PX + 1
        x0, y0, x1, y1 = max(low[0], 0), max(low[1], 0), min(high[0], width), min(high[1], height)
        if x1 - x0 < _MARGIN_PX or y1 - y0 < _MARGIN_PX:
            return None
        crop = gray[y0:y1, x0:x1].astype(np.float32)
        smooth = cv2.GaussianBlur(crop, (7, 7), 1.0, borderType=cv2.BORDER_REPLICATE)
        return cls(smooth, int(x0), int(y0), _least_steepness(smooth))


def _least_steepness(smooth: Smooth) -> float:
    brighter, darker = smooth[::2, 1::2], smooth[::2, :-1:2]
    return max(_LEAST_STEEPNESS, _NOISE_FACTOR * float(np.median(cv2.absdiff(brighter, darker))))


def look_across(picture: Blurred, samples: EdgeSamples, half_px: float) -> Looks:
    """Find edges across the samples.

    Args:
        picture: What lies around them.
        samples: Where to look, and how far at most.
        half_px: Look so far to both sides, and no further than half way to the next edge of the solid.
    """
    reach = np.minimum(samples.reach_px, half_px)
    points = samples.points_px - (picture.left_px, picture.top_px)
    offset, steepness, inside = _look(picture.values, points, samples.normal, reach)
    offset[np.abs(steepness) < picture.least_steepness] = np.nan
    return Looks(offset, steepness, inside)


@compiled
def _look(
    smooth: Smooth, points: FloatArray, normal: FloatArray, reach: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return offsets (N, K), steepness (N, K), and whether each look lies in the picture."""
    count = len(points)
    offset = np.full((count, CANDIDATES), np.nan)
    steepness = np.zeros((count, CANDIDATES))
    inside = np.zeros(count, dtype=np.bool_)
    height, width = smooth.shape
    for n in range(count):
        half = int(np.ceil(reach[n] / _STEP_PX))
        span = (half + 3) * _STEP_PX
        if not (np.isfinite(points[n, 0]) and np.isfinite(points[n, 1])):
            continue
        far_x, far_y = abs(normal[n, 0]) * span, abs(normal[n, 1]) * span
        x, y = points[n, 0], points[n, 1]
        if not (far_x <= x < width - 1 - far_x and far_y <= y < height - 1 - far_y):
            continue
        inside[n] = True
        profile = np.empty(2 * half + 7)
        for k in range(len(profile)):
            t = (k - half - 3) * _STEP_PX
            profile[k] = interpolated(smooth, x + t * normal[n, 0], y + t * normal[n, 1])
        # Steepness over one pixel: two steps.
        slope = profile[2:] - profile[:-2]
        for k in range(1, len(slope) - 1):
            here = abs(slope[k])
            if here <= abs(slope[k - 1]) or here < abs(slope[k + 1]):
                continue
            before, after = abs(slope[k - 1]), abs(slope[k + 1])
            bend = before + after - 2.0 * here
            shift = (before - after) / (2.0 * bend) if bend < 0 else 0.0
            place = (k + 1 - half - 3 + shift) * _STEP_PX
            if abs(place) > reach[n]:
                continue
            _keep(offset[n], steepness[n], place, slope[k])
    return offset, steepness, inside


@compiled
def _keep(offset: FloatArray, steepness: FloatArray, place: float, slope: float) -> None:
    """Insert an edge among the steepest ones."""
    for k in range(CANDIDATES):
        if abs(slope) > abs(steepness[k]):
            for later in range(CANDIDATES - 1, k, -1):
                offset[later], steepness[later] = offset[later - 1], steepness[later - 1]
            offset[k], steepness[k] = place, slope
            return
