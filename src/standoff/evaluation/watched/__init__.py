"""Whether workers are found where ground is called watched, on clips with exact truth.

from standoff.evaluation.watched import evaluate_watched

result = evaluate_watched([(Path("run"), Path("clip"))])
print(result.on_watched.missed_share, result.watched_of_findable)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from standoff.evaluation.run_and_clip import read_each
from standoff.evaluation.watched.samples import WorkerSamples, read_worker_samples
from standoff.evaluation.watched.score import Missed, WatchedResult, score_watched

__all__ = ["Missed", "WatchedResult", "WorkerSamples", "evaluate_watched", "read_worker_samples", "score_watched"]


def evaluate_watched(runs: Sequence[tuple[Path, Path]], on_run: Callable[[], None] | None = None) -> WatchedResult:
    """Compare runs with the truth of their clips, pooled.

    Args:
        runs: Folder of each run and of its clip; one at least.
        on_run: Called after each.

    Raises:
        DataError: A file is missing or not what it should be, or a run is not one of its clip.
    """
    return score_watched(read_each(runs, read_worker_samples, on_run))
