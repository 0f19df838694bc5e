"""How far a detector's ground points lie from the true ones, and whether it knows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.evaluation.detection.coco import HEIGHT_BANDS_PX
from standoff.evaluation.detection.matching import Matches
from standoff.evaluation.detection.score import DetectionScore, right_from
from standoff.evaluation.stated_errors import plane_sigmas, plane_sigmas2_around
from standoff.labels.views import GroundView


@dataclass(frozen=True, slots=True)
class PointScore:
    """Points of one class, or of those of its boxes that are of a height; NaN without any.

    Attributes:
        name: Of the class.
        count: Points that are told and known.
        median_px: Distance from the true point, in pixels of the picture.
        p95_px: 19 of 20 are nearer.
        median_heights: The distance in heights of the true box.
        p95_heights: Likewise.
        median_m: The distance on the ground; NaN where no camera is known.
        p95_m: Likewise.
        anchor_median_m: Of the bottom centre of the found box instead of the point.
        inside: Share of true points in the ellipse that 95 of 100 should lie in.
    """

    name: str
    count: int
    median_px: float
    p95_px: float
    median_heights: float
    p95_heights: float
    median_m: float
    p95_m: float
    anchor_median_m: float
    inside: float

    def to_dict(self) -> dict[str, Any]:
        """Return plain values; NaN stays NaN."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class PointScores:
    """Points by class, and of each class by the height of the box.

    Attributes:
        classes: Those of which a point is told and known, in the order of the score's classes.
        by_height: Of each of them, one for each of `HEIGHT_BANDS_PX`.
    """

    classes: tuple[PointScore, ...]
    by_height: tuple[tuple[PointScore, ...], ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values; NaN stays NaN."""
        return {
            "classes": [one.to_dict() for one in self.classes],
            "height_bands_px": HEIGHT_BANDS_PX,
            "by_height": [[one.to_dict() for one in bands] for bands in self.by_height],
        }


@dataclass(frozen=True, slots=True, eq=False)
class _Errors:
    """Of points (P): distances, and what they are measured by."""

    distance_px: FloatArray
    height_px: FloatArray
    distance_m: FloatArray
    anchor_m: FloatArray
    is_inside: BoolArray

    def of(self, name: str, which: BoolArray | slice) -> PointScore:
        heights = self.distance_px[which] / self.height_px[which]
        inside = self.is_inside[which]
        return PointScore(
            name=name,
            count=len(inside),
            median_px=_quantile(self.distance_px[which], 0.5),
            p95_px=_quantile(self.distance_px[which], 0.95),
            median_heights=_quantile(heights, 0.5),
            p95_heights=_quantile(heights, 0.95),
            median_m=_quantile(self.distance_m[which], 0.5),
            p95_m=_quantile(self.distance_m[which], 0.95),
            anchor_median_m=_quantile(self.anchor_m[which], 0.5),
            inside=float(inside.mean()) if len(inside) else math.nan,
        )


def score_points(score: DetectionScore, views: Mapping[int, GroundView]) -> PointScores:
    """Score the points of the right detections at each class's best threshold.

    Args:
        score: Of the boxes.
        views: How the ground is seen, by the position of the picture; those that are missing are not known in metres.
    """
    matches = score.matches
    classes, by_height = [], []
    for class_id, one in enumerate(score.classes):
        known = right_from(matches, class_id, one.threshold) & np.isfinite(matches.foot_px).all(axis=1)
        rows = np.flatnonzero(known)
        rows = rows[np.isfinite(matches.truth_foot_px[matches.truth_row[rows]]).all(axis=1)]
        if not len(rows):
            continue
        errors = _errors(matches, rows, views)
        classes.append(errors.of(one.name, slice(None)))
        bands = ((errors.height_px >= low_px) & (errors.height_px < high_px) for low_px, high_px in HEIGHT_BANDS_PX)
        by_height.append(tuple(errors.of(one.name, band) for band in bands))
    return PointScores(tuple(classes), tuple(by_height))


def _errors(matches: Matches, rows: IntArray, views: Mapping[int, GroundView]) -> _Errors:
    truth = matches.truth_row[rows]
    true_px, box_px = matches.truth_foot_px[truth], matches.truth_px[truth]
    off_px = matches.foot_px[rows] - true_px
    sigmas = plane_sigmas(off_px, matches.foot_covariance_px2[rows])
    left, _, right, bottom = matches.xyxy_px[rows].T
    anchor_px = np.column_stack([(left + right) / 2.0, bottom])
    distance_m, anchor_m = np.full(len(rows), np.nan), np.full(len(rows), np.nan)
    for picture in sorted(views.keys() & set(matches.picture[rows].tolist())):
        here = matches.picture[rows] == picture
        points_px = np.stack([true_px[here], matches.foot_px[rows][here], anchor_px[here]])
        true_m, found_m, below_m = views[picture].to_ground(points_px.reshape(-1, 2)).reshape(3, -1, 2)
        distance_m[here] = np.linalg.norm(found_m - true_m, axis=1)
        anchor_m[here] = np.linalg.norm(below_m - true_m, axis=1)
    return _Errors(
        distance_px=np.linalg.norm(off_px, axis=1),
        height_px=box_px[:, 3] - box_px[:, 1],
        distance_m=distance_m,
        anchor_m=anchor_m,
        is_inside=np.asarray(sigmas**2 <= plane_sigmas2_around(0.95)),
    )


def _quantile(values: FloatArray, share: float) -> float:
    known = values[np.isfinite(values)]
    return float(np.quantile(known, share)) if len(known) else math.nan
