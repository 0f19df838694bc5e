"""How far chance moves a mean AP: scenes drawn again and again from those that there are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.evaluation.detection.curve import eleven_point_ap
from standoff.evaluation.detection.matching import NOTHING, Matches
from standoff.evaluation.resampling import LEAST_GROUPS, RESAMPLES, draw_groups, interval_of


@dataclass(frozen=True, slots=True)
class Interval:
    """A 95 % interval.

    Attributes:
        low: Its lower end.
        high: Its upper end.
    """

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Chance:
    """Intervals of mean 11-point AP under another draw of groups.

    Attributes:
        groups: How many there were to draw from.
        intervals: Of each model.
        difference: Of the second model less the first on the same draws; None with one model.
    """

    groups: int
    intervals: tuple[Interval, ...]
    difference: Interval | None


def resample_groups(
    models: Sequence[Matches], groups: Sequence[str], *, resamples: int = RESAMPLES, seed: int = 0
) -> Chance | None:
    """Draw groups with replacement and score again; pictures of one scene are not independent of each other.

    Args:
        models: What each model's detections met, on the same pictures.
        groups: Of each picture.
        resamples: How often.
        seed: Of the draws.

    Returns:
        None with fewer than `LEAST_GROUPS` groups, or nothing to find.
    """
    names, group_of = np.unique(np.asarray(groups, dtype=np.str_), return_inverse=True)
    if len(names) < LEAST_GROUPS or not len(models[0].truth_px):
        return None
    draws = draw_groups(len(names), resamples=resamples, seed=seed)
    means = np.array([_mean_ap11(one, group_of, draws) for one in models])
    difference = Interval(*interval_of(means[1] - means[0])) if len(models) > 1 else None
    return Chance(len(names), tuple(Interval(*interval_of(values)) for values in means), difference)


@dataclass(frozen=True, slots=True, eq=False)
class _ByGroup:
    """One class: its detections from the surest down, and where they and the truths are."""

    matched: BoolArray
    group: IntArray
    truths: IntArray

    def ap11(self, times: IntArray) -> float:
        """Score with each group counted so many times."""
        weight = times[self.group]
        right = np.cumsum(weight * self.matched)
        return eleven_point_ap(right, np.cumsum(weight) - right, int(times @ self.truths))


def _mean_ap11(matches: Matches, group_of: IntArray, draws: IntArray) -> FloatArray:
    """Return (R,) the mean over the classes that have truth in each draw."""
    classes = [_by_group(matches, int(class_id), group_of) for class_id in np.unique(matches.truth_class_id)]
    scores = np.array([[one.ap11(times) for one in classes] for times in draws])
    known = np.isfinite(scores)
    return np.asarray(np.where(known, scores, 0.0).sum(axis=1) / np.where(known.any(axis=1), known.sum(axis=1), np.nan))


def _by_group(matches: Matches, class_id: int, group_of: IntArray) -> _ByGroup:
    counted = np.flatnonzero((matches.class_id == class_id) & ~matches.neutral)
    surest_first = counted[np.argsort(-matches.score[counted], kind="stable")]
    own = matches.truth_class_id == class_id
    return _ByGroup(
        matched=matches.truth_row[surest_first] != NOTHING,
        group=group_of[matches.picture[surest_first]],
        truths=np.bincount(group_of[matches.truth_picture[own]], minlength=int(group_of.max()) + 1),
    )
