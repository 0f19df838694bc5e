"""How often the reference object was found, and how well: the paper's rectification failures, and section 8.2."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from standoff.clips import TrueReference
from standoff.core.homography import BoolArray, FloatArray
from standoff.evaluation.paper.monitored_clip import WRONG, MonitoredClip, is_wrong


@dataclass(frozen=True, slots=True)
class RectificationScore:
    """What became of the reference object in every frame.

    Attributes:
        frames: Of the clip.
        out_of_sight: Frames in which a corner is outside the picture, or nothing of the reference can be seen, and
            which have no map or one that was carried along from earlier frames.
        failed: All other frames without a map, and frames whose map has a corner more than 5 px off,
            whatever the outlier filter makes of them.
        wrong: The second kind alone.
        failed_covered: Failed frames in which something lies on it.
        failed_by_reason: Their causes.
        corner_rmse_px: Root mean squared distance of the corners of all other maps; NaN without.
        worst_corner_px: Largest distance over all maps, wrong ones included; NaN without.
        within_share: Frames whose four corners are all within 5 px, of all that are not out of sight; NaN without.
        median_s: Of finding the map.
    """

    frames: int
    out_of_sight: int
    failed: int
    wrong: int
    failed_covered: int
    failed_by_reason: Mapping[str, int]
    corner_rmse_px: float
    worst_corner_px: float
    within_share: float
    median_s: float


def score_rectification(monitored: MonitoredClip, reference: TrueReference) -> RectificationScore:
    """Count failures and measure the corners."""
    error_px = monitored.corner_error_px
    has_map = np.isfinite(monitored.scale_m_per_px)
    wrong = wrong_frames(monitored)
    right = has_map & ~wrong & ~monitored.carried
    failed = failed_frames(monitored, reference)
    judged = has_map & ~monitored.carried
    out_of_sight = ~right & ~failed
    reasons = np.where(wrong, WRONG, monitored.no_map)[failed]
    looked_for = int((~out_of_sight).sum())
    return RectificationScore(
        frames=len(has_map),
        out_of_sight=int(out_of_sight.sum()),
        failed=int(failed.sum()),
        wrong=int(wrong.sum()),
        failed_covered=int((failed & reference.covered).sum()),
        failed_by_reason=dict(Counter(reasons.tolist()).most_common()),
        corner_rmse_px=_root_mean_square(error_px[right]),
        worst_corner_px=float(np.max(error_px[judged])) if judged.any() else float("nan"),
        within_share=float(right.sum()) / looked_for if looked_for else float("nan"),
        median_s=float(np.median(monitored.ground_s)),
    )


def failed_frames(monitored: MonitoredClip, reference: TrueReference) -> BoolArray:
    """Return (F,) which frames have a wrong map, or none although the reference is in sight."""
    in_sight = reference.inside(monitored.size_px) & (reference.visible_share > 0.0)
    return wrong_frames(monitored) | (~np.isfinite(monitored.scale_m_per_px) & in_sight)


def wrong_frames(monitored: MonitoredClip) -> BoolArray:
    """Return (F,) which frames have a map that should not have been believed.

    Where the reference is outside the picture, pixels of its corners do not tell: the map is judged on the ground.
    """
    has_map = np.isfinite(monitored.scale_m_per_px) & ~monitored.carried
    return np.array(
        [mapped and is_wrong(error) for mapped, error in zip(has_map, monitored.corner_error_px, strict=True)]
    )


def _root_mean_square(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")
