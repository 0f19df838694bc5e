"""Which detection found which labelled thing, picture by picture: the surest chooses first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from standoff.core.boxes import areas_px2, overlaps, shared_px2
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import Detections, IntArray
from standoff.labels.types import LabelledPicture

NOTHING = -1
IGNORED_SHARE = 0.5
"""A detection with this much of its own area inside an ignored region says nothing about the detector."""


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """What every detection met; detections (D) and truths (T) of all pictures, picture after picture.

    Attributes:
        xyxy_px: (D, 4) of detections, surest first within a picture.
        score: (D,).
        class_id: (D,).
        picture: (D,) position of its picture.
        truth_row: (D,) the truth that it found, -1 for none.
        iou: (D,) intersection over union with it, 0 without.
        neutral: (D,) True where it found no truth but lies in an ignored region: it counts neither way.
        truth_px: (T, 4) what is to be found, ignored regions left out.
        truth_class_id: (T,).
        truth_picture: (T,).
        pictures: How many.
        foot_px: (D, 2) ground points of detections; NaN where there is none.
        foot_covariance_px2: (D, 2, 2) of them as the detector states it; NaN with it.
        truth_foot_px: (T, 2) true ground points; NaN where none is marked.
    """

    xyxy_px: FloatArray
    score: FloatArray
    class_id: IntArray
    picture: IntArray
    truth_row: IntArray
    iou: FloatArray
    neutral: BoolArray
    truth_px: FloatArray
    truth_class_id: IntArray
    truth_picture: IntArray
    pictures: int
    foot_px: FloatArray
    foot_covariance_px2: FloatArray
    truth_foot_px: FloatArray


def match_detections(truth: Sequence[LabelledPicture], found: Sequence[Detections], iou: float) -> Matches:
    """Match detections with truths of their class, the surest first, each with the free truth that it overlaps most.

    That is COCO's rule. VOC's differs where a detection overlaps a taken truth most and a free one enough: VOC calls
    it wrong, COCO gives it the free one.

    Args:
        truth: Pictures.
        found: What was detected in each; class ids as the truth's.
        iou: Least intersection over union, above 0.

    Raises:
        ValueError: There is another number of detections than of pictures.
    """
    rows, owned, best_iou, neutral, orders, taken = [], [], [], [], [], 0
    for picture, detections in zip(truth, found, strict=True):
        order = np.argsort(-detections.score, kind="stable")
        boxes_px, class_id = detections.xyxy_px[order], detections.class_id[order]
        real = ~picture.ignored
        similarity = overlaps(boxes_px, picture.xyxy_px[real])
        similarity *= class_id[:, None] == picture.class_id[real]
        row = _choose(similarity, iou)
        matched = row != NOTHING
        best = np.zeros(len(row))
        best[matched] = similarity[matched, row[matched]]
        inside = (_shares_inside(boxes_px, picture.xyxy_px[picture.ignored]) >= IGNORED_SHARE).any(axis=1)
        rows.append(np.where(matched, row + taken, NOTHING))
        owned.append(real)
        best_iou.append(best)
        neutral.append(inside & ~matched)
        orders.append(order)
        taken += int(real.sum())
    return Matches(
        xyxy_px=_joined([one.xyxy_px[order] for one, order in zip(found, orders, strict=True)], (0, 4)),
        score=_joined([one.score[order] for one, order in zip(found, orders, strict=True)]),
        class_id=_joined([one.class_id[order] for one, order in zip(found, orders, strict=True)]).astype(np.int64),
        picture=np.repeat(np.arange(len(truth)), [len(order) for order in orders]),
        truth_row=_joined(rows).astype(np.int64),
        iou=_joined(best_iou),
        neutral=_joined(neutral).astype(np.bool_),
        truth_px=_joined([one.xyxy_px[real] for one, real in zip(truth, owned, strict=True)], (0, 4)),
        truth_class_id=_joined([one.class_id[real] for one, real in zip(truth, owned, strict=True)]).astype(np.int64),
        truth_picture=np.repeat(np.arange(len(truth)), [int(real.sum()) for real in owned]),
        pictures=len(truth),
        foot_px=_joined([one.foot_px[order] for one, order in zip(found, orders, strict=True)], (0, 2)),
        foot_covariance_px2=_joined(
            [one.foot_covariance_px2[order] for one, order in zip(found, orders, strict=True)], (0, 2, 2)
        ),
        truth_foot_px=_joined([one.foot_px[real] for one, real in zip(truth, owned, strict=True)], (0, 2)),
    )


def _joined(parts: Sequence[FloatArray | IntArray | BoolArray], empty: tuple[int, ...] = (0,)) -> FloatArray:
    return np.concatenate([np.zeros(empty), *parts])


def _choose(similarity: FloatArray, least: float) -> IntArray:
    """Return (N,) the column that each row takes, row after row, or -1."""
    rows, columns = np.nonzero(similarity >= least)
    most_alike = np.lexsort((-similarity[rows, columns], rows))
    chosen = np.full(len(similarity), NOTHING, dtype=np.int64)
    taken: set[int] = set()
    for row, column in zip(rows[most_alike].tolist(), columns[most_alike].tolist(), strict=True):
        if chosen[row] == NOTHING and column not in taken:
            chosen[row] = column
            taken.add(column)
    return chosen


def _shares_inside(boxes_px: FloatArray, regions_px: FloatArray) -> FloatArray:
    """Return (N, M) the part of each box's area that lies in each region."""
    area = areas_px2(boxes_px)[:, None]
    shares: FloatArray = shared_px2(boxes_px, regions_px) / np.where(area > 0.0, area, 1.0)
    return shares
