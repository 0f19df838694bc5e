"""The map's errors over several clips together, and how far other clips of the kind would move them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from standoff.core.homography import FloatArray
from standoff.evaluation.paper.map_only import MapFigures, MapSamples, figures_of, map_samples
from standoff.evaluation.paper.result import ClipResult
from standoff.evaluation.resampling import RESAMPLES, interval_of

_SEED = 0
_FIGURES = ("median_m", "p95_m", "worst_m", "inside_share", "believed_wrong_share", "sigma_m")

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class PooledMap:
    """The map alone, over clips.

    Attributes:
        clips: How many.
        without_map_share: Frames without a map, of all.
        without_map_since_seen_share: The same of those since the reference was first whole in the picture.
        level: Against level ground, all points of all clips.
        uneven: Against the ground as it is.
        intervals: By figure ("without_map_share", "level median_m"), what 95 % of 1000 choices of as many clips with
            repetition give. Points of one clip are right or wrong together, so clips are drawn and never points. Empty
            for a single clip.
    """

    clips: int
    without_map_share: float
    without_map_since_seen_share: float
    level: MapFigures
    uneven: MapFigures
    intervals: Mapping[str, Interval]

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON types; NaN stays NaN."""
        return asdict(self) | {"intervals": {name: list(interval) for name, interval in self.intervals.items()}}


@dataclass(frozen=True, slots=True, eq=False)
class _OfClip:
    frames: FloatArray
    level: MapSamples
    uneven: MapSamples


def pool(results: Sequence[ClipResult]) -> PooledMap | None:
    """Put the maps of several clips together; None where no clip has a reference object."""
    clips = [
        _OfClip(
            np.array([one.without_map, one.frames, one.without_map_since_seen, one.frames_since_seen], np.float64),
            map_samples(result.clip, monitored, monitored.level_feet),
            map_samples(result.clip, monitored, monitored.true_feet),
        )
        for result in results
        if (monitored := result.monitored) is not None and (one := result.map_only) is not None
    ]
    if not clips:
        return None
    together = _together(clips)
    return PooledMap(
        clips=len(clips),
        without_map_share=together["without_map_share"],
        without_map_since_seen_share=together["without_map_since_seen_share"],
        level=figures_of([one.level for one in clips]),
        uneven=figures_of([one.uneven for one in clips]),
        intervals=_intervals(clips) if len(clips) > 1 else {},
    )


def _together(clips: Sequence[_OfClip]) -> dict[str, float]:
    without, frames, without_since, frames_since = np.sum([one.frames for one in clips], axis=0)
    found = {
        "without_map_share": without / frames,
        "without_map_since_seen_share": without_since / frames_since if frames_since else float("nan"),
    }
    for kind in ("level", "uneven"):
        figures = figures_of([getattr(one, kind) for one in clips])
        found |= {f"{kind} {name}": getattr(figures, name) for name in _FIGURES}
    return {name: float(value) for name, value in found.items()}


def _intervals(clips: Sequence[_OfClip]) -> dict[str, Interval]:
    rng = np.random.default_rng(_SEED)
    drawn = [_together([clips[k] for k in rng.integers(len(clips), size=len(clips))]) for _ in range(RESAMPLES)]
    return {name: interval_of(np.array([one[name] for one in drawn])) for name in drawn[0]}
