"""The paper's average localisation error of a detector, where the truth is known in metres."""

from __future__ import annotations

import numpy as np

from standoff.evaluation.detection.material import Material
from standoff.evaluation.detection.score import DetectionScore, right_from
from standoff.evaluation.paper.localisation import true_scale_m_per_px
from standoff.evaluation.paper.metrics import ale_m


def ale_by_class_m(score: DetectionScore, material: Material) -> dict[str, float]:
    """Return Eq. 3 by class over the right detections at each class's threshold; empty without truth in metres.

    Args:
        score: On this material.
        material: Of a simulated clip, or not.

    Source:
        Paper, section 4.2, Eq. 3, with Eq. 6's scale from the reference's true corners.
    """
    if material.clip is None or material.clip.reference is None:
        return {}
    matches = score.matches
    scale = true_scale_m_per_px(material.clip.reference)[material.frame_index][matches.picture]
    errors_m = {}
    for class_id, one in enumerate(score.classes):
        rows = np.flatnonzero(right_from(matches, class_id, one.threshold) & np.isfinite(scale))
        if len(rows):
            boxes_px = np.stack([matches.truth_px[matches.truth_row[rows]], matches.xyxy_px[rows]])
            true_px, found_px = (boxes_px[..., :2] + boxes_px[..., 2:]) / 2.0
            errors_m[one.name] = ale_m(scale[rows], true_px, found_px)
    return errors_m
