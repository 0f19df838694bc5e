"""Follows the reference's box from frame to frame where no detector sees it."""

from __future__ import annotations

import cv2
import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray, IntArray

_MAX_POINTS = 80
_MIN_POINTS = 8
_MIN_INLIERS = 0.5
_ROUND_TRIP_PX = 0.7
_MAX_RESIDUAL_PX = 2.0
_MAX_SCALE_STEP = 1.3
_REACH = 1.0
"""Searched around the box, in its own sizes: it may move by about as much from one frame to the next."""

_MARGIN = 0.15
"""The surroundings that are followed with the reference: ground, mostly, that moves with it."""


class BoxFollower:
    """Carries points of one picture along to the next by optical flow; its state is one earlier picture.

    A frame in which the reference is lost leaves the state as it is, so that the next frame is compared with the
    last good one: an occlusion that ends is survived.
    """

    def __init__(self) -> None:
        self._gray: ImageArray | None = None
        self._box: FloatArray = np.zeros(4)

    def start(self, gray: ImageArray, box_xyxy_px: FloatArray) -> None:
        """Begin, or begin again, with a box known in this picture."""
        self._gray, self._box = gray, np.asarray(box_xyxy_px, dtype=np.float64)

    def follow(self, gray: ImageArray) -> FloatArray | None:
        """Find where the box went.

        Args:
            gray: (H, W) the next picture, of the same size.

        Returns:
            (2, 3) similarity from the last good picture's pixels to this one's, or None if the box is lost.

        Source:
            Lucas-Kanade with forward-backward check (Kalal et al. 2010), then RANSAC over similarities.
        """
        if self._gray is None or self._gray.shape != gray.shape:
            return None
        x0, y0, x1, y1 = self._window(_REACH, gray)
        before, now = self._gray[y0:y1, x0:x1], gray[y0:y1, x0:x1]
        if before.size == 0:
            return None
        motion = _similarity(before, now, self._window(_MARGIN, gray) - np.array([x0, y0, x0, y0]))
        if motion is None:
            return None
        origin = np.array([x0, y0], dtype=np.float64)
        motion[:, 2] += origin - motion[:, :2] @ origin
        return motion

    def _window(self, reach: float, gray: ImageArray) -> IntArray:
        height, width = gray.shape
        grow = reach * float((self._box[2:] - self._box[:2]).max())
        window = np.rint(self._box + np.array([-grow, -grow, grow, grow])).astype(np.int64)
        clipped: IntArray = np.clip(window, 0, [width, height, width, height])
        return clipped


def moved_box(motion: FloatArray, box_xyxy_px: FloatArray) -> FloatArray:
    """Return the box carried along by a similarity: its centre moves, its size scales, it stays upright.

    >>> moved_box(np.array([[2.0, 0.0, 1.0], [0.0, 2.0, 0.0]]), np.array([0.0, 0.0, 2.0, 2.0])).tolist()
    [1.0, 0.0, 5.0, 4.0]
    """
    scale = float(np.hypot(motion[0, 0], motion[1, 0]))
    centre = motion[:, :2] @ ((box_xyxy_px[:2] + box_xyxy_px[2:]) / 2.0) + motion[:, 2]
    half = scale * (box_xyxy_px[2:] - box_xyxy_px[:2]) / 2.0
    return np.concatenate([centre - half, centre + half])


def _similarity(before: ImageArray, now: ImageArray, where_xyxy: IntArray) -> FloatArray | None:
    left, top, right, bottom = where_xyxy
    if right <= left or bottom <= top:
        return None
    start = cv2.goodFeaturesToTrack(before[top:bottom, left:right], _MAX_POINTS, 0.01, 4)
    if start is None or len(start) < _MIN_POINTS:
        return None
    start += np.array([left, top], dtype=np.float32)
    end, found, _ = cv2.calcOpticalFlowPyrLK(before, now, start, None)
    back, found_back, _ = cv2.calcOpticalFlowPyrLK(now, before, end, None)
    returned = np.linalg.norm(back - start, axis=2).ravel() <= _ROUND_TRIP_PX
    good = returned & (found.ravel() == 1) & (found_back.ravel() == 1)
    if good.sum() < max(_MIN_POINTS, _MIN_INLIERS * len(start)):
        return None
    motion, inliers = cv2.estimateAffinePartial2D(start[good], end[good], ransacReprojThreshold=_MAX_RESIDUAL_PX)
    if motion is None or inliers.sum() < max(_MIN_POINTS, _MIN_INLIERS * good.sum()):
        return None
    scale = float(np.hypot(motion[0, 0], motion[1, 0]))
    return np.asarray(motion, dtype=np.float64) if 1.0 / _MAX_SCALE_STEP <= scale <= _MAX_SCALE_STEP else None
