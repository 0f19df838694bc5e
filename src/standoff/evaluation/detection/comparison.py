"""Detectors side by side on the same pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from standoff.evaluation.detection.bootstrap import Chance, Interval, resample_groups
from standoff.evaluation.detection.detector_trial import TrialResult
from standoff.evaluation.detection.material import Material
from standoff.evaluation.timing import machine
from standoff.labels.types import Problem


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """All that is known of some models on one material.

    Attributes:
        material: Its name.
        pictures: How many.
        groups: Scenes, flights or videos that they are from.
        results: Of each model, in the order given.
        chance: 95 % intervals of the mean AP; None with too few groups.
        thresholds: Scores at which precision and recall are reported besides.
        problems: Of the labels and the pictures; no model was asked about what is left out.
    """

    material: str
    pictures: int
    groups: int
    results: tuple[TrialResult, ...]
    chance: Chance | None
    thresholds: tuple[float, ...] = ()
    problems: tuple[Problem, ...] = ()

    def interval(self, row: int) -> Interval | None:
        """Return the interval of a model's mean AP, if there is one."""
        return self.chance.intervals[row] if self.chance else None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values; NaN stays NaN."""
        return {
            "data": self.material,
            "pictures": self.pictures,
            "groups": self.groups,
            "problems": [str(problem) for problem in self.problems],
            "machine": machine(),
            "difference_95_of_the_first_two": asdict(self.chance.difference)
            if self.chance and self.chance.difference
            else None,
            "models": [self._model(row) for row in range(len(self.results))],
        }

    def _model(self, row: int) -> dict[str, Any]:
        result, interval = self.results[row], self.interval(row)
        fixed = [
            {"class": one.name, "threshold": threshold, "precision": precision, "recall": recall}
            for one in result.score.classes
            if one.truths
            for threshold in self.thresholds
            for precision, recall in [one.curve.at(threshold)]
        ]
        return result.to_dict() | {"mean_ap11_95": asdict(interval) if interval else None, "at_thresholds": fixed}


def compare(material: Material, results: Sequence[TrialResult], thresholds: Sequence[float] = ()) -> Comparison:
    """Put results on the same material side by side."""
    groups = [picture.group for picture in material.truth]
    return Comparison(
        material=material.name,
        pictures=len(material.truth),
        groups=len(set(groups)),
        results=tuple(results),
        chance=resample_groups([result.score.matches for result in results], groups),
        thresholds=tuple(thresholds),
        problems=material.problems,
    )
