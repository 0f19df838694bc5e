"""Precision against recall of one class, and what is read from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Detections of one class counted from the surest down; what counts neither way is left out.

    Attributes:
        score: (K,) falling.
        right: (K,) how many down to this one found a truth.
        wrong: (K,) how many did not.
        truths: How many there are to find.
    """

    score: FloatArray
    right: IntArray
    wrong: IntArray
    truths: int

    @classmethod
    def of(cls, score: FloatArray, matched: BoolArray, truths: int) -> Curve:
        """Count.

        Args:
            score: (K,) in any order.
            matched: (K,) whether it found a truth.
            truths: How many there are to find.

        >>> curve = Curve.of(np.array([0.2, 0.9, 0.5]), np.array([True, True, False]), truths=2)
        >>> curve.precision.round(2).tolist(), curve.recall.tolist()
        ([1.0, 0.5, 0.67], [0.5, 0.5, 1.0])
        """
        order = np.argsort(-score, kind="stable")
        return cls(score[order], np.cumsum(matched[order]), np.cumsum(~matched[order]), truths)

    @property
    def precision(self) -> FloatArray:
        """(K,) share of the detections that are right."""
        return np.asarray(self.right / (self.right + self.wrong))

    @property
    def recall(self) -> FloatArray:
        """(K,) share of the truths that are found; NaN where there are none."""
        return np.asarray(self.right / self.truths if self.truths else np.full(len(self.right), np.nan))

    def ap11(self) -> float:
        """Return 11-point interpolated average precision; NaN without truth."""
        return eleven_point_ap(self.right, self.wrong, self.truths)

    def interpolated(self, steps: int) -> FloatArray:
        """Return (steps + 1,) the best precision at recalls of at least 0, 1 / steps ... 1."""
        return interpolated_precision(self.right, self.wrong, self.truths, steps)

    def ap(self) -> float:
        """Return the area under the interpolated curve, all points of it; NaN without truth.

        Source:
            Everingham et al., The PASCAL VOC Challenge 2010-2012: precision at each recall is the best at that or more.

        >>> Curve.of(np.array([0.9, 0.5, 0.2]), np.array([True, False, True]), truths=2).ap().__round__(4)
        0.8333
        """
        if not self.truths:
            return float("nan")
        hits = np.diff(self.right, prepend=0) > 0
        return float(_best_from_here(self.precision)[hits].sum() / self.truths)

    def best_f1(self) -> int | None:
        """Return the row whose score, as a threshold, gives the largest F1; None where nothing is found."""
        if not len(self.right) or not self.right[-1]:
            return None
        f1 = np.where(self._thresholds(), 2.0 * self.right / (self.right + self.wrong + self.truths), -1.0)
        return int(f1.argmax())

    def recall_at_precision(self, precision: float) -> float:
        """Return the largest recall of a threshold with at least this precision; 0 where there is no such threshold.

        >>> Curve.of(np.array([0.9, 0.5, 0.2]), np.array([True, True, False]), truths=4).recall_at_precision(0.8)
        0.5
        """
        if not self.truths:
            return float("nan")
        allowed = self._thresholds() & (self.right >= precision * (self.right + self.wrong))
        return float(self.right[allowed].max(initial=0) / self.truths)

    def at(self, threshold: float) -> tuple[float, float]:
        """Return precision and recall of the detections with at least this score; NaN where undefined."""
        count = int((self.score >= threshold).sum())
        if not count:
            return float("nan"), 0.0 if self.truths else float("nan")
        return float(self.precision[count - 1]), float(self.recall[count - 1])

    def _thresholds(self) -> BoolArray:
        """Return (K,) True for the last of equal scores: no threshold parts them."""
        return np.asarray(np.diff(self.score, append=-1.0) != 0.0)


def eleven_point_ap(right: IntArray, wrong: IntArray, truths: int) -> float:
    """Return the mean of the best precision at recalls of at least 0.0, 0.1 ... 1.0; NaN without truth.

    Args:
        right: (K,) right detections down to each score.
        wrong: (K,) wrong ones.
        truths: How many there are to find.

    Source:
        Paper, section 4.2, Eq. 1; Everingham et al., The PASCAL Visual Object Classes Challenge (2010), section 4.2.

    >>> round(eleven_point_ap(np.array([1, 1, 2]), np.array([0, 1, 1]), 2), 4)
    0.8485
    """
    return float(interpolated_precision(right, wrong, truths, 10).mean()) if truths else float("nan")


def interpolated_precision(right: IntArray, wrong: IntArray, truths: int, steps: int) -> FloatArray:
    """Return (steps + 1,) the best precision at recalls of at least 0, 1 / steps ... 1; 0 where that is not reached.

    Args:
        right: (K,) right detections down to each score; rows at the head may count 0 in both.
        wrong: (K,) wrong ones.
        truths: How many there are to find.
        steps: Parts into which recall is cut.
    """
    best = _best_from_here(right / np.maximum(right + wrong, 1))
    # Whole numbers: 3 of 10 is a recall of 0.3, which in binary fractions it is not always.
    first = np.searchsorted(right * steps, np.arange(steps + 1) * truths)
    return np.append(best, 0.0)[first]


def _best_from_here(precision: FloatArray) -> FloatArray:
    """Return (K,) the largest precision at this recall or more."""
    return np.maximum.accumulate(precision[::-1])[::-1]
