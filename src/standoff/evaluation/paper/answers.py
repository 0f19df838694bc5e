"""Danger, warning, clear or unknown, frame by frame: what is said of each visible worker and machine, against truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from standoff.clips import Clip
from standoff.config import Settings
from standoff.core.classes import CLASSES
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray, TextArray
from standoff.evaluation.paper.monitored_clip import MonitoredClip

ANSWERS = ("danger", "warning", "clear", "unknown")
DANGER, WARNING, CLEAR, UNKNOWN = range(4)
UP_TO_M = 50.0
"""Pairs that are truly further apart are not asked for."""


@dataclass(frozen=True, slots=True)
class AnswerScore:
    """One of the four answers.

    Attributes:
        answer: Of `ANSWERS`.
        truths: How often it is right to give it; the truth never is unknown.
        said: How often it is given.
        precision: Right ones of those given; NaN where it is never given.
        recall: Of those that should be given; NaN where it never should.
        f1: Harmonic mean of both: right ones of the mean of given and due; NaN where it is neither.
    """

    answer: str
    truths: int
    said: int
    precision: float
    recall: float
    f1: float


@dataclass(frozen=True, slots=True)
class Answers:
    """All answers about the visible pairs of a clip, or of several.

    Attributes:
        counts: By what is true (danger, warning, clear) and by what is said (`ANSWERS`).
    """

    counts: tuple[tuple[int, ...], ...]

    @classmethod
    def of(cls, true: IntArray, said: IntArray) -> Answers:
        """Count answers; both (N,), positions in `ANSWERS`."""
        counts = np.zeros((UNKNOWN, len(ANSWERS)), dtype=np.int64)
        np.add.at(counts, (true, said), 1)
        return cls(tuple(map(tuple, counts.tolist())))

    @classmethod
    def together(cls, several: Sequence[Answers]) -> Answers:
        """Pool the answers of several clips."""
        return cls(tuple(map(tuple, np.sum([one.counts for one in several], axis=0).tolist())))

    @property
    def each(self) -> tuple[AnswerScore, ...]:
        """Every answer's score."""
        counts = np.array(self.counts)
        truths, said = np.append(counts.sum(axis=1), 0), counts.sum(axis=0)
        right = np.append(np.diag(counts), 0)
        return tuple(
            AnswerScore(
                answer,
                int(truths[k]),
                int(said[k]),
                precision=_share(right[k], said[k]),
                recall=_share(right[k], truths[k]),
                f1=_share(2 * right[k], said[k] + truths[k]),
            )
            for k, answer in enumerate(ANSWERS)
        )

    @property
    def macro_f1(self) -> float:
        """Mean F1 of the answers that are true at least once; `unknown` costs them recall."""
        return self._mean("f1")

    @property
    def macro_precision(self) -> float:
        """Mean precision of the same; one that is never given has none and counts 0."""
        return self._mean("precision")

    @property
    def macro_recall(self) -> float:
        """Mean recall of the same."""
        return self._mean("recall")

    @property
    def unknown_share(self) -> float:
        """Share of all pairs of which nothing is known."""
        return _share(self.each[UNKNOWN].said, sum(map(sum, self.counts)))

    @property
    def breach_called_clear_share(self) -> float:
        """Share of the frames of a breach that are called clear: the worst that can be said."""
        return _share(self.counts[DANGER][CLEAR], sum(self.counts[DANGER]))

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON types; NaN stays NaN."""
        names = ("macro_precision", "macro_recall", "macro_f1", "unknown_share", "breach_called_clear_share")
        return {
            "counts": [list(row) for row in self.counts],
            "answers": [asdict(one) for one in self.each],
            **{name: getattr(self, name) for name in names},
        }

    def _mean(self, name: str) -> float:
        values = [getattr(one, name) for one in self.each if one.truths]
        return float(np.mean(np.nan_to_num(values))) if values else float("nan")


@dataclass(frozen=True, slots=True)
class FrameByFrame:
    """What is said in every frame of the visible pairs that are truly within 50 m.

    Attributes:
        measured: By the distance that is measured in the frame itself: below 0 less both radii, below the buffer.
        said: By the hazards that are open: as an operator sees it, with what keeps them from flickering. Where they go
            by probability, a warning is due while a breach is to come within the horizon.
    """

    measured: Answers
    said: Answers

    @classmethod
    def together(cls, several: Sequence[FrameByFrame]) -> FrameByFrame:
        """Pool several clips."""
        return cls(*(Answers.together([getattr(one, name) for one in several]) for name in ("measured", "said")))

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON types; NaN stays NaN."""
        return {"up_to_m": UP_TO_M, "measured": self.measured.to_dict(), "said": self.said.to_dict()}


