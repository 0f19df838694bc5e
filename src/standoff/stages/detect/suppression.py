"""One box for each thing: suppress duplicates, join what slices cut apart, prefer what was seen larger."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from standoff.core.boxes import areas_px2, overlaps, shared_px2
from standoff.core.homography import BoolArray
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


def prefer_finer(
    detections: Detections, is_coarse: BoolArray, is_fine: BoolArray, least_iou: float
) -> tuple[Detections, BoolArray]:
    """Let coarsely seen boxes give way to finely seen ones of the same thing.

    A thing of few pixels gets so rough a box that it overlaps its finer box too little to be suppressed as its
    duplicate. The finer box stays where it is, with the higher score of the two.

    Args:
        detections: Boxes of all views, without zero areas.
        is_coarse: (N,) True for those that may give way.
        is_fine: (N,) True for those that they give way to.
        least_iou: Overlap from which two boxes of a class are the same thing.

    Returns:
        The detections with the scores, and (N,) False for those that gave way.
    """
    coarse, fine = np.flatnonzero(is_coarse), np.flatnonzero(is_fine)
    kept, score = np.ones(len(detections), dtype=np.bool_), detections.score.copy()
    if not len(coarse) or not len(fine):
        return detections, kept
    boxes = detections.xyxy_px
    iou = overlaps(boxes[coarse], boxes[fine])
    iou[detections.class_id[coarse][:, None] != detections.class_id[fine]] = 0.0
    nearest = iou.argmax(axis=1)
    gives_way = iou[np.arange(len(coarse)), nearest] >= least_iou
    np.maximum.at(score, fine[nearest[gives_way]], detections.score[coarse[gives_way]])
    kept[coarse[gives_way]] = False
    return replace(detections, score=score), kept


def join_cut(detections: Detections, cut: BoolArray, least_overlap: float) -> Detections:
    """Let boxes take in the pieces of themselves that slices cut off.

    A piece is a cut box of the same class that overlaps a larger box by at least `least_overlap` of the
    smaller of the two. The larger box takes the higher score; if it is a piece itself, it grows around
    the other, and the surest of their ground points is that of all. Boxes that no slice cut are never taken in:
    a worker in front of another stays.

    Args:
        detections: Boxes of all views, without zero areas.
        cut: (N,) True for boxes that end at a slice's border inside the frame.
        least_overlap: Intersection over the smaller area.

    Returns:
        The remaining boxes, largest first.
    """
    largest_first = np.argsort(-areas_px2(detections.xyxy_px), kind="stable")
    detections, cut = detections[largest_first], cut[largest_first]
    boxes, score = detections.xyxy_px.copy(), detections.score.copy()
    doubt_px2 = np.nan_to_num(np.trace(detections.foot_covariance_px2, axis1=1, axis2=2), nan=np.inf)
    surest = np.arange(len(detections))
    kept = np.ones(len(detections), dtype=np.bool_)
    pieces = np.flatnonzero(cut)
    smaller = np.minimum(areas_px2(boxes)[:, None], areas_px2(boxes[pieces]))
    is_piece_of = shared_px2(boxes, boxes[pieces]) / smaller >= least_overlap
    is_piece_of &= detections.class_id[:, None] == detections.class_id[pieces]
    is_piece_of &= pieces > np.arange(len(boxes))[:, None]
    for index in np.flatnonzero(is_piece_of.any(axis=1)):
        own = pieces[is_piece_of[index] & kept[pieces]]
        if not kept[index] or not len(own):
            continue
        kept[own] = False
        score[index] = max(score[index], score[own].max())
        if cut[index]:
            boxes[index, :2] = np.minimum(boxes[index, :2], boxes[own, :2].min(axis=0))
            boxes[index, 2:] = np.maximum(boxes[index, 2:], boxes[own, 2:].max(axis=0))
            together = np.append(index, own)
            surest[index] = together[doubt_px2[together].argmin()]
    feet = {name: getattr(detections, name)[surest] for name in ("foot_px", "foot_covariance_px2")}
    return replace(detections, xyxy_px=boxes, score=score, **feet)[kept]
