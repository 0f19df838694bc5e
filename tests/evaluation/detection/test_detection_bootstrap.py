from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import tolerances
from evaluation.detection.drawn_detections import CLASSES, random_scenes

from standoff.core.types import Detections
from standoff.evaluation.detection import score_detections
from standoff.evaluation.detection.bootstrap import resample_groups
from standoff.evaluation.resampling import LEAST_GROUPS
from standoff.labels import LabelledPicture

SEEDS = range(4)


def groups_of(truth: list[LabelledPicture]) -> list[str]:
    return [one.group for one in truth]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_draw_scores_like_the_pictures_drawn_as_often(seed: int) -> None:
    truth, found = random_scenes(seed)
    matches = score_detections(truth, found, CLASSES).matches
    chance = resample_groups([matches], groups_of(truth), resamples=1, seed=seed)
    assert chance is not None
    names = sorted(set(groups_of(truth)))
    (times,) = np.random.default_rng(seed).multinomial(len(names), np.full(len(names), 1 / len(names)), size=1)
    drawn = [
        k for name, often in zip(names, times, strict=True) for k in np.flatnonzero(_in(truth, name)).repeat(often)
    ]
    again = score_detections([truth[k] for k in drawn], [found[k] for k in drawn], CLASSES)
    (interval,) = chance.intervals
    assert (interval.low, interval.high) == pytest.approx((again.mean_ap11,) * 2, abs=tolerances.GEOMETRY_REL)


def _in(truth: list[LabelledPicture], name: str) -> list[bool]:
    return [one.group == name for one in truth]


@pytest.mark.parametrize("seed", SEEDS)
def test_nine_times_the_scenes_make_about_a_third_of_the_interval(seed: int) -> None:
    truth, found = random_scenes(seed, pictures=40)
    more = [replace(one, group=f"{one.group} again {k}") for k in range(9) for one in truth]
    few, many = (
        (resample_groups([score.matches], groups_of(some), resamples=400), score.mean_ap11)
        for some, score in (
            (truth, score_detections(truth, found, CLASSES)),
            (more, score_detections(more, found * 9, CLASSES)),
        )
    )
    widths = []
    for chance, mean_ap11 in (few, many):
        assert chance is not None and chance.difference is None
        (interval,) = chance.intervals
        assert interval.low < mean_ap11 < interval.high
        widths.append(interval.high - interval.low)
    # The best precision of a draw is not linear in it, so a third only roughly.
    assert 0.2 < widths[1] / widths[0] < 0.5


@pytest.mark.parametrize("seed", SEEDS)
def test_the_difference_is_of_the_same_draws(seed: int) -> None:
    truth, found = random_scenes(seed, pictures=40)
    worse = [one[one.score > 0.4] for one in found]
    first, second = (score_detections(truth, some, CLASSES).matches for some in (found, worse))
    same = resample_groups([first, first], groups_of(truth), resamples=100)
    assert same is not None and same.difference is not None
    assert (same.difference.low, same.difference.high) == (0.0, 0.0)
    lower = resample_groups([first, second], groups_of(truth), resamples=100)
    assert lower is not None and lower.difference is not None
    assert lower.difference.high < 0.0
    # What both share cancels: the scenes are harder or easier for the two alike.
    apart = lower.intervals[0].high - lower.intervals[0].low
    assert lower.difference.high - lower.difference.low < apart


def test_too_few_scenes_give_no_interval() -> None:
    truth, found = random_scenes(0, pictures=2 * LEAST_GROUPS)
    matches = score_detections(truth, found, CLASSES).matches
    assert resample_groups([matches], groups_of(truth), resamples=10) is not None
    joined = [replace(one, group="scene 0") if one.group == "scene 1" else one for one in truth]
    assert resample_groups([matches], groups_of(joined), resamples=10) is None


def test_without_any_truth_there_is_no_interval() -> None:
    truth, _ = random_scenes(0, pictures=12, ignored_share=1.0)
    matches = score_detections(truth, [Detections.empty()] * 12, CLASSES).matches
    assert resample_groups([matches], groups_of(truth), resamples=10) is None
