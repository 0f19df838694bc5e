"""The guard of what every distance says of itself: stated errors are true, over clips that nobody looked at before.

Errors of one clip stand or fall together: its map, its lens, one excavator seen from one side for as long as it lasts.
So one clip is nearly all in or all out, and only clips count. Over 330 clips of eleven presets the 95 % intervals held
0.99 of the distances and the 68 % intervals 0.86 (bootstrap over clips: 0.99 to 1, 0.84 to 0.87): ground points of what
is in full view are better than they say, and the stated errors allow for more than happens.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
import tolerances

from standoff.evaluation.coverage import ClipSamples, PairRow, score_samples

sys.path.insert(0, str(Path(__file__).parents[3] / "examples" / "pooled_errors"))
from noisy_runs import run_noisily

_QUICK = (("busy", 301), ("busy", 302), ("busy", 303), ("mobile", 301))
_MANY = [(preset, seed) for preset in ("busy", "mobile", "stationary-15") for seed in range(401, 409)]


def pooled(samples: Sequence[ClipSamples]) -> PairRow:
    return score_samples(samples).whole_kinds()[0]


def stated_as(share: float, samples: Sequence[ClipSamples]) -> list[ClipSamples]:
    return [replace(one, pairs=replace(one.pairs, sigma_m=share * one.pairs.sigma_m)) for one in samples]


@pytest.mark.live
def test_the_stated_errors_of_pooled_clips_are_true(tmp_path: Path) -> None:
    samples = [run_noisily(preset, seed, tmp_path, frames=8, clutter=0.02).samples for preset, seed in _QUICK]
    row = pooled(samples)
    assert row.score.measured > 300
    assert row.coverage.inside_95 >= tolerances.POOLED_COVERAGE["inside_95"]
    assert row.coverage.inside_68 >= tolerances.POOLED_COVERAGE["inside_68"]
    halved = pooled(stated_as(0.5, samples)).coverage
    assert halved.inside_95 < tolerances.POOLED_COVERAGE["inside_95"]
    assert halved.inside_68 < tolerances.POOLED_COVERAGE["inside_68"]


@pytest.mark.live
def test_the_stated_errors_of_many_clips_are_true_and_not_much_too_wide(tmp_path: Path) -> None:
    samples = [run_noisily(preset, seed, tmp_path, frames=15).samples for preset, seed in _MANY]
    row = pooled(samples)
    low, high = row.intervals["inside_95"]
    assert row.coverage.inside_95 >= tolerances.POOLED_COVERAGE["inside_95"]
    assert row.coverage.inside_68 >= tolerances.POOLED_COVERAGE["inside_68"]
    assert low >= tolerances.POOLED_COVERAGE["inside_95"] - 0.03 and high > 0.95
    for kind in score_samples(samples).whole_kinds():
        assert kind.coverage.inside_95 >= tolerances.COVERAGE_OF_A_KIND, kind.kind
