"""How many workers are missed on ground that is called watched, and how much of what could be watched is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from standoff.core.finding import KEY as FINDS_WORKERS
from standoff.core.finding import WorkerFinding
from standoff.core.homography import BoolArray
from standoff.core.watched_ground import NO_GROUND, REASONS, WATCHED
from standoff.evaluation.watched.finding import measure_finding
from standoff.evaluation.watched.samples import WorkerSamples

FINDABLE_SHARE = 0.9
_BAND = 2.0**0.5
_FEWEST = 10


@dataclass(frozen=True, slots=True)
class Missed:
    """Workers in frames.

    Attributes:
        workers: How many.
        missed: Of these, no track shows so many.
    """

    workers: int
    missed: int

    @classmethod
    def of(cls, found: BoolArray) -> Missed:
        """Count."""
        return cls(len(found), int((~found).sum()))

    @property
    def missed_share(self) -> float:
        """NaN where there are none."""
        return self.missed / self.workers if self.workers else float("nan")


@dataclass(frozen=True, slots=True)
class WatchedResult:
    """One clip or several.

    Attributes:
        clips: Folders.
        frames: That the runs read.
        watched_share: Of the ground in the pictures, mean of the clips.
        on_watched: Workers who stand on ground called watched, of whom nothing is hidden or cut off.
        on_watched_hidden: The others of them.
        on_unwatched: Whole workers who stand elsewhere, by the reason.
        findable: Whole workers of clips and heights of which nine of ten are found: whom a rule that knows the truth
            would watch.
        findable_watched: Of these, so many stand on ground called watched.
        breaches: Workers in a breach, in frames.
        breaches_called_clear: Of these, so many stand on ground called watched while nothing is said, or the wrong.
        finding: How many are found by their height, in pixels of the detector's input.
    """

    clips: tuple[Path, ...]
    frames: int
    watched_share: float
    on_watched: Missed
    on_watched_hidden: Missed
    on_unwatched: dict[str, Missed]
    findable: int
    findable_watched: int
    breaches: int
    breaches_called_clear: int
    finding: WorkerFinding

    @property
    def watched_of_findable(self) -> float:
        """Share of what could be watched that is; NaN where nothing could."""
        return self.findable_watched / self.findable if self.findable else float("nan")

    @property
    def called_clear_share(self) -> float:
        """Share of the frames of a breach in which the ground is called watched and the breach clear."""
        return self.breaches_called_clear / self.breaches if self.breaches else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON types; NaN stays NaN."""
        return {
            **{name: value for name, value in asdict(self).items() if name != "finding"},
            FINDS_WORKERS: self.finding.to_dict(),
            "clips": [str(clip) for clip in self.clips],
            "missed_share": self.on_watched.missed_share,
            "watched_of_findable": self.watched_of_findable,
            "called_clear_share": self.called_clear_share,
        }


def score_watched(samples: Sequence[WorkerSamples]) -> WatchedResult:
    """Pool clips; one at least."""
    findable = [_findable(one) for one in samples]
    seen, cell, found, breach, clear = (
        np.concatenate([getattr(one, name) for one in samples])
        for name in ("whole", "cell", "found", "in_breach", "called_clear")
    )
    could, watched = np.concatenate(findable), cell == WATCHED
    names = {NO_GROUND: "no ground", **dict(enumerate(REASONS))}
    reasons = sorted(set(cell[~watched].tolist()))
    return WatchedResult(
        clips=tuple(one.clip for one in samples),
        frames=sum(one.frames for one in samples),
        watched_share=float(np.mean([one.watched_share for one in samples])),
        on_watched=Missed.of(found[watched & seen]),
        on_watched_hidden=Missed.of(found[watched & ~seen]),
        on_unwatched={names[k]: Missed.of(found[(cell == k) & seen]) for k in reasons},
        findable=int(could.sum()),
        findable_watched=int((could & watched).sum()),
        breaches=int(breach.sum()),
        breaches_called_clear=int((clear & watched).sum()),
        finding=measure_finding(samples),
    )


def _findable(one: WorkerSamples) -> BoolArray:
    """Tell (N,) which workers are of a height of which nine of ten are found in the clip."""
    band = np.floor(np.log(np.maximum(one.height_px, 1.0)) / np.log(_BAND)).astype(np.int64)
    could = np.zeros(len(band), dtype=np.bool_)
    for each in np.unique(band):
        here = one.whole & (band == each)
        if here.sum() >= _FEWEST and (one.found | one.suspected)[here].mean() >= FINDABLE_SHARE:
            could[here] = True
    return could
