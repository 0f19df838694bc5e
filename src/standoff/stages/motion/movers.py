"""Where people and machines are, so that they are not taken for ground."""

from __future__ import annotations

import numpy as np

from standoff.core import homography
from standoff.core.classes import Role, class_ids
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import Detections
from standoff.stages.motion.params import MotionParams

_FIXED = np.array(class_ids(Role.REFERENCE))


class Movers:
    """The boxes of what may move by itself; between two looks of the detector the last ones, growing.

    Nothing says whether the detector rested or saw nothing at all, so that the last boxes stay in both cases.
    """

    def __init__(self, params: MotionParams) -> None:
        self._params = params
        self.forget()

    def forget(self) -> None:
        """Know of nothing that moves."""
        self._xyxy_px = np.zeros((0, 4))
        self._seen_s = -np.inf
        self._fresh = False

    def look(self, time_s: float, detections: Detections, step: FloatArray | None) -> FloatArray:
        """Return (M, 4) boxes in frame pixels inside which nothing is ground.

        Args:
            time_s: Of the frame.
            detections: Of the frame; empty where the detector rested.
            step: (3, 3) how the ground is expected to move from the frame before to this one; None if unknown.
        """
        params = self._params
        if len(detections):
            moves = (detections.class_id[:, None] != _FIXED).all(axis=1) & (detections.score >= params.mover_score)
            self._xyxy_px, self._seen_s = detections.xyxy_px[moves], time_s
            self._fresh = True
        else:
            self._fresh = False
        unseen_s = time_s - self._seen_s
        if not 0.0 <= unseen_s <= params.mover_memory_s:
            self.forget()
            return self._xyxy_px
        boxes = self._xyxy_px if self._fresh or step is None else _carried(self._xyxy_px, step)
        extent = boxes[:, 2:] - boxes[:, :2]
        sizes = np.sqrt(extent.prod(axis=1, keepdims=True))
        grow = params.mover_margin * extent + params.mover_growth * unseen_s * sizes
        return np.concatenate([boxes[:, :2] - grow, boxes[:, 2:] + grow], axis=1)

    def carry(self, step: FloatArray) -> None:
        """Take boxes from before along with the ground, to this frame, after `look`.

        Args:
            step: (3, 3) how the ground moved from the frame before to this one, frame pixels.
        """
        if not self._fresh:
            self._xyxy_px = _carried(self._xyxy_px, step)


def _carried(xyxy_px: FloatArray, step: FloatArray) -> FloatArray:
    """Return the boxes around the moved corners; boxes that leave the plane's visible side are dropped."""
    left, top, right, bottom = xyxy_px.T
    corners = np.stack([left, top, right, top, right, bottom, left, bottom], axis=1).reshape(-1, 2)
    moved, valid = homography.apply(step, corners)
    moved = moved.reshape(-1, 4, 2)[valid.reshape(-1, 4).all(axis=1)]
    return np.concatenate([moved.min(axis=1), moved.max(axis=1)], axis=1)


def inside(points_px: FloatArray, boxes_px: FloatArray) -> BoolArray:
    """Return (N,) which of (N, 2) points lie in any of (M, 4) boxes.

    >>> inside(np.array([[1.0, 1.0], [5.0, 1.0]]), np.array([[0.0, 0.0, 2.0, 2.0]]))
    array([ True, False])
    """
    within = (points_px[:, None] >= boxes_px[:, :2]) & (points_px[:, None] <= boxes_px[:, 2:])
    covered: BoolArray = np.any(np.all(within, axis=2), axis=1)
    return covered
