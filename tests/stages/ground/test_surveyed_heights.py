"""Surveyed heights: ground that slopes, what lies off its plane, and heights that cannot be."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_ground import frame
from drawn_solid import motion_between
from sloping_site import SlopingSite, places_m, sloping_site
from stages.ground.test_surveyed_ground import STILL, blank_frame, refusal, updated
from tolerances import GROUND_THROUGH_LENS_M, OFF_PLANE_M, RELIEF_COVERAGE

from standoff.core.camera import Camera, CameraPrior
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.map_error import map_jacobian
from standoff.core.pose import View
from standoff.core.telemetry import Telemetry
from standoff.core.types import Detections, GroundMap, NoGroundMap
from standoff.evaluation.drawn_markers import Hardship, draw_marker, through_camera
from standoff.stages.ground import (
    FusedGround,
    FusedParams,
    MarkerObserver,
    MarkerPlace,
    Reference,
    ReferenceShape,
    load_survey,
    map_from_view,
    marker_pattern,
)
from standoff.stages.ground.height_plane import fit_heights
from standoff.stages.ground.plane_frame import laid_marker, laid_reference, map_in_site
from standoff.stages.ground.surveyed_ground import SurveyedGround
from standoff.stages.locate import LocateParams
from standoff.stages.locate.uncertainty import relief_covariance
from standoff_sim.ground.relief import make_relief
from standoff_sim.ground.terrain_plan import TerrainPlan

SEEDS = [1, 2, 3]
SIZE_PX = (1280, 720)
READINGS = Telemetry(
    0.0, "drawn", height_m=20.0, height_sigma_m=0.5, heading_deg=10.0, heading_sigma_deg=2.0, pitch_deg=50.0,
    pitch_sigma_deg=0.5, roll_deg=0.0, roll_sigma_deg=0.5, latitude_deg=50.0, longitude_deg=8.0, position_sigma_m=1.0,
)  # fmt: skip


def surveyed(site: SlopingSite, xy_m: FloatArray, *, camera: Camera | None, heights: bool = True) -> SurveyedGround:
    heights_m = site.heights_m(xy_m) if heights else np.full(len(xy_m), np.nan)
    return SurveyedGround(site.seen_px(xy_m), xy_m, SIZE_PX, heights_m=heights_m, camera=camera)


def carried(survey: SurveyedGround, camera: Camera) -> GroundMap:
    """Return the map of a camera that may move, in the survey's picture."""
    ground = FusedGround(survey=survey, camera=CameraPrior.calibrated(camera), params=FusedParams(sizes=False))
    result = ground.update(blank_frame(*SIZE_PX), Detections.empty(), STILL)
    assert isinstance(result, GroundMap), result
    return result


def worst_m(ground: GroundMap, site: SlopingSite, xy_m: FloatArray) -> float:
    """Return how far places of the plane come out from where they are."""
    height_m = 102.0 + xy_m @ site.rise
    found_m, _ = ground.to_ground(site.view.project(np.column_stack([xy_m, height_m])))
    return float(np.linalg.norm(found_m - xy_m, axis=1).max())


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("slope_deg", [0.0, 6.0, 14.0])
def test_places_on_a_slope_are_horizontal_metres(seed: int, slope_deg: float) -> None:
    site = sloping_site(seed, slope_deg=slope_deg, k1=-0.1)
    survey = surveyed(site, places_m(seed, 6), camera=site.view.camera)
    assert survey.plane is not None and abs(survey.plane.slope_deg - slope_deg) < 1e-6
    others_m = places_m(seed + 50, 8, half_m=4.0)
    for ground in (updated(survey), carried(survey, site.view.camera)):
        assert worst_m(ground, site, others_m) < GROUND_THROUGH_LENS_M


@pytest.mark.parametrize("seed", SEEDS)
def test_a_camera_that_moves_needs_the_heights_of_a_slope(seed: int) -> None:
    site = sloping_site(seed, slope_deg=14.0)
    xy_m, camera = places_m(seed, 6), site.view.camera
    with_heights, without = (
        worst_m(carried(surveyed(site, xy_m, camera=camera, heights=told), camera), site, places_m(seed + 50, 8))
        for told in (True, False)
    )
    assert with_heights < 0.1 * without


@pytest.mark.parametrize("camera_is_known", [True, False])
@pytest.mark.parametrize("seed", SEEDS)
def test_points_off_the_plane_do_not_bend_the_map(seed: int, camera_is_known: bool) -> None:
    site = sloping_site(seed, slope_deg=7.0, waves_m=0.25)
    xy_m, others_m = places_m(seed, 9), places_m(seed + 50, 8, half_m=4.0)
    camera = site.view.camera if camera_is_known else None
    survey, plain = (surveyed(site, xy_m, camera=camera, heights=told) for told in (True, False))
    assert survey.plane is not None
    fitted = replace(site, rise=survey.plane.rise)
    lift_m = survey.plane.height_m - 102.0
    lifted = replace(fitted, view=replace(site.view, position_m=site.view.position_m - [0.0, 0.0, lift_m]))
    assert worst_m(updated(survey), lifted, others_m) < OFF_PLANE_M
    assert worst_m(carried(survey, site.view.camera), lifted, others_m) < OFF_PLANE_M
    assert worst_m(updated(survey), lifted, others_m) < 0.5 * worst_m(updated(plain), lifted, others_m)


