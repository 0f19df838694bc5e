"""Ground points of candidates, in the picture."""

from __future__ import annotations

import numpy as np

from standoff.core.boxes import unknown_points
from standoff.core.homography import FloatArray
from standoff.stages.detect.candidates import Candidates
from standoff.stages.detect.letterbox import Letterbox


def feet_of(candidates: Candidates, letterbox: Letterbox) -> tuple[FloatArray, FloatArray]:
    """Carry ground points to the picture.

    Args:
        candidates: Of a network, with points or without.
        letterbox: Where the picture lies in the network's input.

    Returns:
        (N, 2) points in picture pixels and (N, 2, 2) their covariances; NaN where the network gives none.
    """
    count = len(candidates.xyxy_px)
    if len(candidates.foot_px) != count:
        return unknown_points(count), np.full((count, 2, 2), np.nan)
    variance_px2 = (candidates.foot_sigma_px * letterbox.source_px_per_input_px) ** 2
    return letterbox.points_to_source(candidates.foot_px), variance_px2[:, :, None] * np.eye(2)
