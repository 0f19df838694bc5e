"""Where the keyframe's points are in another picture: Lucas-Kanade, there and back."""

from __future__ import annotations

import cv2
import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import ImageArray

_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 0.01)


def follow_points(
    before: ImageArray,
    now: ImageArray,
    points_px: FloatArray,
    start_px: FloatArray,
    *,
    window_px: int,
    levels: int,
    round_trip_px: float,
) -> tuple[FloatArray, BoolArray]:
    """Find points of one picture in another.

    Args:
        before: (H, W) uint8.
        now: (H, W) uint8.
        points_px: (N, 2) in `before`.
        start_px: (N, 2) where in `now` to begin looking.
        window_px: Side of the patch that is compared.
        levels: How often both pictures are halved first; each doubles how far off the start may be.
        round_trip_px: How near a point must come to where it began when followed back.

    Returns:
        (N, 2) in `now`, and (N,) which of them came back.

    Source:
        Bouguet, Pyramidal Implementation of the Lucas Kanade Feature Tracker (2001); the way back as in Kalal et al.,
        Forward-Backward Error (2010).
    """
    if not len(points_px):
        return np.zeros((0, 2)), np.zeros(0, dtype=np.bool_)
    begin = points_px.astype(np.float32, order="C").reshape(-1, 1, 2)
    guess = start_px.astype(np.float32, order="C").reshape(-1, 1, 2)
    window = (window_px, window_px)
    end, found, _ = cv2.calcOpticalFlowPyrLK(
        before, now, begin, guess, None, None, window, levels, _CRITERIA, cv2.OPTFLOW_USE_INITIAL_FLOW
    )
    # The way back starts where it should end, so that it needs no pyramid.
    back, returned, _ = cv2.calcOpticalFlowPyrLK(
        now, before, end, begin.copy(), None, None, window, 0, _CRITERIA, cv2.OPTFLOW_USE_INITIAL_FLOW
    )
    near = np.linalg.norm(back - begin, axis=2).ravel() <= round_trip_px
    good: BoolArray = near & (found.ravel() == 1) & (returned.ravel() == 1)
    return end[:, 0].astype(np.float64), good
