from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from scipy.special import expit, logit

from standoff.clips import NOISY_DETECTIONS_SCHEMA
from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff_sim.clip.detection_noise import (
    GROUPS,
    LEAST_SCORE,
    NOISE,
    POINT_MEMORY_S,
    POINT_NOISE,
    POINT_WHITE_SHARE,
    ClassNoise,
    NoisyDetector,
    PointNoise,
    size_of,
)

_SIZE_PX = (1280, 720)
_SIDES = ("x1_px", "y1_px", "x2_px", "y2_px")
_NONE_FALSE = {name: replace(noise, false_per_frame=0.0) for name, noise in NOISE.items()}
_COUNT = 4000


def _worker(
    entity_id: int = 1, box_px: tuple[float, ...] = (600.0, 300.0, 624.0, 348.0), **more: Any
) -> dict[str, Any]:
    named = dict(zip(_SIDES, box_px, strict=True))
    seen = {"entity_id": entity_id, "class_name": "worker", "class_id": 0, "visible_px": 500, "visible_share": 1.0}
    seen |= {"foot_x_px": 612.0, "foot_y_px": 345.0}
    return named | seen | more


def _found(noise: Mapping[str, ClassNoise], row: dict[str, Any], seed: int = 0) -> list[dict[str, Any]]:
    """Look at many entities alike, once each."""
    detector = NoisyDetector(_SIZE_PX, np.random.default_rng(seed), noise)
    return detector.detect(0, 0.0, [row | {"entity_id": k} for k in range(_COUNT)])


def _boxes(rows: list[dict[str, Any]]) -> FloatArray:
    return np.array([[row[side] for side in _SIDES] for row in rows])


def test_the_table_has_a_row_for_every_class() -> None:
    assert set(GROUPS) == {site_class.name for site_class in CLASSES}
    assert set(GROUPS.values()) == set(NOISE)


def test_a_detector_without_errors_finds_the_truth() -> None:
    exact = {
        name: replace(noise, found=(50.0, 0.0, 0.0), edge_bias=(0, 0, 0, 0), edge_share=(0, 0, 0, 0), edge_px=0.0)
        for name, noise in _NONE_FALSE.items()
    }
    (row,) = NoisyDetector(_SIZE_PX, np.random.default_rng(0), exact).detect(7, 0.5, [_worker()])
    assert [row[side] for side in _SIDES] == [600.0, 300.0, 624.0, 348.0]
    assert (row["frame"], row["time_s"], row["class"], row["class_id"]) == (7, 0.5, "worker", 0)
    assert list(row) == NOISY_DETECTIONS_SCHEMA.names
    pa.Table.from_pylist([row], schema=NOISY_DETECTIONS_SCHEMA)


@pytest.mark.parametrize("share", [1.0, 0.5, 0.2])
def test_who_is_hidden_is_missed_as_often_as_the_table_says(share: float) -> None:
    noise = _NONE_FALSE | {"worker": replace(_NONE_FALSE["worker"], found=(1.0, 0.5, -3.0))}
    found = len(_found(noise, _worker(visible_share=share))) / _COUNT
    size = size_of(np.array([24.0, 48.0]))
    assert found == pytest.approx(float(expit(1.0 + 0.5 * size - 3.0 * (1.0 - share))), abs=4 * 0.5 / _COUNT**0.5)


def test_nobody_is_found_where_nothing_shows() -> None:
    assert NoisyDetector(_SIZE_PX, np.random.default_rng(0), _NONE_FALSE).detect(0, 0.0, [_worker(visible_px=0)]) == []


def test_edges_are_off_by_the_bias_and_the_deviation_of_the_table() -> None:
    noise = _NONE_FALSE | {
        "worker": replace(NOISE["worker"], found=(50.0, 0, 0), edge_bias=(0.1, 0, 0, -0.05),
                          edge_share=(0.1, 0.05, 0.1, 0.05),
                          edge_px=1.0, false_per_frame=0.0)
    }  # fmt: skip
    outwards_px = (_boxes(_found(noise, _worker())) - [600.0, 300.0, 624.0, 348.0]) * [-1, -1, 1, 1]
    sigma_px = np.hypot([2.4, 2.4, 2.4, 2.4], 1.0)
    np.testing.assert_allclose(outwards_px.mean(axis=0), [2.4, 0.0, 0.0, -2.4], atol=4 * sigma_px.max() / _COUNT**0.5)
    np.testing.assert_allclose(outwards_px.std(axis=0), sigma_px, rtol=4 / (2 * _COUNT) ** 0.5)


def test_scores_lie_between_the_detectors_threshold_and_one_and_about_where_the_table_says() -> None:
    noise = _NONE_FALSE | {"worker": replace(_NONE_FALSE["worker"], found=(50.0, 0, 0), score=(1.0, 0, 0))}
    scores = np.array([row["score"] for row in _found(noise, _worker())])
    assert scores.min() >= LEAST_SCORE and scores.max() < 1.0
    assert (np.diff(scores) <= 0).all(), "the surest first"
    assert float(np.median(logit(scores))) == pytest.approx(1.0, abs=0.1)


def test_false_alarms_are_as_many_as_the_table_says_and_lie_in_the_picture() -> None:
    detector = NoisyDetector(_SIZE_PX, np.random.default_rng(3))
    rows = [row for frame in range(400) for row in detector.detect(frame, frame / 10, [])]
    per_frame = sum(NOISE[GROUPS[site_class.name]].false_per_frame for site_class in CLASSES)
    assert len(rows) / 400 == pytest.approx(per_frame, abs=5 * (per_frame / 400) ** 0.5)
    boxes_px = _boxes(rows)
    assert (boxes_px[:, :2] >= -0.5).all() and (boxes_px[:, 2:] <= np.array(_SIZE_PX) - 0.5).all()
    assert (boxes_px[:, 2:] > boxes_px[:, :2]).all()


