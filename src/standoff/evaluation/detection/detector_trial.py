"""One detector on the material: what it finds, how fast, and what that is worth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from standoff.core.classes import CLASSES
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.core.protocols import Detector
from standoff.core.types import Detections
from standoff.evaluation.detection.coco import MOST_OF_A_CLASS, CocoFigures, coco_figures
from standoff.evaluation.detection.grouping import Grouping
from standoff.evaluation.detection.localisation import ale_by_class_m
from standoff.evaluation.detection.material import Material
from standoff.evaluation.detection.points import PointScores, score_points
from standoff.evaluation.detection.score import DetectionScore, score_detections
from standoff.stages.detect import DetectParams, OnnxDetector

LEAST_SCORE = 0.005
"""Surer boxes are scored, as by Darknet: a curve needs what an operator would not be shown."""
_WARM_UP = 3


@dataclass(frozen=True, slots=True)
class DetectorSetup:
    """A model and how it is used.

    Attributes:
        label: Unlike the others' labels.
        model: ONNX file.
        slices: Columns and rows of slices; (1, 1) is none.
    """

    label: str
    model: Path
    slices: tuple[int, int]

    def open(self, *, tells_points: bool = True) -> OnnxDetector:
        """Load the model.

        Args:
            tells_points: Whether the network of ground points goes along: of hundreds of boxes that nobody would be
                shown it takes longer than all else.

        Raises:
            ModelError: It is no detector.
        """
        # As many boxes as COCO asks for, were all of one picture's of each class.
        most = MOST_OF_A_CLASS * len(CLASSES)
        params = DetectParams(score_threshold=LEAST_SCORE, slices=self.slices, max_detections=most)
        return OnnxDetector(self.model, params if tells_points else replace(params, ground_points="none"))


@dataclass(frozen=True, slots=True, eq=False)
class TrialResult:
    """What a candidate is worth.

    Attributes:
        candidate: Which.
        model: The detector's own description of itself.
        score: By the paper's measures.
        coco: By COCO's.
        times_ms: (N,) of each picture: scaling, inference and suppression; reading the picture is not in it.
        ale_m: Paper Eq. 3 by class; empty without truth in metres.
        points: How well ground points lie; empty where the model tells none or the truth knows none.
        unseen: Scored classes that have truth and that the model does not know: their AP is 0.
    """

    candidate: DetectorSetup
    model: Mapping[str, Any]
    score: DetectionScore
    coco: CocoFigures
    times_ms: FloatArray
    ale_m: Mapping[str, float]
    points: PointScores
    unseen: tuple[str, ...]

    @property
    def median_ms(self) -> float:
        """Half of the pictures took less."""
        return float(np.median(self.times_ms))

    @property
    def p95_ms(self) -> float:
        """All but one of twenty pictures took less."""
        return float(np.percentile(self.times_ms, 95))

    def to_dict(self) -> dict[str, Any]:
        """Return plain values; NaN stays NaN."""
        return {
            "label": self.candidate.label,
            "slices": list(self.candidate.slices),
            **self.model,
            "median_ms": self.median_ms,
            "p95_ms": self.p95_ms,
            "classes_unknown_to_the_model": list(self.unseen),
            "score": self.score.to_dict(),
            "coco": self.coco.to_dict(),
            "ale_m": dict(self.ale_m),
            "points": self.points.to_dict(),
        }


def find_all(
    detector: Detector, material: Material, on_frame: Callable[[], None] | None = None
) -> tuple[tuple[Detections, ...], FloatArray]:
    """Detect in every picture.

    Args:
        detector: Any.
        material: Pictures.
        on_frame: Called after each.

    Returns:
        What was found in each, and (N,) milliseconds that it took; the first picture is looked at a few times more
        before the clock counts.

    Raises:
        DataError: There are fewer pictures than truths.
    """
    found, times_ms = [], []
    for number, frame in enumerate(material.frames()):
        for _ in range(_WARM_UP if number == 0 else 0):
            detector.detect(frame)
        started_s = perf_counter()
        found.append(detector.detect(frame))
        times_ms.append(1e3 * (perf_counter() - started_s))
        if on_frame is not None:
            on_frame()
    if len(found) != len(material.truth):
        raise DataError(
            expected=f"{len(material.truth)} pictures in {material.name}",
            found=f"{len(found)}",
            fix="check that the truth belongs to this video",
        )
    return tuple(found), np.array(times_ms)


def require_truth(material: Material, grouping: Grouping) -> None:
    """Check that there is something to find.

    Raises:
        DataError: There is not.
    """
    if not any((~grouping.truth(picture).ignored).any() for picture in material.truth):
        raise DataError(
            expected=f"something to find in {material.name} ({', '.join(grouping.classes)})",
            found="nothing of these",
            fix="choose other data, or leave out fewer classes",
        )


def try_candidate(
    candidate: DetectorSetup,
    detector: OnnxDetector,
    material: Material,
    grouping: Grouping,
    iou: float = 0.5,
    on_frame: Callable[[], None] | None = None,
) -> TrialResult:
    """Detect in every picture and score.

    Args:
        candidate: Which.
        detector: From `DetectorSetup.open`.
        material: Pictures and what is in them.
        grouping: Which classes are scored, and as what.
        iou: Least intersection over union of a right detection; COCO's figures have their own.
        on_frame: Called after each picture.

    Raises:
        DataError: There are fewer pictures than truths.
        MissingDependency: pycocotools is not installed.
    """
    seen, times_ms = find_all(detector, material, on_frame)
    found = [grouping.found(detections) for detections in seen]
    truth = [grouping.truth(picture) for picture in material.truth]
    score = score_detections(truth, found, grouping.classes, iou)
    description = detector.describe()
    return TrialResult(
        candidate=candidate,
        model=description,
        score=score,
        coco=coco_figures(truth, found, grouping.classes),
        times_ms=times_ms,
        ale_m=ale_by_class_m(score, material),
        points=score_points(score, material.views),
        unseen=_unseen(score, grouping, set(description["class_map"].values())),
    )


def _unseen(score: DetectionScore, grouping: Grouping, known: set[str]) -> tuple[str, ...]:
    return tuple(one.name for one in score.classes if one.truths and not known.intersection(grouping.members(one.name)))
