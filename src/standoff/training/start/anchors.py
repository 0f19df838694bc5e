"""Anchors from the sizes of labelled boxes.

Source:
    Redmon and Farhadi, YOLO9000, 2017, section 2 ("dimension clusters": k-means with distance 1 - IoU), and YOLOv3,
    2018, section 2.3 (sorted by size, spread over the scales).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from standoff.core.errors import DataError
from standoff.core.homography import FloatArray

_RESTARTS: Final = 5
_MAX_ROUNDS: Final = 100
_ENOUGH_BOXES: Final = 4000
"""A random choice of so many stands for all: more make it slow and change the anchors by less than a restart does."""
_SPREAD_OF_DOUBLES: Final = 1.3
"""From one anchor to the next where the data has fewer sizes than anchors are wanted: an IoU of 0.6 between them."""


def overlap_of_sizes(sizes_px: FloatArray, anchors_px: FloatArray) -> FloatArray:
    """Return the IoU of boxes and anchors that share their centre.

    Args:
        sizes_px: (N, 2) width, height.
        anchors_px: (K, 2) width, height.

    Returns:
        (N, K).

    >>> overlap_of_sizes(np.array([[2.0, 4.0]]), np.array([[2.0, 2.0], [4.0, 4.0]]))
    array([[0.5, 0.5]])
    """
    common_px2 = np.prod(np.minimum(sizes_px[:, None], anchors_px[None]), axis=-1)
    overlap: FloatArray = common_px2 / (sizes_px.prod(axis=1)[:, None] + anchors_px.prod(axis=1)[None] - common_px2)
    return overlap


def mean_best_iou(sizes_px: FloatArray, anchors_px: FloatArray) -> float:
    """Return the mean over boxes of the IoU with the anchor that suits each best: how good the anchors are.

    Args:
        sizes_px: (N, 2) width, height; at least one.
        anchors_px: (K, 2) width, height.

    >>> mean_best_iou(np.array([[2.0, 4.0], [3.0, 3.0]]), np.array([[2.0, 2.0], [3.0, 3.0]]))
    0.772...
    """
    return float(overlap_of_sizes(sizes_px, anchors_px).max(axis=1).mean())


def cluster_anchors(sizes_px: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """Find anchors by k-means with distance 1 - IoU: the best of several starts, with medians as centres.

    Where the boxes have fewer different sizes than anchors are wanted, the rest are those sizes made larger, step by
    step, so that no two anchors are alike.

    Args:
        sizes_px: (N, 2) width, height of boxes in network input pixels.
        count: Number of anchors.
        rng: For the starts.

    Returns:
        (count, 2) width, height, sorted by area.

    Raises:
        DataError: No box, or a side that is not positive.
    """
    if len(sizes_px) == 0 or not (sizes_px > 0).all():
        raise DataError(
            expected="labelled boxes with positive sides, to find anchors",
            found="none" if len(sizes_px) == 0 else f"a side of {sizes_px.min():g} px",
            fix="check the labels",
        )
    if len(sizes_px) > _ENOUGH_BOXES:
        sizes_px = rng.choice(sizes_px, _ENOUGH_BOXES, replace=False)
    distinct = np.unique(sizes_px, axis=0)
    if len(distinct) <= count:
        anchors = _multiplied(distinct, count)
    else:
        tries = [_k_means(sizes_px, _distant_starts(distinct, count, rng)) for _ in range(_RESTARTS)]
        anchors = max(tries, key=lambda found: mean_best_iou(sizes_px, found))
    return anchors[np.argsort(anchors.prod(axis=1), kind="stable")]


def _multiplied(distinct_px: FloatArray, count: int) -> FloatArray:
    steps = np.arange(count) // len(distinct_px)
    chosen: FloatArray = distinct_px[np.arange(count) % len(distinct_px)] * _SPREAD_OF_DOUBLES ** steps[:, None]
    return chosen


def _distant_starts(distinct_px: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """Draw starts far from each other (Arthur and Vassilvitskii, k-means++, 2007), all different."""
    chosen = [int(rng.integers(len(distinct_px)))]
    while len(chosen) < count:
        distance = 1.0 - overlap_of_sizes(distinct_px, distinct_px[chosen]).max(axis=1)
        weight = np.square(distance)
        weight[chosen] = 0.0
        chosen.append(int(rng.choice(len(distinct_px), p=weight / weight.sum())))
    return distinct_px[chosen]


def _k_means(sizes_px: FloatArray, anchors_px: FloatArray) -> FloatArray:
    anchors_px = anchors_px.copy()
    nearest = np.full(len(sizes_px), -1)
    for _ in range(_MAX_ROUNDS):
        overlap = overlap_of_sizes(sizes_px, anchors_px)
        before, nearest = nearest, overlap.argmax(axis=1)
        if (nearest == before).all():
            break
        worst_first = iter(np.argsort(overlap.max(axis=1), kind="stable"))
        for cluster in range(len(anchors_px)):
            own = sizes_px[nearest == cluster]
            anchors_px[cluster] = np.median(own, axis=0) if len(own) else sizes_px[next(worst_first)]
    return anchors_px


def spread_over_heads(anchors_px: FloatArray, heads: int) -> tuple[tuple[tuple[float, float], ...], ...]:
    """Give each head its share of the anchors, the smallest to the finest.

    Args:
        anchors_px: (K, 2) width, height, sorted by area.
        heads: Number of heads; where it does not divide K, finer heads get one more.

    Returns:
        Anchors of each head, heads from fine to coarse, to a tenth of a pixel.

    >>> spread_over_heads(np.array([[4.0, 8.0], [9.0, 9.0], [30.0, 20.0]]), 2)
    (((4.0, 8.0), (9.0, 9.0)), ((30.0, 20.0),))
    """
    shares: Sequence[FloatArray] = np.array_split(np.round(anchors_px, 1), heads)
    return tuple(tuple((float(width), float(height)) for width, height in share) for share in shares)
