"""Ground points beside boxes: where the middle of each footprint appears in the picture.

In a YOLO data set the point of line k of `labels/NAME.txt` is line k of `points/NAME.txt`: x and y as shares of the
picture, counted from its left and upper edge; outside the picture they are below 0 or above 1, and `nan nan` where
nobody marked one. A file of its own leaves the label files as every reader of YOLO boxes expects them: five values a
line. Sets for YOLO's pose estimation with one keypoint (`class cx cy w h x y visibility`, visibility 0: not marked) are
read as well. In COCO's layout it is the keypoint `ground_point` of its category.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from standoff.core.boxes import unknown_points
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.files.plain_text import read_text

POINTS_FOLDER: Final = "points"
"""Of a YOLO data set, beside `images` and `labels`."""
KEYPOINT: Final = "ground_point"
"""Its name among the keypoints of a category in COCO's layout."""
NO_POINTS: Final = unknown_points(0)


def one_point_a_box(foot_px: FloatArray, xyxy_px: FloatArray) -> FloatArray:
    """Return (N, 2) points, NaN for all N boxes where none were given.

    Raises:
        ValueError: There are points, but another number than boxes.
    """
    if len(foot_px) == len(xyxy_px):
        return foot_px
    if len(foot_px):
        raise ValueError(f"{len(foot_px)} ground points of {len(xyxy_px)} boxes")
    return unknown_points(len(xyxy_px))


def points_line(foot_px: FloatArray, size_px: tuple[int, int]) -> str:
    r"""Return the line of one point (2,) of a picture (width, height).

    >>> points_line(np.array([9.5, -0.5]), (20, 10))
    '0.500000 0.000000\n'
    """
    x, y = ((foot_px + 0.5) / size_px).tolist()
    return f"{x:.6f} {y:.6f}\n"


def read_points(path: Path, count: int, size_px: tuple[int, int]) -> FloatArray:
    """Read the points of a picture.

    Args:
        path: Text file, a point a line.
        count: How many boxes the picture has.
        size_px: (width, height) of the picture.

    Returns:
        (count, 2) in pixels, 0 the centre of the first; NaN where there is none.

    Raises:
        ValueError: It does not hold so many points; says what it holds.
    """
    try:
        rows = [line.split() for line in read_text(path, "ground points").splitlines() if line.strip()]
        if any(len(row) != 2 for row in rows):
            raise ValueError("a line that is not two numbers")
        shares = np.array(rows, dtype=np.float64).reshape(-1, 2)
    except DataError as error:
        raise ValueError(f"no text ({error.found})") from error
    if len(shares) != count:
        raise ValueError(f"{len(shares)} points of {count} boxes")
    return in_pixels(shares, size_px)


def in_pixels(shares: FloatArray, size_px: tuple[int, int]) -> FloatArray:
    """Return (N, 2) shares of a picture as pixels; NaN where one of the two is not finite.

    >>> in_pixels(np.array([[0.5, 0.0], [np.nan, 0.5]]), (20, 10)).tolist()
    [[9.5, -0.5], [nan, nan]]
    """
    known = np.isfinite(shares).all(axis=1, keepdims=True)
    return np.where(known, shares * size_px - 0.5, np.nan)
