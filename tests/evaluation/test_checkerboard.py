from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from standoff.core.camera import Camera
from standoff.core.errors import DataError, GroundError, OutputError, SourceError
from standoff.core.homography import FloatArray
from standoff.evaluation.checkerboard import accuracy_percent, evaluate_checkerboard, evaluate_views, first_corner_first
from standoff.evaluation.checkerboard_figure import checkerboard_figure
from standoff.stages.ground import BoardView, load_camera

_MATRIX = np.array([[700.0, 0, 320.0], [0, 700.0, 240.0], [0, 0, 1]])
_PINHOLE = Camera(640, 480, _MATRIX, np.zeros(5))
_LENS = Camera(640, 480, _MATRIX, np.array([-0.3, 0.1, 0.0, 0.0, 0.0]))


def photographed(tilt_deg: float, camera: Camera = _PINHOLE, name: str = "view.png") -> BoardView:
    """A 9x6 board of 25 mm, as OpenCV projects it 0.5 m away, tilted about the picture's horizontal."""
    grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(6.0)), axis=-1) * 0.025
    space = np.concatenate([grid - grid.mean(axis=(0, 1)), np.zeros((6, 9, 1))], axis=-1).reshape(-1, 3)
    turn, shift = np.array([np.radians(tilt_deg), 0.0, 0.0]), np.array([0.0, 0.0, 0.5])
    corners = cv2.projectPoints(space, turn, shift, camera.matrix, camera.distortion)[0]
    return BoardView(name, (640, 480), corners.reshape(6, 9, 2))


@pytest.mark.parametrize("tilt_deg", [0.0, 20.0, 45.0])
def test_exact_corners_measure_exactly_after_rectification(tilt_deg: float) -> None:
    result = evaluate_views([photographed(tilt_deg)], (9, 6), 0.025, _PINHOLE)
    (view,) = result.views
    np.testing.assert_allclose(view.after_m, view.truth_m, rtol=1e-6)
    np.testing.assert_allclose(view.after_pose_m, view.truth_m, rtol=1e-6)
    assert view.tilt_deg == pytest.approx(tilt_deg, abs=1e-4)
    assert result.after_percent == pytest.approx(100.0, abs=1e-4)
    assert (result.before_percent == pytest.approx(100.0, abs=1e-6)) == (tilt_deg == 0.0)


def test_more_tilt_measures_worse_before_rectification() -> None:
    percents = [evaluate_views([photographed(t)], (9, 6), 0.025).before_percent for t in (0.0, 10.0, 20.0, 40.0)]
    assert percents == sorted(percents, reverse=True)
    assert percents[0] - percents[-1] > 5.0


def test_the_lens_is_removed_when_it_is_known() -> None:
    views = [photographed(30.0, _LENS)]
    without, with_lens = (evaluate_views(views, (9, 6), 0.025, camera) for camera in (None, _LENS))
    assert without.after_percent < 99.9
    assert with_lens.after_percent == pytest.approx(100.0, abs=1e-4)


def test_the_reference_is_the_first_side_and_the_targets_are_all_other_corners() -> None:
    (view,) = evaluate_views([photographed(30.0)], (9, 6), 0.025).views
    assert view.truth_m.shape == (53,)
    assert view.truth_m[0] == view.before_m[0] == 0.025
    assert view.truth_m[-1] == pytest.approx(0.025 * np.hypot(8, 5))
    assert view.truth_m[8] == pytest.approx(0.025)


