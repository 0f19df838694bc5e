from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import drawn_clip
import numpy as np
import pytest
import tolerances

from standoff.cli.paper_tables import print_results
from standoff.clips import Clip, load_clip
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import GroundMap
from standoff.evaluation.paper import ClipResult, MonitorSetup, evaluate_clip, pool, write_report
from standoff.evaluation.paper.corner_order import CornerOrder
from standoff.evaluation.paper.map_only import NEAR_M, MapSamples, figures_of, score_map
from standoff.evaluation.paper.mapped_points import MappedPoints, level_feet_px
from standoff.evaluation.paper.monitor_setup import settings_for
from standoff.evaluation.paper.monitored_clip import MonitoredClip
from standoff.evaluation.paper.rectified import score_rectification
from standoff.stages.ground import ReferenceShape, load_camera, map_from_view


@pytest.fixture(scope="module")
def clip(clip_folder: Path) -> Clip:
    return load_clip(clip_folder)


@pytest.fixture(scope="module")
def fused(clip: Clip) -> ClipResult:
    return evaluate_clip(clip, MonitorSetup("fused"))


def test_on_level_ground_the_level_feet_are_where_the_picture_shows_the_feet(clip: Clip) -> None:
    np.testing.assert_allclose(level_feet_px(clip), clip.foot_px, atol=tolerances.PROJECTED_PX)


def test_uneven_ground_is_left_out_of_the_level_feet(clip: Clip) -> None:
    assert clip.reference is not None
    raised = replace(clip, reference=replace(clip.reference, ground_m=0.5))
    camera_m = clip.camera_m + np.array([0.0, 0.0, 0.5])
    np.testing.assert_allclose(
        level_feet_px(replace(raised, camera_m=camera_m)), level_feet_px(clip), atol=tolerances.PROJECTED_PX
    )
    assert np.abs(level_feet_px(raised) - level_feet_px(clip))[..., 1].min() > 10.0


def test_the_default_method_maps_every_frame_and_knows_how_well(fused: ClipResult) -> None:
    score = fused.map_only
    assert score is not None
    # What lies on the square for a moment hides it; the motion of the picture carries the map across.
    assert (score.frames, score.without_map, score.without_map_since_seen) == (drawn_clip.FRAMES, 0, 0)
    assert fused.rectification is not None and fused.rectification.wrong == 0
    for figures in (score.level, score.uneven):
        assert 0.0 < figures.median_m < figures.p95_m < figures.worst_m < tolerances.DRAWN_SITE_M["fused"]
        assert figures.believed_wrong_share == 0.0 and figures.beyond == 0
        assert figures.inside_share > tolerances.STATED_COVERAGE
        assert 0.0 < figures.sigma_m < tolerances.DRAWN_SITE_M["fused"]


def test_only_visible_points_near_the_reference_count(clip: Clip, fused: ClipResult) -> None:
    assert fused.map_only is not None
    middle_m = drawn_clip.SQUARE_M.mean(axis=0)
    near = np.linalg.norm(clip.xy_m - middle_m, axis=2) <= NEAR_M
    assert fused.map_only.level.points == (near & np.isfinite(clip.box_px).all(axis=2)).sum()


def exact_ground(clip: Clip, frame: int, sigma_m: float) -> GroundMap:
    camera = load_camera(clip.folder / "camera.yaml")
    view = View(camera, clip.camera_m[frame], clip.site_to_camera[frame])
    covariance = np.diag([1e-12] * 3 + [sigma_m**2, sigma_m**2, 1e-12] + [1e-12] * 2)
    corners_px = drawn_clip.seen_px(frame, drawn_clip.SQUARE_M)
    return map_from_view(view, covariance, method="exact", scale_m_per_px=0.03, anchors_px=corners_px)


@pytest.mark.parametrize("turn", range(4))
def test_a_maps_own_error_is_stated_where_the_truth_is_even_if_the_square_was_taken_for_turned(
    clip: Clip, turn: int
) -> None:
    # The camera's place is uncertain in x and y alone, so every point is by as much, whichever way the square turns.
    turning = CornerOrder(ReferenceShape.from_corners(drawn_clip.SQUARE_M), drawn_clip.SQUARE_M)
    ground, points = exact_ground(clip, 3, 0.1), MappedPoints.blank(4, clip.foot_px.shape[1])
    points.take(3, clip.foot_px[3], ground, turning, turn)
    np.testing.assert_allclose(points.xy_m[3], turning.to_site(clip.xy_m[3], turn), atol=1e-6)
    expected = np.broadcast_to(0.01 * np.eye(2), points.covariance_m2[3].shape)
    np.testing.assert_allclose(points.covariance_m2[3], expected, atol=1e-6)
    assert np.isnan(points.xy_m[:3]).all()


def test_a_covariance_turns_with_its_position() -> None:
    turning = CornerOrder(ReferenceShape.from_corners(drawn_clip.SQUARE_M), drawn_clip.SQUARE_M)
    off_m, covariance_m2 = np.array([[0.3, -0.1]]), np.array([[[0.04, 0.01], [0.01, 0.09]]])
    before = off_m[0] @ np.linalg.solve(covariance_m2[0], off_m[0])
    middle_m = drawn_clip.SQUARE_M.mean(axis=0)
    for turn in range(4):
        turned_m = turning.to_site(middle_m + off_m, turn) - middle_m
        turned_m2 = turning.covariance_to_site(covariance_m2, turn)
        assert turned_m[0] @ np.linalg.solve(turned_m2[0], turned_m[0]) == pytest.approx(before)
    assert not np.allclose(turning.covariance_to_site(covariance_m2, 1), covariance_m2)


