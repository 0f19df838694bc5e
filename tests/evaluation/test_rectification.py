from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples

from standoff.evaluation.drawn_quadrilaterals import DIFFICULTIES, area_coverage, draw_quadrilateral
from standoff.evaluation.rectification import METHODS, MethodScore, RectificationResult, evaluate_rectification


@pytest.fixture(scope="module")
def result() -> RectificationResult:
    return evaluate_rectification(scenes=16, seed=7)


def score(result: RectificationResult, method: str, difficulty: str) -> MethodScore:
    (found,) = (s for s in result.scores if s.method == method and s.difficulty == difficulty)
    return found


def test_every_method_is_scored_on_every_class(result: RectificationResult) -> None:
    assert [(s.method, s.difficulty) for s in result.scores] == [(m, d) for m in METHODS for d in DIFFICULTIES]


def test_clean_drawings_never_fail_and_refinements_get_nearer_to_the_corners(result: RectificationResult) -> None:
    paper, least_squares, oriented = (score(result, method, "clean") for method in METHODS)
    assert paper.failed_percent == least_squares.failed_percent == oriented.failed_percent == 0.0
    assert 0.3 < paper.corner_rmse_px < 0.7
    assert least_squares.corner_rmse_px < 0.5 * paper.corner_rmse_px
    assert oriented.corner_rmse_px < 0.04


def test_hard_drawings_break_the_papers_steps_far_more_often(result: RectificationResult) -> None:
    paper, oriented = score(result, "paper", "hard"), score(result, "oriented", "hard")
    assert paper.failed_percent > 30.0
    assert oriented.failed_percent < 0.5 * paper.failed_percent


def test_stated_corner_errors_do_not_understate(result: RectificationResult) -> None:
    assert all(s.error_per_sigma < 1.5 for s in result.scores)


def test_the_compiled_ransac_is_the_loops_equal_and_the_result_is_plain(result: RectificationResult) -> None:
    assert result.same_lines
    record = json.loads(json.dumps(result.to_dict()))
    assert record["speed_up"] == result.loop_ms / result.ransac_ms
    assert len(record["scores"]) == 9


def test_what_no_method_found_is_null_in_the_record() -> None:
    nothing = MethodScore("paper", "hard", 100.0, 0.0, math.nan, math.nan, 1.0)
    (row,) = RectificationResult(1, 0, (nothing,), 1.0, 50.0, True).to_dict()["scores"]
    assert (row["failed_percent"], row["corner_rmse_px"]) == (100.0, None)


@pytest.mark.live
def test_corners_do_not_depend_on_the_run(result: RectificationResult) -> None:
    again = evaluate_rectification(scenes=16, seed=7, methods=("oriented",))
    for one in again.scores:
        other = score(result, "oriented", one.difficulty)
        assert (one.failed_percent, one.corner_rmse_px) == (other.failed_percent, other.corner_rmse_px)


def test_no_scenes_are_refused() -> None:
    with pytest.raises(ValueError, match="scenes must be 1 or more"):
        evaluate_rectification(scenes=0)


@examples(20)
@given(st.integers(0, 10_000))
def test_the_drawn_area_is_the_true_area(seed: int) -> None:
    corners = draw_quadrilateral("clean", seed).corners_px
    x, y = corners.T
    true = 0.5 * abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()))
    perimeter = float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).sum())
    # Each edge pixel is right to half a sub-pixel sample row at worst; the errors of a perimeter's pixels average out.
    assert math.isclose(float(area_coverage(corners).sum()), true, abs_tol=perimeter / 16 / 4)


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
def test_a_scene_is_the_same_whenever_it_is_drawn(difficulty: str) -> None:
    one, two, other = (draw_quadrilateral(difficulty, 3, index) for index in (4, 4, 5))  # type: ignore[arg-type]
    np.testing.assert_array_equal(one.gray, two.gray)
    assert (one.gray != other.gray).any()
