"""Distances between workers and machines against exact truth, and against the paper's substitute for it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from standoff.clips import Clip
from standoff.core.classes import CLASSES
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import TextArray
from standoff.evaluation.paper.benchmark_polynomial import Benchmark, fit_benchmark
from standoff.evaluation.paper.metrics import DistanceScore, fill_as_the_filter, score_distances
from standoff.evaluation.paper.monitored_clip import MonitoredClip
from standoff.evaluation.paper.rectified import failed_frames
from standoff.evaluation.stated_errors import Coverage, score_coverage
from standoff.stages.proximity import ProximityParams

BEFORE = "before the filter"
AFTER = "after the filter"
FILLED = "after, failures filled"
AGAINST_BENCHMARK = "filled, against benchmark"
BENCHMARK = "benchmark itself"
NOT_MEASURED = "no distance of this pair"


@dataclass(frozen=True, slots=True, eq=False)
class PairSeries:
    """One worker and one machine over the clip, by frame (F).

    Attributes:
        names: Worker, machine.
        class_pair: "worker-excavator".
        truth_m: Exact; NaN where the truth has no such pair.
        before_m: As measured; NaN where not.
        after_m: After the outlier filter; NaN where not measured.
        sigma_m: Standard error that is stated for it; NaN with it.
        filled_m: The same with failed rectifications replaced as the paper's filter does.
        failed: Frames whose rectification failed.
        reason: Why there is no estimate; empty where there is one, and where the truth has none.
        benchmark: The paper's substitute for truth, where it is made.
    """

    names: tuple[str, str]
    class_pair: str
    truth_m: FloatArray
    before_m: FloatArray
    after_m: FloatArray
    sigma_m: FloatArray
    filled_m: FloatArray
    failed: BoolArray
    reason: TextArray
    benchmark: Benchmark | None

    def compared(self) -> Mapping[str, tuple[FloatArray, FloatArray]]:
        """Return, by what is compared, the series that counts as true and the one that is scored."""
        pairs = {BEFORE: (self.truth_m, self.before_m), AFTER: (self.truth_m, self.after_m)}
        pairs[FILLED] = (self.truth_m, self.filled_m)
        if self.benchmark is not None:
            pairs[AGAINST_BENCHMARK] = (self.benchmark.trend_m, self.filled_m)
            pairs[BENCHMARK] = (self.truth_m, self.benchmark.trend_m)
        return pairs


@dataclass(frozen=True, slots=True, eq=False)
class PairGroup:
    """All pairs of one kind.

    Attributes:
        class_pair: "worker-excavator".
        pairs: How many.
        scores: By what is compared.
        coverage: How true the stated errors of the distances after the filter are.
        missing_by_reason: Frames without an estimate, by cause.
    """

    class_pair: str
    pairs: int
    scores: Mapping[str, DistanceScore]
    coverage: Coverage
    missing_by_reason: Mapping[str, int]


def pair_series(clip: Clip, monitored: MonitoredClip, *, benchmark: bool) -> tuple[PairSeries, ...]:
    """Take each pair's distances out of what the monitor said."""
    assert clip.reference is not None
    names = clip.names()
    failed = failed_frames(monitored, clip.reference)
    return tuple(
        _one_series(clip, monitored, (names[ends[0]], names[ends[1]]), column, failed, benchmark)
        for column, ends in enumerate(clip.pairs)
    )


def _one_series(
    clip: Clip,
    monitored: MonitoredClip,
    names: tuple[str, str],
    column: int,
    failed: BoolArray,
    benchmark: bool,
) -> PairSeries:
    first, second = clip.pairs[column].tolist()
    before_m = np.linalg.norm(monitored.xy_m[:, first] - monitored.xy_m[:, second], axis=1)
    after_m = monitored.distance_m[:, column]
    one, other = monitored.reason[:, first], monitored.reason[:, second]
    reason = np.where(one != "", one, other)
    reason[np.isnan(after_m) & (reason == "")] = NOT_MEASURED
    reason[np.isnan(clip.distance_m[:, column])] = ""
    raw_m = np.linalg.norm(monitored.annotated_m[:, first] - monitored.annotated_m[:, second], axis=1)
    threshold_px = ProximityParams().outlier_threshold_px
    assert threshold_px is not None
    return PairSeries(
        names=names,
        class_pair="-".join(CLASSES[clip.class_id[end]].name for end in (first, second)),
        truth_m=clip.distance_m[:, column],
        before_m=before_m,
        after_m=after_m,
        sigma_m=monitored.sigma_m[:, column],
        filled_m=fill_as_the_filter(after_m, failed & ~np.isfinite(monitored.scale_m_per_px)),
        failed=failed,
        reason=reason,
        benchmark=fit_benchmark(raw_m, threshold_px * monitored.scale_m_per_px) if benchmark else None,
    )


def group_pairs(series: tuple[PairSeries, ...]) -> tuple[PairGroup, ...]:
    """Score all pairs of the same two classes together."""
    groups = []
    for class_pair in sorted({one.class_pair for one in series}):
        own = [one for one in series if one.class_pair == class_pair]
        compared = [one.compared() for one in own]
        scores = {
            name: score_distances(*(np.concatenate([pairs[name][side] for pairs in compared]) for side in (0, 1)))
            for name in compared[0]
        }
        if AGAINST_BENCHMARK in scores:
            # What the benchmark does not cover is missing, too.
            scores[AGAINST_BENCHMARK] = replace(scores[AGAINST_BENCHMARK], frames=scores[AFTER].frames)
        reasons = np.concatenate([one.reason for one in own])
        missing = dict(Counter(reasons[reasons != ""].tolist()).most_common())
        series_m = [np.concatenate([getattr(one, name) for one in own]) for name in ("truth_m", "after_m", "sigma_m")]
        groups.append(PairGroup(class_pair, len(own), scores, score_coverage(*series_m), missing))
    return tuple(groups)
