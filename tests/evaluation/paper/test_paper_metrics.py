from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import chebyshev

from standoff.core.homography import FloatArray
from standoff.evaluation.paper.benchmark_polynomial import DEGREE, fit_benchmark
from standoff.evaluation.paper.metrics import ale_m, fill_as_the_filter, made_m, mape_percent, score_distances
from standoff.evaluation.paper.truth_detector import BoxError
from standoff.stages.proximity.outliers import PaperFilter

LENGTHS = st.lists(st.floats(0.5, 100.0), min_size=1, max_size=30)


@given(LENGTHS, st.integers(0, 2**32 - 1))
def test_made_and_mape_are_what_numpy_says(truth: list[float], seed: int) -> None:
    truth_m = np.array(truth)
    estimate_m = truth_m + np.random.default_rng(seed).normal(0.0, 1.0, len(truth))
    assert made_m(truth_m, estimate_m) == pytest.approx(np.abs(truth_m - estimate_m).sum() / len(truth))
    assert mape_percent(truth_m, estimate_m) == pytest.approx((100 * np.abs(1 - estimate_m / truth_m)).mean())


@given(LENGTHS, st.floats(0.1, 10.0))
def test_a_larger_unit_scales_made_and_leaves_mape_alone(truth: list[float], unit: float) -> None:
    truth_m, estimate_m = np.array(truth), np.array(truth) + 0.7
    assert made_m(unit * truth_m, unit * estimate_m) == pytest.approx(unit * made_m(truth_m, estimate_m))
    assert mape_percent(unit * truth_m, unit * estimate_m) == pytest.approx(mape_percent(truth_m, estimate_m))


def test_ale_by_hand() -> None:
    scale, truth_px = np.array([0.01, 0.02]), np.array([[100.0, 50.0], [0.0, 0.0]])
    assert ale_m(scale, truth_px, truth_px + np.array([[3.0, 4.0], [6.0, 8.0]])) == pytest.approx((0.05 + 0.2) / 2)


def test_missing_estimates_are_counted_and_not_averaged() -> None:
    score = score_distances(np.array([[10.0, np.nan], [20.0, 30.0]]), np.array([[12.0, 5.0], [np.nan, 27.0]]))
    assert (score.frames, score.measured) == (3, 2)
    assert (score.made_m, score.median_m, score.worst_m) == pytest.approx((2.5, -0.5, 3.0))
    nothing = score_distances(np.array([10.0, 20.0]), np.full(2, np.nan))
    assert (nothing.frames, nothing.measured) == (2, 0)
    assert np.isnan(nothing.made_m)


@given(st.lists(st.one_of(st.floats(1.0, 50.0), st.none()), min_size=3, max_size=25))
def test_filling_changes_no_estimate_and_follows_the_papers_filter(values: list[float | None]) -> None:
    estimate_m = np.array([np.nan if value is None else value for value in values])
    filled_m = fill_as_the_filter(estimate_m, np.isnan(estimate_m))
    measured = np.isfinite(estimate_m)
    assert (filled_m[measured] == estimate_m[measured]).all()
    # What a failed rectification makes of the distance, however wrong, the filter replaces by the same number.
    paper, follows = PaperFilter(), True
    for index, distance_m in enumerate(np.where(measured, estimate_m, 1e6)):
        follows &= bool(measured[index]) or index >= 2
        result_m = paper.update(float(distance_m), 1e3)
        assert not follows or result_m == pytest.approx(filled_m[index])


def test_a_gap_that_may_not_be_filled_stays() -> None:
    filled_m = fill_as_the_filter(np.array([5.0, 5.0, np.nan, np.nan]), np.array([False, False, False, True]))
    assert np.isnan(filled_m[2:]).all()


def _wavy(frame: FloatArray) -> FloatArray:
    return np.asarray(12.0 - 0.02 * frame + 2.0 * np.sin(frame / 40.0))


def test_the_benchmark_is_two_fits_with_outliers_dropped_between() -> None:
    rng = np.random.default_rng(7)
    frame = np.arange(200.0)
    raw_m = _wavy(frame) + rng.normal(0.0, 0.1, 200)
    raw_m[[20, 90, 150]] += 30.0
    raw_m[60:65] = np.nan
    benchmark = fit_benchmark(raw_m, np.full(200, 1.0))
    good = np.isfinite(raw_m)
    good[[20, 90, 150]] = False
    x = frame / 100.0 - 1.0
    baseline_m = chebyshev.chebval(x, chebyshev.chebfit(x[good], raw_m[good], DEGREE))
    near = good & (np.abs(raw_m - baseline_m) <= np.std((raw_m - baseline_m)[good]))
    trend_m = chebyshev.chebval(x, chebyshev.chebfit(x[near], raw_m[near], DEGREE))
    assert (benchmark.kept == near).all()
    inside = slice(int(np.flatnonzero(near)[0]), int(np.flatnonzero(near)[-1]) + 1)
    np.testing.assert_allclose(benchmark.baseline_m[inside], baseline_m[inside], rtol=1e-9)
    np.testing.assert_allclose(benchmark.trend_m[inside], trend_m[inside], rtol=1e-9)
    assert np.isfinite(benchmark.trend_m).sum() == inside.stop - inside.start


def test_the_benchmark_of_a_true_polynomial_is_that_polynomial() -> None:
    frame = np.arange(120.0)
    raw_m = 8.0 + 3.0 * chebyshev.chebval(frame / 60.0 - 1.0, np.array([0.0, 1.0, 0.0, 0.5]))
    benchmark = fit_benchmark(raw_m, np.full(120, 5.0))
    inside = np.isfinite(benchmark.trend_m)
    np.testing.assert_allclose(benchmark.trend_m[inside], raw_m[inside], rtol=1e-9)


def test_too_few_estimates_give_no_benchmark() -> None:
    raw_m = np.where(np.arange(100) < 15, 10.0, np.nan)
    benchmark = fit_benchmark(raw_m, np.full(100, 1.0))
    assert np.isnan(benchmark.trend_m).all() and not benchmark.kept.any()
    assert np.isnan(fit_benchmark(np.full(30, np.nan), np.full(30, np.nan)).trend_m).all()


@given(st.floats(0.0, 5.0), st.floats(0.0, 0.3))
def test_a_box_errors_standard_error_grows_with_the_side_across(px: float, share: float) -> None:
    sigma_px = BoxError(px, share).sigma_px(np.array([[10.0, 20.0, 40.0, 120.0]]))
    np.testing.assert_allclose(sigma_px, [[px + 30 * share, px + 100 * share] * 2])
