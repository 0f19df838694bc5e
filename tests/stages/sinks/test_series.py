from __future__ import annotations

import itertools
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from standoff.stages.sinks.series import Series, Trail

GAPS = st.lists(st.one_of(st.floats(-20, 60), st.just(float("nan"))), min_size=1, max_size=300)


def _series(gaps: list[float], capacity: int) -> Series:
    series = Series(capacity)
    for i, gap in enumerate(gaps):
        series.add(0.1 * i, gap, gap + 5.0, 0.2)
    return series


@given(GAPS, st.integers(2, 20))
def test_the_closest_approach_survives_any_thinning(gaps: list[float], capacity: int) -> None:
    series = _series(gaps, capacity)
    kept = series.column("gap_m")
    assert len(kept) <= capacity
    finite = [gap for gap in gaps if not math.isnan(gap)]
    if not finite:
        assert series.closest is None
        assert np.isnan(kept).all()
        return
    assert series.closest is not None
    assert series.closest.gap_m == np.nanmin(kept) == min(finite)
    at = 0.1 * gaps.index(min(finite))
    assert series.closest.time_s == at
    assert at in series.column("time_s")


@given(GAPS, st.integers(2, 20))
def test_no_unmeasured_frame_is_hidden_by_thinning(gaps: list[float], capacity: int) -> None:
    series = _series(gaps, capacity)
    spans = series.unmeasured_spans_s()
    for i, gap in enumerate(gaps):
        if math.isnan(gap):
            assert any(start <= 0.1 * i <= end for start, end in spans)
    assert series.column("unmeasured").sum() == sum(map(math.isnan, gaps))
    assert series.column("frames").sum() == len(gaps)
    assert all(a[1] < b[0] for a, b in itertools.pairwise(spans))


def test_without_thinning_the_spans_are_exact() -> None:
    nan = float("nan")
    assert _series([1, nan, nan, 2, nan], 100).unmeasured_spans_s() == [(0.1, 0.1 * 3), (0.4, 0.4)]
    assert _series([1.0, 2.0], 100).unmeasured_spans_s() == []


@given(st.integers(1, 500), st.integers(4, 40))
def test_a_path_keeps_to_its_capacity_and_to_where_it_was(frames: int, capacity: int) -> None:
    path = Trail("worker 1", 0, capacity)
    for i in range(frames):
        path.add(float(i), -float(i))
    points = path.points_m
    assert len(path) == frames
    assert 1 <= len(points) <= capacity
    np.testing.assert_array_equal(points[:, 0], -points[:, 1])
    assert (np.diff(points[:, 0]) > 0).all()


def test_a_path_breaks_where_the_position_was_unknown() -> None:
    path = Trail("worker 1", 0, 16)
    for i in range(200):
        lost = 60 <= i < 120
        path.add(float("nan") if lost else float(i), 0.0)
    points = path.points_m
    crossing = [
        (a, b)
        for a, b in zip(points[:-1, 0], points[1:, 0], strict=True)
        if a < 60 and b >= 120 and not np.isnan(a + b)
    ]
    assert np.isnan(points).any()
    assert crossing == []