def answers_of(gap_m: FloatArray, buffer_m: float) -> IntArray:
    """Return the answer that a gap (distance less both radii, m) of any shape calls for; NaN is unknown.

    >>> [ANSWERS[k] for k in answers_of(np.array([-0.1, 0.0, 0.9, 1.0, np.nan]), 1.0)]
    ['danger', 'warning', 'warning', 'clear', 'unknown']
    """
    clear = np.where(np.isnan(gap_m), UNKNOWN, CLEAR)
    return np.where(gap_m < 0.0, DANGER, np.where(gap_m < buffer_m, WARNING, clear))


def answers_ahead_of(gap_m: FloatArray, time_s: FloatArray, horizon_s: float) -> IntArray:
    """Return (F, P) the answers that gaps call for where a warning is of what will be: a breach within the horizon.

    Args:
        gap_m: (F, P) distance less both radii; NaN where not known, which is no breach.
        time_s: (F,) rising.
        horizon_s: How far ahead.

    Returns:
        Unknown where the frames end before the horizon and show no breach until then.

    >>> gap_m = np.array([[3.0], [2.0], [-0.5], [1.0], [1.0], [1.0]])
    >>> [ANSWERS[k] for k in answers_ahead_of(gap_m, np.arange(6.0), 1.0)[:, 0]]
    ['clear', 'warning', 'danger', 'clear', 'clear', 'unknown']
    """
    ends = np.searchsorted(time_s, time_s + horizon_s, side="right")
    breached = gap_m < 0.0
    so_far = np.concatenate([np.zeros((1, gap_m.shape[1]), dtype=np.int64), np.cumsum(breached, axis=0)])
    will = so_far[ends] - so_far[:-1] > 0
    known = will | (time_s + horizon_s <= time_s[-1])[:, None]
    return np.where(breached, DANGER, np.where(will, WARNING, np.where(known, CLEAR, UNKNOWN)))


def both_radii_m(clip: Clip, settings: Settings) -> FloatArray:
    """Return (P,) the sum of the action radii of each pair of the clip."""
    classes = [CLASSES[class_id] for class_id in clip.class_id]
    radius_m = [settings.locate.radius_m.get(one.name, one.action_radius_m) for one in classes]
    sums: FloatArray = np.array(radius_m, dtype=np.float64)[clip.pairs].sum(axis=1)
    return sums


def seen_together(clip: Clip) -> BoolArray:
    """Return (F, P) whether both of each pair can be seen in each frame."""
    visible = np.asarray(np.isfinite(clip.box_px).all(axis=2))
    return visible[:, clip.pairs[:, 0]] & visible[:, clip.pairs[:, 1]]


def score_frames(clip: Clip, monitored: MonitoredClip, settings: Settings) -> FrameByFrame:
    """Score what was said of every visible pair in every frame."""
    asked = seen_together(clip) & (clip.distance_m <= UP_TO_M)
    radii_m, buffer_m = both_radii_m(clip, settings), settings.hazard.buffer_m
    true_gap_m = clip.distance_m - radii_m
    true, measured = answers_of(true_gap_m, buffer_m), answers_of(monitored.distance_m - radii_m, buffer_m)
    said = np.where(measured == UNKNOWN, UNKNOWN, _as_said(monitored.said))
    due = true
    if settings.hazard.rule == "probability":
        due = answers_ahead_of(true_gap_m, monitored.time_s, settings.proximity.horizon_s)
    told = asked & (due != UNKNOWN)
    return FrameByFrame(Answers.of(true[asked], measured[asked]), Answers.of(due[told], said[told]))


def _as_said(said: TextArray) -> IntArray:
    """Return the answers that hazards give; no hazard of what is measured says that it is clear."""
    known = {"": CLEAR} | {answer: place for place, answer in enumerate(ANSWERS)}
    answers: IntArray = np.vectorize(known.__getitem__, otypes=[np.int64])(said)
    return answers


def _share(part: float, whole: float) -> float:
    return float(part / whole) if whole else float("nan")