def test_the_first_corner_is_nearest_to_the_pictures_top_left_whatever_the_finder_called_first() -> None:
    corners = photographed(30.0).corners_px
    turned: list[FloatArray] = [
        corners,
        corners[::-1],
        corners[:, ::-1],
        corners[::-1, ::-1],
        corners.transpose(1, 0, 2),
    ]
    for grid in turned:
        np.testing.assert_array_equal(first_corner_first(grid), corners)
    outer = corners[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert np.linalg.norm(outer, axis=1).argmin() == 0
    percents = {evaluate_views([BoardView("v", (640, 480), grid)], (9, 6), 0.025).before_percent for grid in turned}
    assert len(percents) == 1


def test_the_papers_table_gives_the_papers_accuracy() -> None:
    # Table 5, last frame, the targets that are printed: 3.13, 6.24, 9.34, 12.46, 15.60 for 3.13 ... 15.63.
    truth_m, estimate_m = np.array([3.13, 6.25, 9.38, 12.50, 15.63]), np.array([3.13, 6.24, 9.34, 12.46, 15.60])
    by_hand = 100 - 20 * (0 + 0.01 / 6.25 + 0.04 / 9.38 + 0.04 / 12.5 + 0.03 / 15.63)
    assert accuracy_percent(truth_m, estimate_m) == pytest.approx(by_hand)


def test_the_shared_boards_repeat_the_papers_result(shared_data: Path) -> None:
    folder = shared_data / "checkerboards"
    plain = evaluate_checkerboard(folder)
    assert 87.0 <= plain.before_percent <= 92.0
    assert 97.0 <= plain.after_percent <= 97.8
    assert np.isnan(plain.after_pose_percent)
    assert len(plain.views) == 13
    assert not plain.views_failed
    with_camera = evaluate_checkerboard(folder, camera=load_camera(folder / "left_intrinsics.yml"))
    assert with_camera.after_percent > plain.after_percent
    assert with_camera.after_pose_percent > 99.5
    assert all(15.0 < view.tilt_deg < 42.0 for view in with_camera.views)


def test_the_overall_figure_is_the_mean_over_the_views() -> None:
    result = evaluate_views([photographed(t, name=f"{t}.png") for t in (5.0, 25.0)], (9, 6), 0.025)
    assert result.before_percent == pytest.approx(np.mean([row["before_percent"] for row in result.per_view]))
    every_m = np.concatenate([view.before_m for view in result.views])
    assert result.before_percent == pytest.approx(accuracy_percent(np.tile(result.truth_m, 2), every_m))


def test_the_result_as_json_holds_the_figures_the_views_and_both_tables() -> None:
    views = [photographed(25.0), BoardView("blurred.png", (640, 480), np.zeros((0, 0, 2)))]
    result = evaluate_views(views, (9, 6), 0.025).to_dict()
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert result["views_failed"] == {"blurred.png": "no whole board found"}
    assert "nearest to the picture's top left" in result["first_corner"]
    assert result["after_pose_percent"] is None
    assert [row["view"] for row in result["per_view"]] == ["view.png"]
    assert len(result["tables"]) == 53
    assert result["tables"][0]["before_m"] == [0.025]


def test_a_view_whose_corner_falls_beyond_the_horizon_is_listed_not_scored() -> None:
    bent = photographed(30.0)
    corners = bent.corners_px.copy()
    corners[1, 1] -= (corners[1, 1] - corners[0, 0]) * 0.3
    result = evaluate_views([photographed(10.0), BoardView("bent.png", (640, 480), corners)], (9, 6), 0.025)
    assert [view.name for view in result.views] == ["view.png"]
    assert "beyond the horizon" in result.views_failed["bent.png"]


def test_unusable_input_is_refused_in_one_line(tmp_path: Path) -> None:
    missing = BoardView("missing.png", (640, 480), np.zeros((0, 0, 2)))
    with pytest.raises(DataError, match=r"a board of 9x6 .* found none in 1\."):
        evaluate_views([missing], (9, 6), 0.025)
    with pytest.raises(GroundError, match="positive side"):
        evaluate_views([photographed(10.0)], (9, 6), float("nan"))
    with pytest.raises(DataError, match="aspect ratio"):
        evaluate_views([photographed(10.0)], (9, 6), 0.025, Camera(1920, 1080, _MATRIX, np.zeros(5)))
    with pytest.raises(SourceError, match="found none in"):
        evaluate_checkerboard(tmp_path)


@pytest.mark.parametrize("camera", [pytest.param(None, marks=pytest.mark.live), _PINHOLE])
def test_the_figure_is_drawn(tmp_path: Path, camera: Camera | None) -> None:
    views = [photographed(t, name=f"{t}.png") for t in (5.0, 15.0, 30.0)]
    path = tmp_path / "figure.png"
    checkerboard_figure(evaluate_views(views, (9, 6), 0.025, camera), path)
    picture = cv2.imread(str(path))
    assert picture is not None
    assert picture.shape[1] > 1000
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 50


def test_a_figure_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    result = evaluate_views([photographed(20.0)], (9, 6), 0.025)
    for path in (tmp_path / "missing" / "figure.png", tmp_path / "figure.strange"):
        with pytest.raises(OutputError, match="Choose another path"):
            checkerboard_figure(result, path)
