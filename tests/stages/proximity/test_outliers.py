from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.stages.proximity.outliers import BoundedFilter, OutlierFilter, PaperFilter


def after(outlier_filter: OutlierFilter, distances_m: list[float], *, step_s: float = 0.1) -> list[float]:
    return [outlier_filter.update(step_s * i, distance_m, 2.0) for i, distance_m in enumerate(distances_m)]


def bounded() -> BoundedFilter:
    return BoundedFilter(max_speed_mps=15.0, max_replaced_s=0.5)


@pytest.mark.parametrize("outlier_filter", [PaperFilter(), bounded()])
def test_a_single_outlier_is_replaced_by_the_mean_of_the_previous_two(outlier_filter: OutlierFilter) -> None:
    assert after(outlier_filter, [10.0, 11.0, 30.0, 11.5, 12.0]) == [10.0, 11.0, 10.5, 11.5, 12.0]


@pytest.mark.parametrize("outlier_filter", [PaperFilter(), bounded()])
def test_the_first_two_distances_pass_as_they_are(outlier_filter: OutlierFilter) -> None:
    assert after(outlier_filter, [10.0, 90.0]) == [10.0, 90.0]


def test_the_papers_filter_counts_replacements_as_estimates_and_so_freezes_after_a_jump() -> None:
    found = after(PaperFilter(), [10.0, 11.0, *[40.0] * 100])
    assert found[2:5] == [10.5, 10.75, 10.625]
    assert found[-1] == pytest.approx(10.0 + 2.0 / 3.0)


@given(
    before_m=st.floats(0, 100),
    after_m=st.floats(0, 100),
    step_s=st.floats(0.01, 2.0),
)
def test_the_bounded_filter_takes_a_new_level_within_its_time(before_m: float, after_m: float, step_s: float) -> None:
    frames = int(0.5 / step_s) + 2
    found = after(bounded(), [before_m] * 3 + [after_m] * frames, step_s=step_s)
    assert found[-1] == after_m


@given(
    start_m=st.floats(0, 100),
    moves=st.lists(st.tuples(st.floats(0.01, 1.0), st.floats(-14.9, 14.9)), min_size=5, max_size=30),
)
def test_the_bounded_filter_never_replaces_what_could_really_have_moved_so_far(
    start_m: float, moves: list[tuple[float, float]]
) -> None:
    outlier_filter = bounded()
    time_s, distance_m = 0.0, start_m
    for gap_s, speed_mps in moves:
        time_s, distance_m = time_s + gap_s, distance_m + gap_s * speed_mps
        assert outlier_filter.update(time_s, distance_m, 0.0) == distance_m


def test_a_loader_at_full_speed_and_the_papers_frame_rate_is_hidden_by_the_papers_filter_only() -> None:
    approach = [40.0 - 3.4 * i for i in range(11)]
    assert after(bounded(), approach, step_s=0.278) == approach
    assert min(after(PaperFilter(), approach, step_s=0.278)) > 36.0
