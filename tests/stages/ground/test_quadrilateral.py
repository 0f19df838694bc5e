from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.core.homography import FloatArray
from standoff.evaluation.drawn_quadrilaterals import draw_quadrilateral
from standoff.stages.ground.lines import line_through
from standoff.stages.ground.quadrilateral import (
    NO_QUADRILATERAL,
    OUTSIDE_BOX,
    TOO_SMALL,
    UNSUPPORTED,
    Quadrilateral,
    join_lines,
    quadrilateral_from_lines,
    why_implausible,
)

BOX = np.array([0.0, 0.0, 100.0, 100.0])
SQUARE = np.array([[10.0, 10.0], [10.0, 90.0], [90.0, 90.0], [90.0, 10.0]])


def side_lines(
    corners: FloatArray,
) -> FloatArray:
    return np.array([line_through(corners[k], corners[(k + 1) % 4]) for k in range(4)])


@given(
    st.integers(0, 200), st.sampled_from(list(permutations(range(4)))), st.lists(st.booleans(), min_size=4, max_size=4)
)
def test_sides_in_any_order_and_sign_give_the_same_quadrilateral(
    seed: int, order: tuple[int, ...], flips: list[bool]
) -> None:
    corners = np.random.default_rng(seed).uniform(-8, 8, (4, 2)) + SQUARE
    lines = side_lines(corners)[list(order)] * np.where(flips, -1.0, 1.0)[:, None]
    joined = join_lines(lines)
    assert joined is not None
    found, walked = joined
    turn = int(np.linalg.norm(found - corners[0], axis=1).argmin())
    np.testing.assert_allclose(np.roll(found, -turn, axis=0), corners, atol=1e-6)
    for k in range(4):
        for end in (found[k], found[(k + 1) % 4]):
            assert abs(walked[k, :2] @ end + walked[k, 2]) < 1e-6


def test_parallel_lines_make_no_quadrilateral() -> None:
    lines = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, -1.0], [1.0, 0.0, -2.0], [0.0, 1.0, 0.0]])
    assert join_lines(lines) is None
    assert quadrilateral_from_lines(lines, np.zeros((0, 2)), 1.0, None) is None


def test_support_is_the_share_of_a_side_that_has_edge_points() -> None:
    points = np.column_stack([np.full(40, 10.0), np.arange(10.5, 50.5)])
    made = quadrilateral_from_lines(side_lines(SQUARE), points, 1.0, None)
    assert made is not None
    side = int((np.abs(made.lines[:, :2] @ [10.0, 50.0] + made.lines[:, 2]) < 1e-9).argmax())
    assert made.support[side] == 0.5
    assert np.delete(made.support, side).max() < 0.05


def test_stated_corner_errors_match_the_scatter_of_repeated_drawings() -> None:
    rng = np.random.default_rng(0)
    found, stated = [], []
    for _ in range(300):
        points, lines = [], []
        for k in range(4):
            start, end = SQUARE[k], SQUARE[(k + 1) % 4]
            across = np.array([end[1] - start[1], start[0] - end[0]]) / 80.0
            # Noise shared by four neighbours, as the blur of a picture shares it.
            noise = np.repeat(rng.normal(0.0, 0.2, 20), 4)
            mine = start + np.linspace(0.0, 1.0, 80)[:, None] * (end - start) + noise[:, None] * across
            points.append(mine)
            slope = np.polynomial.Polynomial.fit(np.linspace(0, 80, 80), noise, 1)
            lines.append(line_through(start + slope(0.0) * across, end + slope(80.0) * across))
        made = quadrilateral_from_lines(np.array(lines), np.concatenate(points), 1.0, None)
        assert made is not None
        turn = int(np.linalg.norm(made.corners_px - SQUARE[0], axis=1).argmin())
        found.append(np.roll(made.corners_px, -turn, axis=0))
        stated.append(np.einsum("nii->n", made.covariance_px2).mean() / 2)
    scatter = np.var(np.array(found), axis=0).mean()
    assert 0.8 < np.sqrt(np.mean(stated) / scatter) < 1.25


def test_a_given_sigma_is_the_corners_sigma() -> None:
    made = quadrilateral_from_lines(side_lines(SQUARE), SQUARE, 1.0, 0.4)
    assert made is not None
    np.testing.assert_allclose(made.covariance_px2, np.tile(0.16 * np.eye(2), (4, 1, 1)))


@pytest.mark.parametrize(
    ("corners", "support", "reason"),
    [
        (SQUARE, 0.9, None),
        (SQUARE + np.array([0.0, 25.0]), 0.9, OUTSIDE_BOX),
        (SQUARE * 0.4, 0.9, TOO_SMALL),
        (SQUARE, 0.3, UNSUPPORTED),
    ],
)
def test_an_outline_that_cannot_be_the_reference_in_its_box_is_refused(
    corners: FloatArray, support: float, reason: str | None
) -> None:
    outline = Quadrilateral(corners, np.tile(np.eye(2), (4, 1, 1)), side_lines(corners), np.array([1, 1, 1, support]))
    why_not = why_implausible(outline, corners, BOX, 0.35)
    assert (why_not.reason if why_not is not None else None) == reason


def test_reasons_are_different_words_for_different_causes() -> None:
    assert len({NO_QUADRILATERAL, OUTSIDE_BOX, TOO_SMALL, UNSUPPORTED}) == 4


def test_the_scenes_sides_join_to_the_scenes_corners() -> None:
    corners = draw_quadrilateral("clean", 1).corners_px
    joined = join_lines(side_lines(corners))
    assert joined is not None
    np.testing.assert_allclose(np.sort(joined[0], axis=0), np.sort(corners, axis=0), atol=1e-6)
