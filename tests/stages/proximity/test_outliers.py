from __future__ import annotations

import pytest

from standoff.stages.proximity.outliers import PaperFilter


def after(distances_m: list[float]) -> list[float]:
    paper = PaperFilter()
    return [paper.update(distance_m, 2.0) for distance_m in distances_m]


def test_a_single_outlier_is_replaced_by_the_mean_of_the_previous_two() -> None:
    assert after([10.0, 11.0, 30.0, 11.5, 12.0]) == [10.0, 11.0, 10.5, 11.5, 12.0]


def test_the_first_two_distances_pass_as_they_are() -> None:
    assert after([10.0, 90.0]) == [10.0, 90.0]


def test_replacements_count_as_estimates_so_that_it_freezes_after_a_jump() -> None:
    found = after([10.0, 11.0, *[40.0] * 100])
    assert found[2:5] == [10.5, 10.75, 10.625]
    assert found[-1] == pytest.approx(10.0 + 2.0 / 3.0)


def test_it_hides_a_loader_at_full_speed_at_the_papers_frame_rate() -> None:
    assert min(after([40.0 - 3.4 * i for i in range(11)])) > 36.0
