"""Whether a quantised detector is as good as the one that it was made from, on the same pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from standoff.core.classes import CLASSES
from standoff.core.errors import DataError
from standoff.core.types import Detections, Frame
from standoff.evaluation.detection import DetectionScore, score_detections
from standoff.evaluation.detection.detector_trial import LEAST_SCORE
from standoff.evaluation.detection.points import score_points
from standoff.labels import LabelledPicture, load_picture
from standoff.stages.detect import DetectParams, OnnxDetector
from standoff.stages.frames import frame_from_array

MOST_MEAN_LOSS = 0.01
MOST_CLASS_LOSS = 0.02
MOST_POINT_SHARE = 0.1
"""The median error of ground points may grow by this share of itself."""
_LEAST_POINT_GROWTH = 0.002
"""In heights of the box: a tenth of nearly nothing is nothing."""
LEAST_TRUTHS = 50
"""Of a class with fewer, one thing more or less in fifty moves AP by the 2 points that are allowed."""
_AP11_STEP = 1.0 / 11.0
"""One thing more or less may move AP by this: it decides whether one of the eleven recalls is reached."""
_ROUNDING = 1e-9
_TIMED_PICTURES = 20


@dataclass(frozen=True, slots=True)
class ClassLoss:
    """One class before and after.

    Attributes:
        name: Of the class.
        truths: How many there are to find.
        before: 11-point AP of the float model.
        after: Of the quantised one.
        threshold: Score that suits the float model best (largest F1).
        recall_before: Of the float model at that score.
        recall_after: Of the quantised one at the same score: a threshold once chosen stays in the settings.
        counted: False with too few truths for two points to say anything.
        point_before: Median error of the float model's ground points, in heights of the box; NaN where it tells none.
        point_after: Of the quantised one's.
    """

    name: str
    truths: int
    before: float
    after: float
    threshold: float
    recall_before: float
    recall_after: float
    counted: bool
    point_before: float = math.nan
    point_after: float = math.nan

    @property
    def allowed_points(self) -> float:
        """Growth of the points' median error that is allowed, in heights of the box."""
        return MOST_POINT_SHARE * self.point_before + _LEAST_POINT_GROWTH

    @property
    def point_excess(self) -> float:
        """That growth in parts of what is allowed; 0 where nothing tells."""
        growth = (self.point_after - self.point_before) / self.allowed_points
        return growth if self.counted and math.isfinite(growth) else 0.0

    @property
    def allowed(self) -> float:
        """Fall of AP that is allowed: 2 points, or with few truths what one of them may move, but never half of it."""
        if self.counted:
            return MOST_CLASS_LOSS
        return max(MOST_CLASS_LOSS, min(1.0 / self.truths + _AP11_STEP, self.before / 2.0))


@dataclass(frozen=True, slots=True)
class Loss:
    """What quantisation costs.

    Attributes:
        classes: Those that the model knows and that have truth.
        before: 11-point mAP of the float model over the classes that count.
        after: Of the quantised one.
    """

    classes: tuple[ClassLoss, ...]
    before: float
    after: float

    @property
    def complaints(self) -> tuple[str, ...]:
        """What is worse than allowed, in words; empty: nothing is."""
        found = []
        if not self.before - self.after <= MOST_MEAN_LOSS + _ROUNDING:
            found.append(f"mAP {_fall(self.before, self.after)}")
        found += [
            f"AP of {one.name} {_fall(one.before, one.after)}"
            for one in self.classes
            if not one.before - one.after <= one.allowed + _ROUNDING
        ]
        found += [
            f"{one.name}: ground points off by {one.point_after:.3f} box heights, not {one.point_before:.3f}"
            for one in self.classes
            if not one.point_excess <= 1.0 + _ROUNDING
        ]
        return tuple(found)

    @property
    def excess(self) -> float:
        """The worst fall in parts of what is allowed; at most 1: good enough."""
        falls = [(self.before - self.after) / MOST_MEAN_LOSS]
        falls += [(one.before - one.after) / one.allowed for one in self.classes]
        falls += [one.point_excess for one in self.classes]
        return max(falls)


