"""What the detector was sure of and no track shows: whatever the tracker, it must not get lost without a word."""

from __future__ import annotations

from standoff.core.boxes import overlaps
from standoff.core.homography import BoolArray
from standoff.core.roles import REFERENCE_ROLE, ROLE_OF_CLASS
from standoff.core.types import Detections, Tracks

SURE_SCORE = 0.6
"""Clutter rarely reaches it."""

_SAME_THING = 0.25
"""Overlap (IoU) of a track's box, which may be filtered, with the detection that it follows."""

_MANY, _FEW = 0.25, 4


def unfollowed(detections: Detections, tracks: Tracks, least_score: float = SURE_SCORE) -> BoolArray:
    """Tell which of the detections that are sure lie in no track's box.

    Args:
        detections: Of one frame.
        tracks: Of the same frame, whatever made them.
        least_score: How sure.

    Returns:
        (K,) for each sure detection of a person or a machine.

    >>> import numpy as np
    >>> box, one = np.array([[10.0, 10.0, 20.0, 40.0]]), np.zeros(1, dtype=np.int64)
    >>> unfollowed(Detections(box, np.array([0.9]), one), Tracks.empty())
    array([ True])
    """
    sure = detections[(detections.score >= least_score) & (ROLE_OF_CLASS[detections.class_id] != REFERENCE_ROLE)]
    same_role = ROLE_OF_CLASS[sure.class_id][:, None] == ROLE_OF_CLASS[tracks.class_id]
    followed = same_role & (overlaps(sure.xyxy_px, tracks.xyxy_px) >= _SAME_THING)
    lost: BoolArray = ~followed.any(axis=1)
    return lost


def are_many(count: int, of: int) -> bool:
    """Tell whether so many of the sure detections are too many to be what new tracks and clutter leave behind.

    >>> are_many(3, 3), are_many(10, 1000), are_many(30, 100)
    (False, False, True)
    """
    return count >= _FEW and count > _MANY * of