def test_heights_from_another_level_say_the_same() -> None:
    site, xy_m = sloping_site(4, slope_deg=5.0, waves_m=0.1), places_m(4, 7)
    px, heights_m = site.seen_px(xy_m), site.heights_m(xy_m)
    one, other = (SurveyedGround(px, xy_m, SIZE_PX, heights_m=heights_m - level_m) for level_m in (0.0, 102.0))
    np.testing.assert_allclose(updated(one).image_to_ground, updated(other).image_to_ground, rtol=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_relief_is_least_where_it_was_surveyed_and_grows_away(seed: int) -> None:
    site, xy_m = sloping_site(seed, slope_deg=8.0, waves_m=0.2), places_m(seed, 10)
    plane = fit_heights(xy_m, site.heights_m(xy_m), [str(k) for k in range(len(xy_m))])
    outwards_m = np.array([[np.cos(seed), np.sin(seed)]]) * np.array([[5.0], [10.0], [20.0], [40.0]])
    sigma_m = plane.relief.sigma_at(outwards_m)
    assert plane.relief.sigma_m < sigma_m[0] and (np.diff(sigma_m) > 0).all()


def test_ground_of_any_terrain_is_as_near_to_the_plane_as_is_stated() -> None:
    off_in_sigmas = []
    for seed in range(12):
        rng = np.random.default_rng([seed, 73])
        plan = TerrainPlan(cell_m=1.0, relief_m=float(rng.uniform(0.03, 0.2)), roughness=float(rng.uniform(0.0, 0.8)))
        height_m = make_relief(rng, plan)
        middle = (np.array(height_m.shape) - 1) // 2
        surveyed_cells = middle + rng.integers(-12, 13, (8, 2))
        others = middle + rng.integers(-40, 41, (200, 2))
        others_m = others.astype(np.float64)
        rise = rng.uniform(-0.15, 0.15, 2)
        told_m, true_m = (height_m[cells[:, 0], cells[:, 1]] + cells @ rise for cells in (surveyed_cells, others))
        plane = fit_heights(surveyed_cells.astype(np.float64), told_m, "abcdefgh")
        off_m = true_m - plane.height_m - others_m @ plane.rise
        off_in_sigmas.append(off_m / plane.relief.sigma_at(others_m))
    assert float(np.mean(np.abs(np.concatenate(off_in_sigmas)) < 1.96)) > RELIEF_COVERAGE


@pytest.mark.parametrize("waves_m", [0.05, 0.3])
def test_rougher_ground_makes_places_less_sure(waves_m: float) -> None:
    site, xy_m = sloping_site(5, slope_deg=6.0, waves_m=waves_m), places_m(5, 10)
    rough = updated(surveyed(site, xy_m, camera=site.view.camera))
    told, usual = (_sigma_m(ground) for ground in (rough, replace(rough, relief=None)))
    assert (told > usual) == (waves_m > LocateParams().relief_sigma_m)


def _sigma_m(ground: GroundMap) -> float:
    """Return how unsure the relief alone makes a place in the middle of the picture."""
    covariance = relief_covariance(ground, np.array([[640.0, 400.0]]), LocateParams().relief_sigma_m)
    return float(np.sqrt(np.trace(covariance[0])))


@pytest.mark.parametrize("seed", SEEDS)
def test_one_wrong_height_is_named_and_left_out(seed: int) -> None:
    site, xy_m = sloping_site(seed, slope_deg=6.0, waves_m=0.05), places_m(seed, 8)
    heights_m = site.heights_m(xy_m)
    heights_m[seed] += 9.0
    survey = SurveyedGround(site.seen_px(xy_m), xy_m, SIZE_PX, heights_m=heights_m)
    assert survey.plane is not None
    assert survey.plane.doubtful == (f"point {seed + 1}",)
    assert np.linalg.norm(survey.plane.rise - site.rise) < 0.05
    assert any(f"'point {seed + 1}'" in warning for warning in survey.describe()["warnings"])


def test_heights_of_some_points_are_enough() -> None:
    site, xy_m = sloping_site(6, slope_deg=9.0), places_m(6, 7)
    heights_m = np.where(np.arange(7) % 2 == 0, site.heights_m(xy_m), np.nan)
    survey = SurveyedGround(site.seen_px(xy_m), xy_m, SIZE_PX, heights_m=heights_m)
    assert survey.plane is not None and abs(survey.plane.slope_deg - 9.0) < 1e-6
    assert worst_m(updated(survey), site, places_m(56, 8)) < GROUND_THROUGH_LENS_M


def test_heights_that_cannot_be_are_refused_in_one_line() -> None:
    site, xy_m = sloping_site(7, slope_deg=6.0), places_m(7, 6)
    px, heights_m = site.seen_px(xy_m), site.heights_m(xy_m) - 102.0
    two = np.where(np.arange(6) < 2, heights_m, np.nan)
    assert "three or more" in refusal(px, xy_m, SIZE_PX, heights_m=two)
    assert "less steep than 35 degrees" in refusal(px, xy_m, SIZE_PX, heights_m=100.0 * heights_m)
    random_m = np.random.default_rng(7).uniform(-6.0, 6.0, 6)
    assert "z_m" in refusal(px, xy_m, SIZE_PX, heights_m=random_m)
    assert "one height" in refusal(px, xy_m, SIZE_PX, heights_m=heights_m[:4])
    on_line_m = np.column_stack([np.arange(3.0), 2.0 * np.arange(3.0)])
    with pytest.raises(GroundError, match="not on one line"):
        fit_heights(on_line_m, np.zeros(3), ["a", "b", "c"])


def test_a_file_tells_heights(tmp_path: Path) -> None:
    site, xy_m = sloping_site(8, slope_deg=10.0), places_m(8, 5)
    rows = [
        f"  - {{px: [{px[0]}, {px[1]}], m: [{m[0]}, {m[1]}], z_m: {z}}}"
        for px, m, z in zip(site.seen_px(xy_m).tolist(), xy_m.tolist(), site.heights_m(xy_m).tolist(), strict=True)
    ]
    path = tmp_path / "survey.yaml"
    path.write_text("image_size_px: [1280, 720]\npoints:\n" + "\n".join(rows), encoding="utf-8")
    survey = load_survey(path)
    assert survey.plane is not None and abs(survey.plane.slope_deg - 10.0) < 1e-6
    assert "slopes by 10.0 degrees" in survey.describe()["basis"]
    path.write_text(path.read_text(encoding="utf-8").replace("z_m: 1", "z_m: high1", 1), encoding="utf-8")
    with pytest.raises(GroundError, match="z_m of 'point 1'"):
        load_survey(path)


@pytest.mark.parametrize("seed", SEEDS)
def test_what_lies_on_a_slope_keeps_its_size_and_its_place(seed: int) -> None:
    site, xy_m = sloping_site(seed, slope_deg=12.0), places_m(seed, 6)
    plane = fit_heights(xy_m, site.heights_m(xy_m), "abcdef")
    marker = laid_marker(MarkerPlace.lying(3, 1.2, xy_m=(4.0, -3.0), heading_deg=30.0, height_m=0.2), plane)
    shape = ReferenceShape.from_corners([[9.0, 0.0], [11.0, 0.0], [11.0, 2.0], [9.0, 2.0]])
    reference = laid_reference(Reference(shape, 0.4), plane)
    assert abs(marker.size_m - 1.2) < 1e-9
    corners_m = reference.shape.corners_m
    np.testing.assert_allclose(np.linalg.norm(np.roll(corners_m, -1, axis=0) - corners_m, axis=1), 2.0)
    back_m = np.column_stack([corners_m, np.zeros(4)]) @ plane.plane_to_site.T
    np.testing.assert_allclose(back_m.mean(axis=0)[:2], [10.0, 1.0], atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_error_of_a_place_is_that_on_the_plane_seen_from_above(seed: int) -> None:
    site, xy_m = sloping_site(seed, slope_deg=13.0), places_m(seed, 6)
    plane = fit_heights(xy_m, site.heights_m(xy_m), "abcdef")
    spread = np.random.default_rng([seed, 74]).normal(size=(8, 8)) * 1e-3
    # In the plane's frame the camera is somewhere else; any view of z = 0 will do.
    on_plane = map_from_view(
        site.view.changed(np.array([0.0, 0.0, 0.0, 0.0, 0.0, -102.0, 0.0, 0.0])),
        spread @ spread.T, method="drawn", scale_m_per_px=0.02, anchors_px=np.zeros((0, 2)),
    )  # fmt: skip
    in_site, point_px = map_in_site(on_plane, plane), np.array([[500.0, 420.0]])
    turned = plane.plane_to_site[:2, :2]
    covariances = []
    for ground in (on_plane, in_site):
        by_map = map_jacobian(ground, ground.undistorted(point_px))[0]
        covariances.append(by_map @ ground.covariance @ by_map.T)
    np.testing.assert_allclose(covariances[1], turned @ covariances[0] @ turned.T, rtol=1e-9)
    np.testing.assert_allclose(in_site.to_ground(point_px)[0], on_plane.to_ground(point_px)[0] @ turned.T, rtol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_marker_that_lies_on_the_slope_agrees_with_the_survey(seed: int) -> None:
    site, xy_m, camera = (
        sloping_site(seed, slope_deg=10.0),
        places_m(seed, 6),
        sloping_site(seed, slope_deg=0.0).view.camera,
    )
    stated = MarkerPlace.lying(7, 1.6, xy_m=(-0.5, 0.5), heading_deg=20.0 * seed)
    light = np.full((SIZE_PX[1], SIZE_PX[0]), 0.3)
    draw_marker(light, marker_pattern("apriltag36h11", 7), site.view.project(_lying_m(stated, site)))
    picture = through_camera(light, Hardship("clean", noise=1.0), np.random.default_rng(seed))
    ground = FusedGround(
        markers=MarkerObserver([stated]), survey=surveyed(site, xy_m, camera=camera),
        camera=CameraPrior.calibrated(camera), params=FusedParams(sizes=False),
    )  # fmt: skip
    result = ground.update(frame(picture), Detections.empty(), STILL)
    assert isinstance(result, GroundMap) and not ground.describe()["warnings"]
    assert worst_m(result, site, places_m(seed + 50, 8, half_m=4.0)) < 0.05
    alone = carried(surveyed(site, xy_m, camera=camera), camera)
    assert np.trace(_middle_covariance(result)) < np.trace(_middle_covariance(alone))


def _lying_m(place: MarkerPlace, site: SlopingSite) -> FloatArray:
    """Return (4, 3) the corners of a marker on the slope, its first one and its first side where they are stated."""
    first_m, side_m = place.corners_m[0, :2], place.corners_m[1, :2] - place.corners_m[0, :2]
    along = np.append(side_m, side_m @ site.rise)
    along /= np.linalg.norm(along)
    across = np.cross([-site.rise[0], -site.rise[1], 1.0] / np.sqrt(1.0 + site.rise @ site.rise), along)
    start_m = np.append(first_m, 102.0 + first_m @ site.rise)
    steps = place.size_m * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    corners_m: FloatArray = start_m + steps[:, :1] * along + steps[:, 1:] * across
    return corners_m


def _middle_covariance(ground: GroundMap) -> FloatArray:
    by_map = map_jacobian(ground, ground.undistorted(np.array([[640.0, 400.0]])))[0]
    return np.asarray(by_map @ ground.covariance @ by_map.T)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_motion_of_the_picture_carries_the_map_over_a_slope(seed: int) -> None:
    site, xy_m = sloping_site(seed, slope_deg=12.0), places_m(seed, 6)
    survey = surveyed(site, xy_m, camera=site.view.camera)
    assert survey.plane is not None
    to_plane = survey.plane.plane_to_site.T
    ground = FusedGround(survey=survey, camera=CameraPrior.calibrated(site.view.camera))
    views, times_s = [site.view], np.arange(5) / 5.0
    for k, time_s in enumerate(times_s.tolist()):
        views.append(views[0].changed(np.array([0.01, 0.03, -0.02, 0.8, -0.3, 0.4, 0.0, 0.0]) * k))
        above = [_on_plane(one, to_plane) for one in views]
        motion = STILL if k == 0 else motion_between(above[0], above[-1], 0.0)
        shown = replace(blank_frame(*SIZE_PX, index=k), time_s=time_s)
        result = ground.update(shown, Detections.empty(), motion)
        assert isinstance(result, GroundMap), result
        assert worst_m(result, replace(site, view=views[-1]), places_m(seed + 50, 8, half_m=4.0)) < 0.02


def _on_plane(view: View, to_plane: FloatArray) -> View:
    """Return a view in the frame of a plane that is turned and 102 m up."""
    return View(view.camera, to_plane @ (view.position_m - [0.0, 0.0, 102.0]), view.site_to_camera @ to_plane.T)


def test_what_knows_level_ground_only_is_not_asked_on_a_slope() -> None:
    told = {}
    for slope_deg in (0.0, 10.0):
        site, xy_m = sloping_site(9, slope_deg=slope_deg), places_m(9, 6)
        camera = site.view.camera
        survey = SurveyedGround(
            site.seen_px(xy_m), xy_m, SIZE_PX, heights_m=site.heights_m(xy_m), camera=camera, time_s=10.0
        )
        ground = FusedGround(survey=survey, camera=CameraPrior.calibrated(camera))
        readings = replace(blank_frame(*SIZE_PX), telemetry=READINGS)
        told[slope_deg] = ground.update(readings, Detections.empty(), STILL)
    assert isinstance(told[0.0], GroundMap) and isinstance(told[10.0], NoGroundMap)
