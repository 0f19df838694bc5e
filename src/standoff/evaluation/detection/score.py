"""How good a detector is on labelled pictures: the paper's Eq. 1 and 2, class by class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import Detections
from standoff.evaluation.detection.curve import Curve
from standoff.evaluation.detection.matching import NOTHING, Matches, match_detections
from standoff.labels.types import LabelledPicture

PRECISION = 0.8
"""Recall is also reported at this precision: one alarm in five for nothing."""
_DRAWN_STEPS = 100


@dataclass(frozen=True, slots=True, eq=False)
class ClassScore:
    """One class.

    Attributes:
        name: Of the class.
        truths: How many there are to find.
        detections: How many were made, those that count neither way left out.
        ap11: 11-point interpolated average precision, paper Eq. 1; NaN, as `ap` and `recall`, without truth.
        ap: Area under the interpolated precision-recall curve.
        threshold: Score that gives the best F1, the harmonic mean of precision and recall; NaN where nothing is found.
        precision: At that threshold.
        recall: At that threshold.
        average_iou: Paper Eq. 2, over the right detections at that threshold; NaN where there are none.
        curve: Precision and recall at every score.
    """

    name: str
    truths: int
    detections: int
    ap11: float
    ap: float
    threshold: float
    precision: float
    recall: float
    average_iou: float
    curve: Curve

    def recall_at_precision(self, precision: float) -> float:
        """Return the largest recall of a threshold with at least this precision; NaN without truth."""
        return self.curve.recall_at_precision(precision)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values; of the curve, the best precision at 101 recalls from 0 to 1."""
        names = ("name", "truths", "detections", "ap11", "ap", "threshold", "precision", "recall", "average_iou")
        return {name: getattr(self, name) for name in names} | {
            f"recall_at_precision_{PRECISION:g}": self.recall_at_precision(PRECISION),
            "curve": self.curve.interpolated(_DRAWN_STEPS).tolist() if self.truths else None,
        }


@dataclass(frozen=True, slots=True, eq=False)
class DetectionScore:
    """All classes.

    Attributes:
        classes: In the order of the class list, also those without truth.
        iou: Least intersection over union of a right detection.
        mean_ap11: Paper Eq. 1: mean over the classes that have truth; NaN where none has.
        mean_ap: The same of `ap`.
        average_iou: Paper Eq. 2 over all classes' right detections at their thresholds; NaN without any.
        matches: What it was counted from.
    """

    classes: tuple[ClassScore, ...]
    iou: float
    mean_ap11: float
    mean_ap: float
    average_iou: float
    matches: Matches

    def of(self, name: str) -> ClassScore:
        """Return the score of one class.

        Raises:
            KeyError: There is none of that name.
        """
        for score in self.classes:
            if score.name == name:
                return score
        raise KeyError(name)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values; NaN stays NaN."""
        return {
            "pictures": self.matches.pictures,
            "iou": self.iou,
            "mean_ap11": self.mean_ap11,
            "mean_ap": self.mean_ap,
            "average_iou": self.average_iou,
            "classes": [score.to_dict() for score in self.classes],
        }


def score_detections(
    truth: Sequence[LabelledPicture], found: Sequence[Detections], classes: tuple[str, ...], iou: float = 0.5
) -> DetectionScore:
    """Score detections.

    Args:
        truth: Pictures and what is in them.
        found: What was detected in each, low scores included; `class_id` is a position in `classes`.
        classes: Names.
        iou: Least intersection over union of a right detection.

    Raises:
        ValueError: There is another number of detections than of pictures.
    """
    matches = match_detections(truth, found, iou)
    scores = tuple(_score_class(matches, class_id, name) for class_id, name in enumerate(classes))
    right = [right_from(matches, class_id, score.threshold) for class_id, score in enumerate(scores)]
    return DetectionScore(
        classes=scores,
        iou=iou,
        mean_ap11=_mean([score.ap11 for score in scores]),
        mean_ap=_mean([score.ap for score in scores]),
        average_iou=_mean(np.concatenate([matches.iou[of_class] for of_class in right])),
        matches=matches,
    )


def _score_class(matches: Matches, class_id: int, name: str) -> ClassScore:
    counted = (matches.class_id == class_id) & ~matches.neutral
    truths = int((matches.truth_class_id == class_id).sum())
    curve = Curve.of(matches.score[counted], matches.truth_row[counted] != NOTHING, truths)
    best = curve.best_f1()
    threshold = float(curve.score[best]) if best is not None else float("nan")
    precision, recall = curve.at(threshold)
    return ClassScore(
        name=name,
        truths=truths,
        detections=int(counted.sum()),
        ap11=curve.ap11(),
        ap=curve.ap(),
        threshold=threshold,
        precision=precision,
        recall=recall,
        average_iou=_mean(matches.iou[right_from(matches, class_id, threshold)]),
        curve=curve,
    )


def right_from(matches: Matches, class_id: int, threshold: float) -> BoolArray:
    """Return (D,) the right detections of a class with at least this score."""
    right: BoolArray = (matches.class_id == class_id) & (matches.truth_row != NOTHING) & (matches.score >= threshold)
    return right


def _mean(values: Sequence[float] | FloatArray) -> float:
    """Return the mean of those that are not NaN; NaN without any."""
    known = np.asarray(values, dtype=np.float64)
    known = known[np.isfinite(known)]
    return float(known.mean()) if len(known) else float("nan")