def _fall(before: float, after: float) -> str:
    return f"falls from {100 * before:.1f} to {100 * after:.1f}"


class Gate:
    """Pictures on which a float model and its quantised versions are compared.

    Args:
        float_model: ONNX file.
        pictures: Labelled with the classes of the site.
        step: Called after each picture.

    Attributes:
        unreadable: Pictures that could not be decoded and were left out.

    Raises:
        DataError: No class that the model knows has enough truths, or no picture can be decoded.
    """

    def __init__(self, float_model: Path, pictures: Sequence[LabelledPicture], step: Callable[[], None]) -> None:
        self._float_model = float_model
        detector = _open(float_model)
        self._known = set(detector.describe()["class_map"].values())
        self._pictures: list[LabelledPicture] = []
        self.unreadable: list[Path] = []
        found = []
        for picture in pictures:
            try:
                frame = frame_from_array(load_picture(picture))
            except DataError:
                self.unreadable.append(picture.path)
            else:
                self._pictures.append(picture)
                found.append(detector.detect(frame))
            step()
        self._before = self._score(found)
        self._require_enough()

    def _score(self, found: list[Detections]) -> DetectionScore:
        names = tuple(site_class.name for site_class in CLASSES)
        return score_detections(self._pictures, found, names)

    def _require_enough(self) -> None:
        counts = {one.name: one.truths for one in self._before.classes if one.truths and one.name in self._known}
        if max(counts.values(), default=0) < LEAST_TRUTHS:
            raise DataError(
                expected=f"at least {LEAST_TRUTHS} of some class that the model knows, in the pictures that decide",
                found=", ".join(f"{count} of {name}" for name, count in counts.items()) or "none",
                fix="choose another --split, or label more pictures",
            )

    def __len__(self) -> int:
        return len(self._pictures)

    def compare(self, model: Path, step: Callable[[], None]) -> Loss:
        """Score a quantised model on the pictures.

        Args:
            model: ONNX file.
            step: Called after each picture.
        """
        detector, found = _open(model), []
        for picture in self._pictures:
            found.append(detector.detect(frame_from_array(load_picture(picture))))
            step()
        after = self._score(found)
        points = [
            {one.name: one.median_heights for one in score_points(score, {}).classes} for score in (self._before, after)
        ]
        classes = tuple(
            ClassLoss(
                name=one.name,
                truths=one.truths,
                before=one.ap11,
                after=other.ap11,
                threshold=one.threshold,
                recall_before=one.recall,
                recall_after=other.curve.at(one.threshold)[1],
                counted=one.truths >= LEAST_TRUTHS,
                point_before=points[0].get(one.name, math.nan),
                point_after=points[1].get(one.name, math.nan),
            )
            for one, other in zip(self._before.classes, after.classes, strict=True)
            if one.truths and one.name in self._known
        )
        before, after = np.mean([(one.before, one.after) for one in classes if one.counted], axis=0)
        return Loss(classes, float(before), float(after))

    def median_ms(self, model: Path) -> tuple[float, float]:
        """Return milliseconds a picture of the float and of a quantised model, timed in turn on the same pictures."""
        detectors = [_open(self._float_model), _open(model)]
        frames = [frame_from_array(load_picture(picture)) for picture in self._pictures[:_TIMED_PICTURES]]
        times_ms = [[_time_ms(detector, frame) for detector in detectors] for frame in [frames[0], *frames]]
        before, after = np.median(times_ms[1:], axis=0)
        return float(before), float(after)


def _open(model: Path) -> OnnxDetector:
    return OnnxDetector(model, DetectParams(score_threshold=LEAST_SCORE, ground_points="none", provider="cpu"))


def _time_ms(detector: OnnxDetector, frame: Frame) -> float:
    started_s = perf_counter()
    detector.detect(frame)
    return 1e3 * (perf_counter() - started_s)
