"""What a frame looks like, in a few numbers, and how sharp it is."""

from __future__ import annotations

import cv2
import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import Detections, ImageArray, Picture

_SMALL_PX = (96, 64)
_CELLS = 4
_DIRECTIONS = 8
_SHARP_WIDTH_PX = 640
_NEIGHBOURS = 5
_BLURRED_SHARE = 0.5


def describe(picture: Picture, detections: Detections) -> FloatArray:
    """Describe each of a frame's 4 x 4 cells by its colour, its edges by direction, and what is found there.

    Args:
        picture: The frame.
        detections: What was found in it.

    Returns:
        (192,): mean L, a, b of each cell; share of its gradient in each of 8 directions, unsigned, weighted by how
        strong it is; sum of the scores of boxes whose centre is there. All about 0 to 1.
    """
    small = picture.resized_bgr(*_SMALL_PX)
    lab = cv2.cvtColor(small, cv2.COLOR_BGR2LAB).astype(np.float64) / 255.0
    cells = [lab, _edges(small)]
    cell_values = [_cell_means(values) for values in cells]
    size_px = np.array([picture.width_px, picture.height_px], dtype=np.float64)
    return np.concatenate([*(values.ravel() for values in cell_values), _scores_by_cell(detections, size_px)])


def _edges(small: ImageArray) -> FloatArray:
    """Return (H, W, 8): the strength of each pixel's gradient in the channel of its direction, 0 to 1."""
    gray = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY).astype(np.float64) / 255.0
    down, right = np.gradient(gray)
    direction = np.floor((np.arctan2(down, right) % np.pi) / np.pi * _DIRECTIONS).astype(np.int64) % _DIRECTIONS
    channels: FloatArray = np.hypot(down, right)[..., None] * np.eye(_DIRECTIONS)[direction]
    return channels


def _cell_means(values: FloatArray) -> FloatArray:
    height, width, channels = values.shape
    cells = values.reshape(_CELLS, height // _CELLS, _CELLS, width // _CELLS, channels)
    means: FloatArray = cells.mean(axis=(1, 3))
    return means


def _scores_by_cell(detections: Detections, size_px: FloatArray) -> FloatArray:
    centres = (detections.xyxy_px[:, :2] + detections.xyxy_px[:, 2:] + 1.0) / 2.0
    column, row = np.clip((centres / size_px * _CELLS).astype(np.int64), 0, _CELLS - 1).T
    return np.bincount(row * _CELLS + column, weights=detections.score, minlength=_CELLS * _CELLS).astype(np.float64)


def sharpness(picture: Picture) -> float:
    """Return the variance of a frame's Laplacian at a common width; the sharper of two like views has more.

    Source:
        Pech-Pacheco et al., Diatom autofocusing in brightfield microscopy (2000), section 3.
    """
    scale = min(1.0, _SHARP_WIDTH_PX / picture.width_px)
    gray = picture.gray()
    if scale < 1.0:
        gray = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return float(cv2.Laplacian(gray, cv2.CV_64F).var())


def blurred(sharp: FloatArray) -> BoolArray:
    """Tell which frames are much less sharp than those around them.

    Args:
        sharp: (N,) in the order of time.

    Returns:
        (N,) True where it is below half of the median of the five frames before and after.

    >>> blurred(np.array([9.0, 8.0, 9.0, 2.0, 9.0, 10.0])).tolist()
    [False, False, False, True, False, False]
    """
    around = [np.median(sharp[max(0, i - _NEIGHBOURS) : i + _NEIGHBOURS + 1]) for i in range(len(sharp))]
    return np.asarray(sharp < _BLURRED_SHARE * np.array(around))
