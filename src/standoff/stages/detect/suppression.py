"""One box for each thing: suppress duplicates, and join what slices cut apart."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import Detections


def suppress(detections: Detections, iou: float, limit: int) -> Detections:
    """Keep the surest of overlapping boxes of one class, and at most `limit` boxes, surest first.

    Args:
        detections: Any order.
        iou: Boxes whose intersection over union is larger are duplicates.
        limit: Most boxes kept.
    """
    if not len(detections):
        return detections
    xywh = detections.xyxy_px.copy()
    xywh[:, 2:] -= xywh[:, :2]
    kept = np.asarray(
        cv2.dnn.NMSBoxesBatched(
            xywh.tolist(),
            detections.score.tolist(),
            detections.class_id.tolist(),
            score_threshold=-1.0,
            nms_threshold=iou,
        ),
        dtype=np.int64,
    )
    surest_first = kept[np.argsort(-detections.score[kept], kind="stable")]
    return detections[surest_first[:limit]]


def _areas(xyxy: FloatArray) -> FloatArray:
    areas: FloatArray = (xyxy[..., 2] - xyxy[..., 0]) * (xyxy[..., 3] - xyxy[..., 1])
    return areas


def _overlap_of_smaller(box: FloatArray, boxes: FloatArray) -> FloatArray:
    corners = np.concatenate([np.maximum(box[:2], boxes[:, :2]), np.minimum(box[2:], boxes[:, 2:])], axis=1)
    corners[:, 2:] = np.maximum(corners[:, 2:], corners[:, :2])
    overlap: FloatArray = _areas(corners) / np.minimum(_areas(box), _areas(boxes))
    return overlap


def join_cut(detections: Detections, cut: BoolArray, least_overlap: float) -> Detections:
    """Let boxes take in the pieces of themselves that slices cut off.

    A piece is a cut box of the same class that overlaps a larger box by at least `least_overlap` of the
    smaller of the two. The larger box takes the higher score; if it is a piece itself, it grows around
    the other. Boxes that no slice cut are never taken in: a worker in front of another stays.

    Args:
        detections: Boxes of all views, without zero areas.
        cut: (N,) True for boxes that end at a slice's border inside the frame.
        least_overlap: Intersection over the smaller area.

    Returns:
        The remaining boxes, largest first.
    """
    largest_first = np.argsort(-_areas(detections.xyxy_px), kind="stable")
    detections, cut = detections[largest_first], cut[largest_first]
    boxes, score = detections.xyxy_px.copy(), detections.score.copy()
    kept = np.ones(len(detections), dtype=np.bool_)
    for index in range(len(detections)):
        if not kept[index]:
            continue
        pieces = cut & kept & (detections.class_id == detections.class_id[index])
        pieces[: index + 1] = False
        pieces[pieces] = _overlap_of_smaller(boxes[index], boxes[pieces]) >= least_overlap
        if not pieces.any():
            continue
        kept &= ~pieces
        score[index] = max(score[index], score[pieces].max())
        if cut[index]:
            boxes[index, :2] = np.minimum(boxes[index, :2], boxes[pieces, :2].min(axis=0))
            boxes[index, 2:] = np.maximum(boxes[index, 2:], boxes[pieces, 2:].max(axis=0))
    return replace(detections, xyxy_px=boxes, score=score)[kept]
