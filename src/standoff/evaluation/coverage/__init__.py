"""Whether the errors that runs state for their distances and positions are true, on clips with exact truth.

from standoff.evaluation.coverage import evaluate_coverage

for row in evaluate_coverage([(Path("run"), Path("clip"))]).pairs:
    print(row.kind, row.band, row.score.made_m, row.coverage.inside_95)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from standoff.evaluation.coverage.samples import ClipSamples, PairSamples, PositionSamples, read_samples
from standoff.evaluation.coverage.score import CoverageResult, PairRow, PositionRow, score_samples
from standoff.evaluation.run_and_clip import read_each

__all__ = [
    "ClipSamples",
    "CoverageResult",
    "PairRow",
    "PairSamples",
    "PositionRow",
    "PositionSamples",
    "evaluate_coverage",
    "read_samples",
    "score_samples",
]


def evaluate_coverage(runs: Sequence[tuple[Path, Path]], on_run: Callable[[], None] | None = None) -> CoverageResult:
    """Compare runs with the truth of their clips, pooled.

    Args:
        runs: Folder of each run and of its clip; one at least.
        on_run: Called after each.

    Raises:
        DataError: A file is missing or not what it should be, or a run is not one of its clip.
    """
    return score_samples(read_each(runs, read_samples, on_run))
