"""How small a worker a detector finds: what its file should say of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.optimize import isotonic_regression

from standoff.core.classes import CLASSES, Role
from standoff.core.finding import WorkerFinding
from standoff.core.homography import FloatArray
from standoff.core.types import Detections
from standoff.evaluation.detection.matching import NOTHING, match_detections
from standoff.labels.types import LabelledPicture
from standoff.stages.track import TrackParams

WORKER: Final = next(site_class.name for site_class in CLASSES if site_class.role is Role.PERSON)

_IOU: Final = 0.3
"""A box that is as loose as this still tells who is there."""
_HEIGHTS_PX: Final = (8.0, 12.0, 17.0, 24.0, 34.0, 48.0, 68.0, 96.0, 136.0)
_FEWEST: Final = 20


def measure_finding(
    truth: Sequence[LabelledPicture],
    found: Sequence[Detections],
    classes: Sequence[str],
    detector: WorkerFinding,
) -> WorkerFinding:
    """Count which of the workers are found, in one picture each, as sure as a track asks for.

    Bands of height a factor of the root of 2 wide are made to rise with the height, as few workers in one of them would
    else make it fall (isotonic regression: Barlow et al. 1972), and bands of fewer than 20 workers join the next.

    Args:
        truth: Pictures.
        found: What was detected in each; `class_id` is a position in `classes`, as in the truth.
        classes: Names.
        detector: Its input size and views.

    Returns:
        The detector's with what was measured; `measured` is False where there are not 20 workers in one band.
    """
    if WORKER not in classes:
        return detector
    worker, least = list(classes).index(WORKER), TrackParams().high_score
    matches = match_detections(truth, [one[one.score >= least] for one in found], _IOU)
    is_worker = matches.truth_class_id == worker
    is_found = np.zeros(len(is_worker), dtype=np.bool_)
    is_found[matches.truth_row[(matches.truth_row != NOTHING) & (matches.class_id == worker)]] = True
    scale = np.array([detector.picture_px_per_input_px(one.size_px) for one in truth])[matches.truth_picture]
    height_px = (matches.truth_px[:, 3] - matches.truth_px[:, 1]) / scale
    return _told(height_px[is_worker], is_found[is_worker], detector)


def _told(height_px: FloatArray, is_found: FloatArray, detector: WorkerFinding) -> WorkerFinding:
    edges = np.sqrt(np.multiply(_HEIGHTS_PX[:-1], _HEIGHTS_PX[1:]))
    band = np.searchsorted(edges, height_px)
    counts = np.bincount(band, minlength=len(_HEIGHTS_PX))
    shares = np.bincount(band, is_found, len(_HEIGHTS_PX)) / np.maximum(counts, 1)
    asked = counts >= _FEWEST
    if not asked.any():
        return detector
    rising = isotonic_regression(shares[asked], weights=counts[asked]).x
    heights = tuple(np.array(_HEIGHTS_PX)[asked].tolist())
    return detector.measured_as(heights, tuple(np.round(rising, 3).tolist()))
