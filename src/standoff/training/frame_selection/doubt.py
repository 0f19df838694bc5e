"""How unsure a detector is of a frame."""

from __future__ import annotations

import numpy as np

from standoff.core.boxes import overlaps
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import Detections

LEAST_SCORE = 0.05
"""Of boxes that the detector is to pass on: surer than most of what is nothing, and unsure enough to be asked about."""
_SAME_IOU = 0.3
"""Between two frames a tenth of a second apart, a walking person's box still overlaps itself by more."""


def doubt(score: FloatArray, threshold: float) -> FloatArray:
    """Return how undecided each score leaves whether there is something, 0 to 1.

    The entropy, in bits, of a coin whose chance is the score, stretched so that the threshold is one half.

    Args:
        score: (N,) 0 to 1.
        threshold: Score from which a box counts, above 0 and below 1.

    Source:
        Brust, Kaeding and Denzler, Active Learning for Deep Object Detection (2019), section 3: uncertainty of boxes
        is summed over the picture.

    >>> doubt(np.array([0.0, 0.3, 1.0]), 0.3)
    array([0., 1., 0.])
    """
    below, above = 0.5 * score / threshold, 0.5 + 0.5 * (score - threshold) / (1.0 - threshold)
    chance = np.clip(np.where(score < threshold, below, above), 0.0, 1.0)
    other = 1.0 - chance
    bits: FloatArray = -(chance * np.log2(np.maximum(chance, 1e-300)) + other * np.log2(np.maximum(other, 1e-300)))
    return np.abs(bits)


def flickering(now: Detections, next_one: Detections, threshold: float) -> BoolArray:
    """Tell which boxes that count now have no counterpart of their class in the next frame, not even an unsure one.

    Args:
        now: Of one frame, unsure boxes included.
        next_one: Of the frame right after it.
        threshold: Score from which a box counts.

    Returns:
        (N,).
    """
    same = (overlaps(now.xyxy_px, next_one.xyxy_px) >= _SAME_IOU) & (now.class_id[:, None] == next_one.class_id[None])
    lost: BoolArray = (now.score >= threshold) & ~same.any(axis=1)
    return lost
