"""Where entities are in the picture (the paper's ALE, Table 3) and, beyond the paper, on the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.clips import Clip, TrueReference
from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff.evaluation.paper.metrics import ale_m
from standoff.evaluation.paper.monitored_clip import MonitoredClip
from standoff.stages.ground import ReferenceShape, rectified_scale_m_per_px


@dataclass(frozen=True, slots=True)
class ClassLocalisation:
    """Localisation of one class; counts are frames of all its entities.

    Attributes:
        class_name: As in `CLASSES`.
        visible: In which an entity can be seen.
        detected: Of these, detected.
        located: Of these, with a position on the ground.
        ale_m: Eq. 3 over the detected ones; NaN without.
        map_mean_m: Mean distance on the ground that the map alone makes: the middle of the true footprint, where the
            picture shows it, through the map, from where it really is; NaN without.
        position_mean_m: Mean distance of the position from the middle of the true footprint; NaN without.
        position_median_m: Median of the same.
        position_p95_m: 95th percentile of the same.
    """

    class_name: str
    visible: int
    detected: int
    located: int
    ale_m: float
    map_mean_m: float
    position_mean_m: float
    position_median_m: float
    position_p95_m: float


def true_scale_m_per_px(reference: TrueReference) -> FloatArray:
    """Return (F,) Eq. 3's metres a pixel: Eq. 6's scale from the reference's true corners; NaN where none are known."""
    shape = ReferenceShape.from_corners(reference.corners_m)
    return np.array([rectified_scale_m_per_px(corners_px, shape) for corners_px in reference.corners_px])


def score_localisation(clip: Clip, monitored: MonitoredClip) -> tuple[ClassLocalisation, ...]:
    """Score every class that the clip shows."""
    assert clip.reference is not None
    scale = true_scale_m_per_px(clip.reference)
    return tuple(_score_class(clip, monitored, int(class_id), scale) for class_id in np.unique(clip.class_id))


def _score_class(clip: Clip, monitored: MonitoredClip, class_id: int, scale_m_per_px: FloatArray) -> ClassLocalisation:
    own = clip.class_id == class_id
    true_px, detected_px = clip.box_px[:, own], monitored.detected_px[:, own]
    visible = np.isfinite(true_px).all(axis=2)
    detected = visible & np.isfinite(detected_px).all(axis=2)
    scale = np.broadcast_to(scale_m_per_px[:, None], detected.shape)
    scored = detected & np.isfinite(scale)
    located = visible & np.isfinite(monitored.xy_m[:, own]).all(axis=2)
    map_error_m = np.linalg.norm(monitored.true_feet.xy_m[:, own] - clip.xy_m[:, own], axis=2)
    map_error_m = map_error_m[located & np.isfinite(map_error_m)]
    error_m = np.linalg.norm(monitored.xy_m[:, own] - clip.xy_m[:, own], axis=2)
    error_m = error_m[located]
    return ClassLocalisation(
        class_name=CLASSES[class_id].name,
        visible=int(visible.sum()),
        detected=int(detected.sum()),
        located=len(error_m),
        ale_m=ale_m(scale[scored], _centre(true_px[scored]), _centre(detected_px[scored])) if scored.any() else np.nan,
        map_mean_m=float(map_error_m.mean()) if len(map_error_m) else np.nan,
        position_mean_m=float(error_m.mean()) if len(error_m) else np.nan,
        position_median_m=float(np.median(error_m)) if len(error_m) else np.nan,
        position_p95_m=float(np.percentile(error_m, 95)) if len(error_m) else np.nan,
    )


def _centre(box_px: FloatArray) -> FloatArray:
    return (box_px[:, :2] + box_px[:, 2:]) / 2.0
