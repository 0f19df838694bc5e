from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skimage.measure import LineModelND
from tolerances import GEOMETRY_REL

from standoff.evaluation.drawn_quadrilaterals import draw_quadrilateral
from standoff.evaluation.rectification import paper_edges, ransac_by_loop
from standoff.stages.ground.lines import (
    facing,
    fit_line,
    fit_line_robustly,
    line_through,
    ransac_contours,
    refit,
    sample_pairs,
)


@pytest.mark.parametrize("seed", range(4))
def test_compiled_ransac_finds_exactly_the_lines_of_the_literal_loop(seed: int) -> None:
    points = paper_edges(draw_quadrilateral("sand", seed)).points_px
    pairs = sample_pairs(300, seed)
    contours = ransac_contours(points, pairs, 1.0)
    assert contours is not None
    np.testing.assert_array_equal(contours.lines, ransac_by_loop(points, pairs, 1.0))


def test_each_contour_takes_its_inliers_and_only_those_with_it() -> None:
    points = paper_edges(draw_quadrilateral("sand", 8)).points_px
    contours = ransac_contours(points, sample_pairs(2000, 0), 1.0)
    assert contours is not None
    taken = np.zeros(len(points), dtype=bool)
    for k, line in enumerate(contours.lines):
        near = np.abs(points @ line[:2] + line[2]) <= 1.0
        np.testing.assert_array_equal(contours.label == k, near & ~taken)
        taken |= near
    assert (np.diff(np.bincount(contours.label[contours.label >= 0])) <= 0).all()


def test_points_that_run_out_give_no_contours() -> None:
    one_line = np.column_stack([np.arange(50.0), np.zeros(50)])
    pairs = sample_pairs(50, 0)
    assert ransac_contours(one_line, pairs, 1.0) is None
    assert ransac_contours(np.zeros((0, 2)), pairs, 1.0) is None
    assert ransac_contours(np.full((30, 2), 7.0), pairs, 1.0) is None


@given(st.floats(0.0, np.pi), st.floats(-50.0, 50.0), st.integers(0, 1000))
def test_total_least_squares_agrees_with_scikit_image(angle: float, offset: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    points = rng.uniform(-40, 40, (60, 1)) * along + (offset + rng.normal(0, 0.3, (60, 1))) * across
    line = fit_line(points, np.ones(60))
    model = LineModelND.from_estimate(points)
    np.testing.assert_allclose(abs(line[:2] @ model.direction), 0.0, atol=1e3 * GEOMETRY_REL)
    np.testing.assert_allclose(line[:2] @ model.origin + line[2], 0.0, atol=1e3 * GEOMETRY_REL)
    np.testing.assert_allclose(np.hypot(line[0], line[1]), 1.0, rtol=GEOMETRY_REL)


def test_a_weight_of_zero_leaves_a_point_out() -> None:
    points = np.array([[0.0, 1.0], [4.0, 1.0], [2.0, 99.0]])
    np.testing.assert_allclose(fit_line(points, np.array([1.0, 1.0, 0.0])), [0.0, 1.0, -1.0], atol=GEOMETRY_REL)


def test_tukeys_weights_ignore_a_third_of_outliers_and_keep_the_normals_side() -> None:
    rng = np.random.default_rng(3)
    good = np.column_stack([rng.uniform(0, 100, 200), 5.0 + rng.normal(0, 0.1, 200)])
    outliers = np.column_stack([rng.uniform(0, 100, 100), rng.uniform(6.0, 9.0, 100)])
    points = np.concatenate([good, outliers])
    start = -line_through(np.array([0.0, 5.4]), np.array([100.0, 4.8]))
    line = fit_line_robustly(start, points, 10, 0.1)
    assert line[:2] @ start[:2] > 0
    assert abs(-line[2] / line[1] - 5.0) < 0.05
    assert abs(-fit_line(points, np.ones(300))[2] - 5.0) > 0.5


def test_too_few_weighted_points_leave_the_line_alone() -> None:
    start = np.array([0.0, 1.0, 0.0])
    scattered = np.array([[0.0, 0.1], [1.0, -5.0], [2.0, 9.0]])
    np.testing.assert_array_equal(fit_line_robustly(start, scattered, 3, 0.001), start)


def test_facing_turns_a_line_to_the_same_side() -> None:
    line = np.array([0.6, 0.8, 1.0])
    np.testing.assert_array_equal(facing(-line, line), line)


def test_refitting_lowers_the_squared_distance_of_the_inliers() -> None:
    points = paper_edges(draw_quadrilateral("clean", 1)).points_px
    contours = ransac_contours(points, sample_pairs(2000, 0), 1.0)
    assert contours is not None
    better = refit(points, contours)
    for k in range(4):
        mine = points[contours.label == k]
        before, after = (((mine @ line[:2] + line[2]) ** 2).sum() for line in (contours.lines[k], better.lines[k]))
        assert after < before
