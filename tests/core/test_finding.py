from __future__ import annotations

import numpy as np
import pytest

from standoff.core.finding import KEY, WorkerFinding

TOLD = {KEY: {"height_px": [10.0, 20.0, 40.0], "share": [0.2, 0.9, 0.98]}, "input_size_px": [1280, 736]}


def test_a_detector_that_says_nothing_is_taken_to_find_less() -> None:
    guess, told = WorkerFinding.of_detector({"model": "other"}), WorkerFinding.of_detector(TOLD)
    assert not guess.measured and told.measured
    assert guess.least_height_px(0.9) > 2 * told.least_height_px(0.9)


def test_what_is_replayed_was_found_by_the_recorded_detector() -> None:
    assert WorkerFinding.of_detector({"kind": "recorded", "detector": TOLD}) == WorkerFinding.of_detector(TOLD)


@pytest.mark.parametrize("size_px", [(1280, 720), (1920, 1080), (3840, 2160), (640, 360)])
def test_a_worker_counts_as_tall_as_the_network_sees_him(size_px: tuple[int, int]) -> None:
    told = WorkerFinding.of_detector(TOLD)
    smaller = max(1.0, size_px[0] / 1280)
    np.testing.assert_allclose(told.share_found(np.array([20.0, 40.0]) * smaller, size_px), [0.9, 0.98])
    sliced = WorkerFinding.of_detector(TOLD | {"view_share": [0.5, 0.5]})
    np.testing.assert_allclose(sliced.share_found(np.array([20.0]) * max(1.0, smaller / 2), size_px), [0.9])


def test_taller_workers_are_never_found_less() -> None:
    shares = WorkerFinding.of_detector(TOLD).share_found(np.geomspace(1.0, 1000.0, 200), (1280, 720))
    assert (np.diff(shares) >= 0.0).all() and shares[0] == 0.0 and shares[-1] == 0.98
    assert WorkerFinding.of_detector(TOLD).share_found(np.array([np.nan]), (1280, 720)) == 0.0


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9, 0.95, 0.98])
def test_the_least_height_is_where_the_share_is_reached(share: float) -> None:
    told = WorkerFinding.of_detector(TOLD)
    found = told.share_found(np.array([told.least_height_px(share)]), (1280, 720))
    assert found == pytest.approx(share)
    assert told.least_height_px(0.99) == float("inf")