def samples(error_m: FloatArray, sigma_m: float) -> MapSamples:
    return MapSamples(error_m, error_m / sigma_m, np.full(len(error_m), sigma_m), beyond=2)


def test_wrong_and_believed_is_off_by_much_and_by_many_stated_errors() -> None:
    figures = figures_of([samples(np.array([0.1, 0.4, 0.6, 2.0]), 0.1), samples(np.array([2.0]), 1.0)])
    # 0.6 m and 2 m at 0.1 m stated; 0.4 m is too little, 2 m at 1 m stated is covered.
    assert figures.believed_wrong_share == pytest.approx(2 / 5)
    # 95 % of a normal distribution in the plane are within 2.45 standard errors.
    assert figures.inside_share == pytest.approx(2 / 5)
    assert (figures.points, figures.beyond, figures.worst_m, figures.median_m) == (5, 4, 2.0, 0.6)
    nothing = figures_of([samples(np.zeros(0), 1.0)])
    assert nothing.points == 0 and np.isnan(nothing.median_m)


def test_frames_before_the_reference_was_whole_in_the_picture_are_counted_apart(clip: Clip) -> None:
    assert clip.reference is not None
    corners_px = clip.reference.corners_px.copy()
    corners_px[:5, 0, 0] = -50.0
    late = replace(clip, reference=replace(clip.reference, corners_px=corners_px))
    monitored = MonitoredClip.blank(late, (1280, 720))
    monitored.scale_m_per_px[8:] = 0.03
    score = score_map(late, monitored)
    assert (score.without_map, score.frames_since_seen) == (8, drawn_clip.FRAMES - 5)
    assert score.without_map_since_seen == 3


def test_a_map_carried_past_the_edge_of_the_picture_is_not_judged_by_corners_that_nobody_sees(
    clip: Clip, fused: ClipResult
) -> None:
    assert clip.reference is not None and fused.monitored is not None
    monitored = replace(
        fused.monitored, carried=np.arange(clip.frame_count) < 6, corner_error_px=fused.monitored.corner_error_px.copy()
    )
    monitored.corner_error_px[:6] = 50.0
    corners_px = clip.reference.corners_px.copy()
    corners_px[:6, 0, 0] = -50.0
    score = score_rectification(monitored, replace(clip.reference, corners_px=corners_px))
    assert (score.out_of_sight, score.failed, score.wrong) == (6, 0, 0)
    assert score.worst_corner_px < 5.0


def test_clips_are_pooled_point_by_point_and_doubted_clip_by_clip(clip: Clip, fused: ClipResult) -> None:
    assert pool([]) is None
    alone = pool([fused])
    assert alone is not None and fused.map_only is not None
    assert alone.level == fused.map_only.level and alone.intervals == {}
    assert fused.monitored is not None
    xy_m = fused.monitored.level_feet.xy_m + np.array([3.0, 0.0])
    monitored = replace(fused.monitored, level_feet=replace(fused.monitored.level_feet, xy_m=xy_m))
    off = replace(fused, monitored=monitored, map_only=score_map(clip, monitored))
    both = pool([fused, off])
    assert both is not None
    assert both.level.points == 2 * alone.level.points
    assert both.level.believed_wrong_share == pytest.approx(0.5)
    # Of two clips each is drawn twice in a quarter of all draws.
    assert both.intervals["level believed_wrong_share"] == (0.0, 1.0)
    assert both.intervals["uneven believed_wrong_share"] == (0.0, 0.0)
    assert json.loads(json.dumps(both.to_dict()))["intervals"]["level believed_wrong_share"] == [0.0, 1.0]


@pytest.mark.parametrize(
    ("trial", "camera", "height_m"),
    [
        (MonitorSetup("fused"), True, 0.0),
        (MonitorSetup("fused", camera="unknown"), False, 0.0),
        (MonitorSetup("refined", height="unknown"), True, None),
        (MonitorSetup("paper"), False, 0.0),
        (MonitorSetup("paper", camera="file"), True, 0.0),
    ],
)
def test_what_the_monitor_is_told_of_camera_and_height(
    clip: Clip, trial: MonitorSetup, camera: bool, height_m: float | None
) -> None:
    settings = settings_for(clip, trial)
    assert settings.ground.reference is not None
    assert (settings.ground.camera is not None, settings.ground.reference.height_m) == (camera, height_m)
    assert trial.describe()["camera"] == ("file" if camera else "unknown")


@pytest.mark.live
def test_the_map_is_in_table_and_report(fused: ClipResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    print_results([fused, fused])
    said = capsys.readouterr().out
    assert said.index("The map alone") < said.index("The map alone, 2 clips")
    assert fused.map_only is not None
    assert f"{fused.map_only.level.p95_m:.3f}" in said
    write_report([fused, fused], tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert "The map alone" in page and "all 2" in page
    assert page.count(f"{fused.map_only.level.p95_m:.3f} m") >= 3