@pytest.mark.parametrize("gap_s", [0.1, 1.0])
def test_an_error_goes_on_for_a_while_however_often_one_looks(gap_s: float) -> None:
    noise = _NONE_FALSE | {"worker": replace(_NONE_FALSE["worker"], found=(50.0, 0, 0))}
    detector = NoisyDetector(_SIZE_PX, np.random.default_rng(5), noise, memory_s=0.5)
    left_px = [detector.detect(k, k * gap_s, [_worker()])[0]["x1_px"] for k in range(_COUNT)]
    expected = np.exp(-gap_s / 0.5)
    assert np.corrcoef(left_px[1:], left_px[:-1])[0, 1] == pytest.approx(expected, abs=0.06)


@pytest.mark.parametrize("gap_s", [0.1, 2.0])
def test_a_miss_goes_on_for_as_long_as_is_said_of_misses(gap_s: float) -> None:
    noise = _NONE_FALSE | {"worker": replace(_NONE_FALSE["worker"], found=(0.0, 0.0, 0.0))}
    detector = NoisyDetector(_SIZE_PX, np.random.default_rng(6), noise, memory_s=0.1, miss_memory_s=2.0)
    found = np.array([len(detector.detect(k, k * gap_s, [_worker()])) for k in range(_COUNT)])
    # Of two numbers with this correlation so many are on the same side of zero (Sheppard, 1899).
    alike = 0.5 + np.arcsin(np.exp(-gap_s / 2.0)) / np.pi
    # However many looks there are, they hold no more news than as many memories as they last.
    few = max(_COUNT * gap_s / 2.0, 1.0)
    assert (found[1:] == found[:-1]).mean() == pytest.approx(alike, abs=4 * 0.5 / few**0.5)
    assert found.mean() == pytest.approx(0.5, abs=4 * 0.5 / few**0.5)


def test_the_same_generator_finds_the_same() -> None:
    assert _found(NOISE, _worker(), 4) == _found(NOISE, _worker(), 4)
    assert _found(NOISE, _worker(), 4) != _found(NOISE, _worker(), 5)


_NO_POINTS: Mapping[str, PointNoise] = {}
_POINTS = {"worker": PointNoise((0.1, 0.05), 0.5, (0.02, -0.04), (0.5, 2.0))}
_ALL_FOUND = _NONE_FALSE | {"worker": replace(_NONE_FALSE["worker"], found=(50.0, 0, 0))}


def _feet(rows: list[dict[str, Any]]) -> FloatArray:
    """Give (N, 4) error of the ground point and stated standard error, in longer sides of the box."""
    names = ("foot_x_px", "foot_y_px", "foot_sigma_x_px", "foot_sigma_y_px")
    return (np.array([[row[name] for name in names] for row in rows]) - [612.0, 345.0, 0.0, 0.0]) / 48.0


def test_ground_points_are_off_and_say_so_as_the_table_says() -> None:
    detector = NoisyDetector(_SIZE_PX, np.random.default_rng(8), _ALL_FOUND, point_noise=_POINTS)
    feet = _feet(detector.detect(0, 0.0, [_worker(k) for k in range(_COUNT)]))
    few = 4 / _COUNT**0.5
    np.testing.assert_allclose(np.median(feet[:, 2:], axis=0), [0.1, 0.05], rtol=1.3 * 0.5 * few)
    np.testing.assert_allclose(np.log(feet[:, 2:]).std(axis=0), 0.5, rtol=few)
    standardised = (feet[:, :2] - [0.02, -0.04]) / feet[:, 2:]
    np.testing.assert_allclose(standardised.mean(axis=0), 0.0, atol=2.0 * few)
    np.testing.assert_allclose(standardised.std(axis=0), [0.5, 2.0], rtol=few)


@pytest.mark.parametrize("gap_s", [0.1, 2.0])
def test_a_part_of_a_points_error_is_another_in_every_frame_and_the_rest_goes_on(gap_s: float) -> None:
    detector = NoisyDetector(_SIZE_PX, np.random.default_rng(9), _ALL_FOUND, point_noise=_POINTS)
    feet = _feet([detector.detect(k, k * gap_s, [_worker()])[0] for k in range(_COUNT)])
    told = ((feet[:, :2] - [0.02, -0.04]) / feet[:, 2:])[:, 0]
    expected = (1.0 - POINT_WHITE_SHARE) * np.exp(-gap_s / POINT_MEMORY_S)
    assert np.corrcoef(told[1:], told[:-1])[0, 1] == pytest.approx(expected, abs=0.08)


def test_boxes_are_the_same_whether_there_are_points_or_not() -> None:
    with_points, without = (
        NoisyDetector(_SIZE_PX, np.random.default_rng(10), point_noise=points).detect(0, 0.0, [_worker()] * 3)
        for points in (POINT_NOISE, _NO_POINTS)
    )
    assert [row["score"] for row in with_points] == [row["score"] for row in without]
    np.testing.assert_array_equal(_boxes(with_points), _boxes(without))
    assert any(row["foot_x_px"] is not None for row in with_points)
    assert all(row["foot_x_px"] is None for row in without)
