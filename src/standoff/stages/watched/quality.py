"""How well a picture could show a worker, part by part: blur, contrast and noise, read off its pixels.

Blur is read where the picture has edges. Blurred once more by a Gaussian of sigma s, an edge that has sigma b loses
slope by sqrt(b^2 + s^2) / b (Zhuo and Sim 2011, Eq. 4); edges that run up and those that run across are asked
separately, because a moving camera blurs one kind only. Contrast is what is left of the range of grey in a part once
the noise is taken off: fog, dusk and a lid on the lens all take it away.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff.core.types import Picture

Gray = npt.NDArray[np.float32]

_LARGEST_WIDTH_PX: Final = 960
_BLURRED_AGAIN_PX: Final = 1.0
_EDGE_NOISES: Final = 6.0
_LEAST_EDGE: Final = 6.0
_LEAST_EDGE_SHARE: Final = 0.0005
_LEAST_LOSS: Final = 0.01
_NEAR: Final = np.ones((3, 3), dtype=np.uint8)
_RANGE_PERCENT: Final = (1.0, 99.0)
_EVERY_PX: Final = 3
_MEDIAN_OF_NORMAL: Final = 0.6745


@dataclass(frozen=True, slots=True, eq=False)
class PictureQuality:
    """What the parts of one picture could show.

    Attributes:
        blur_px: (R, C) standard deviation of the blur, in pixels of the full-size picture; NaN where a part has no
            edges to tell.
        contrast: (R, C) range of grey, of 255, that is no noise.
        brightness: (R, C) mean grey, of 255.
        noise: Standard deviation of the noise at the size at which it was looked at, of 255.
    """

    blur_px: FloatArray
    contrast: FloatArray
    brightness: FloatArray
    noise: float


def picture_quality(picture: Picture, rows: int, columns: int) -> PictureQuality:
    """Judge a picture.

    Args:
        picture: Of any size; looked at 480 to 960 px wide.
        rows: Number of parts, one above another.
        columns: Number of parts side by side.
    """
    times = 0
    while picture.width_px >> times > _LARGEST_WIDTH_PX:
        times += 1
    gray = picture.halved_gray(times).astype(np.float32)
    noise = _noise(gray)
    height_px, width_px = (side // count * count for side, count in zip(gray.shape, (rows, columns), strict=True))
    gray = np.ascontiguousarray(gray[:height_px, :width_px])
    smooth: Gray = cv2.GaussianBlur(gray, (0, 0), _BLURRED_AGAIN_PX)
    parts = smooth.reshape(rows, height_px // rows, columns, -1)[:, ::_EVERY_PX, :, ::_EVERY_PX]
    low, high = _percentiles(parts.swapaxes(1, 2).reshape(rows, columns, -1))
    across, upright = (_blur(gray, smooth, noise, (columns, rows), axis) for axis in (1, 0))
    return PictureQuality(
        blur_px=np.fmax(across, upright) * 2.0**times,
        contrast=np.maximum(high - low - 2.0 * noise, 0.0).astype(np.float64),
        brightness=_means(gray, (columns, rows)),
        noise=noise,
    )


def _noise(gray: Gray) -> float:
    """Return the standard deviation of what no edge explains: the median of second differences both ways."""
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
    differences = cv2.filter2D(gray, cv2.CV_32F, kernel)[::_EVERY_PX, ::_EVERY_PX]
    # Grey levels are whole numbers, and so are these: counting them takes a quarter of the time of np.median.
    up_to = np.cumsum(np.bincount(np.abs(differences).astype(np.int64).ravel()))
    middle = np.searchsorted(up_to, [(up_to[-1] - 1) // 2, up_to[-1] // 2], side="right")
    return float(middle.mean()) / _MEDIAN_OF_NORMAL / float(np.linalg.norm(kernel))


def _percentiles(values: Gray) -> list[FloatArray]:
    """Return the percentiles `_RANGE_PERCENT` along the last axis, between two values the share of the way."""
    in_order, last = np.sort(values, axis=-1), values.shape[-1] - 1
    places = [percent / 100.0 * last for percent in _RANGE_PERCENT]
    below = [(int(place), min(int(place) + 1, last), place - int(place)) for place in places]
    return [in_order[..., k] + (in_order[..., above] - in_order[..., k]) * share for k, above, share in below]


def _blur(gray: Gray, smooth: Gray, noise: float, grid: tuple[int, int], axis: int) -> FloatArray:
    """Return (R, C) sigma of the edges that are met in going along an axis, in pixels as looked at; NaN without any."""
    # Every other line of those that run along the axis tells as much for half the time.
    before, after = (
        _squared_slopes(one[::2] if axis == 1 else np.ascontiguousarray(one[:, ::2]), axis) for one in (gray, smooth)
    )
    strong = np.flatnonzero((after > max(_LEAST_EDGE, _EDGE_NOISES * noise) ** 2) & (after == cv2.dilate(after, _NEAR)))
    (columns, rows), (height_px, width_px) = grid, gray.shape
    y, x = np.divmod(strong, after.shape[1])
    y, x = (2 * y, x) if axis == 1 else (y, 2 * x)
    part = y // (height_px // rows) * columns + x // (width_px // columns)
    counts, sharp, blunt = (
        np.bincount(part, weights, rows * columns).reshape(rows, columns)
        for weights in (None, before.ravel()[strong], after.ravel()[strong])
    )
    known = counts >= _LEAST_EDGE_SHARE * after.size / (rows * columns)
    ratio = np.divide(sharp, blunt, out=np.full(known.shape, np.nan), where=known)
    sigma: FloatArray = _BLURRED_AGAIN_PX / np.sqrt(np.maximum(ratio - 1.0, _LEAST_LOSS))
    return sigma


def _squared_slopes(gray: Gray, axis: int) -> Gray:
    """Return (H, W) squares of central differences along an axis; 0 at its two ends."""
    squares = np.zeros(gray.shape, dtype=np.float32)
    ahead, behind, inner = (
        (gray[:, 2:], gray[:, :-2], squares[:, 1:-1]) if axis == 1 else (gray[2:], gray[:-2], squares[1:-1])
    )
    twice = cv2.subtract(ahead, behind)
    cv2.multiply(twice, twice, dst=inner, scale=0.25)
    return squares


def _means(values: Gray, grid: tuple[int, int]) -> FloatArray:
    """Return (R, C) the mean of each part; `grid` is (columns, rows), of which the size is a multiple."""
    return np.asarray(cv2.resize(values, grid, interpolation=cv2.INTER_AREA), dtype=np.float64)
