"""What the tables say against what the pictures show: small, and the presets that are like others in test-live."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import pytest
from flat_ground import FlatGround
from laws import seeds
from tolerances import (
    BOARD_IN_PICTURE_PX,
    DISTORTION_PX,
    FOOTING_IN_PICTURE_PX,
    GEOMETRY_REL,
    SCENE_DISTANCE_M,
    VISIBLE_BOX_PX,
)

from standoff.core.homography import FloatArray
from standoff_sim.camera.flight import Still, drone_camera
from standoff_sim.clip.presets import PRESETS, plan_clip
from standoff_sim.clip.studio import RenderedFrame, Studio
from standoff_sim.movement.motion import sample
from standoff_sim.render import Look, Renderer
from standoff_sim.scene.light import random_light
from standoff_sim.scene.reference import make_reference
from standoff_sim.scene.site import Site, build_site

pytestmark = pytest.mark.usefixtures("opengl")

_WIDTH_PX, _HEIGHT_PX = 960, 540
_SIDES = ("x1", "y1", "x2", "y2")
_DRAWN = ("busy",)
"""The most people and machines."""

for_every_preset = pytest.mark.parametrize(
    "name", [name if name in _DRAWN else pytest.param(name, marks=pytest.mark.live) for name in PRESETS]
)


@lru_cache(maxsize=len(PRESETS))
def _clean_shot(name: str) -> tuple[Site, RenderedFrame]:
    plan = plan_clip(name, seed=5, width_px=_WIDTH_PX, height_px=_HEIGHT_PX)
    site = build_site(plan)
    with Studio(site) as studio:
        return site, studio.shoot(0, 0.1 * plan.duration_s, clean=True)


def _view_of(shot: RenderedFrame) -> tuple[FloatArray, FloatArray]:
    """Return OpenCV's rotation vector and translation of the camera."""
    site_to_camera = np.array(shot.frame["site_to_camera"]).reshape(3, 3)
    position_m = np.array([shot.frame[f"camera_{axis}_m"] for axis in "xyz"])
    return cv2.Rodrigues(site_to_camera)[0], -site_to_camera @ position_m


@for_every_preset
def test_projected_boxes_of_what_nothing_hides_are_those_of_the_id_picture(name: str) -> None:
    _, shot = _clean_shot(name)
    checked = 0
    for row in shot.entities:
        full = np.array([row[f"full_{side}_px"] for side in _SIDES])
        inside = (full[:2] > 0).all() and full[2] < _WIDTH_PX - 1 and full[3] < _HEIGHT_PX - 1
        if row["visible_share"] > 0.999 and inside:  # a weed may stand before the edge of a board of 25 m
            visible = np.array([row[f"{side}_px"] for side in _SIDES])
            np.testing.assert_allclose(visible, full, atol=VISIBLE_BOX_PX, err_msg=str(row))
            checked += 1
    assert checked > 0


@for_every_preset
def test_feet_and_corners_are_where_opencv_projects_them(name: str) -> None:
    site, shot = _clean_shot(name)
    feet_m = np.array([[row[f"{axis}_m"] for axis in "xyz"] for row in shot.entities])
    feet_px = np.array([[row["foot_x_px"], row["foot_y_px"]] for row in shot.entities])
    matrix, distortion = site.camera.matrix, site.camera.distortion
    expected_px, _ = cv2.projectPoints(feet_m, *_view_of(shot), matrix, distortion)
    seen = np.isfinite(feet_px).all(axis=1)
    assert seen.any()
    np.testing.assert_allclose(feet_px[seen], expected_px[seen, 0], atol=DISTORTION_PX)
    assert site.scene.reference is not None
    for end in ("top", "base"):
        corners_m = getattr(site.scene.reference, f"{end}_m")
        corners_px = np.column_stack([shot.frame[f"reference_{end}_{axis}_px"] for axis in "xy"])
        expected_px, _ = cv2.projectPoints(corners_m, *_view_of(shot), matrix, distortion)
        np.testing.assert_allclose(corners_px, expected_px[:, 0], atol=DISTORTION_PX)


@for_every_preset
def test_distances_are_those_of_the_actors_own_coordinates(name: str) -> None:
    site, shot = _clean_shot(name)
    time_s = shot.frame["time_s"]
    places = {actor.entity_id: sample(actor.motion, time_s).xy_m for actor in site.scene.actors}
    assert len(shot.pairs) == len(places) * (len(places) - 1) // 2
    for row in shot.pairs:
        expected_m = float(np.linalg.norm(places[row["entity_a"]] - places[row["entity_b"]]))
        assert row["centre_m"] == pytest.approx(expected_m, abs=SCENE_DISTANCE_M)
        assert row["footprint_m"] < row["centre_m"]


@for_every_preset
def test_feet_stand_on_the_ground_that_is_drawn(name: str) -> None:
    site, shot = _clean_shot(name)
    for row in shot.entities:
        if row["class_name"] == "worker":
            height_m = site.scene.ground.height_at(np.array([[row["x_m"], row["y_m"]]]))[0]
            assert row["z_m"] == pytest.approx(float(height_m), rel=GEOMETRY_REL)


def _edge_points(grey: FloatArray, start_px: FloatArray, stop_px: FloatArray) -> FloatArray:
    """Return (N, 2) points where brightness changes most across an edge, between its ends."""
    share = np.linspace(0.12, 0.88, 120)[:, None]
    along = stop_px - start_px
    normal = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    reach = np.arange(-3.0, 3.01, 0.05)
    middles = start_px + share * along
    places = np.float32(middles[:, None] + reach[None, :, None] * normal)
    profiles = cv2.remap(np.float32(grey), places, None, cv2.INTER_CUBIC)
    slopes = np.abs(np.gradient(profiles, axis=1)) ** 2
    offsets = (slopes * reach).sum(axis=1) / slopes.sum(axis=1)
    return np.asarray(middles + offsets[:, None] * normal)


def _line(points: FloatArray) -> FloatArray:
    """Return a, b, c of a x + b y + c = 0 through points, against outliers."""
    vx, vy, x, y = cv2.fitLine(np.float32(points), cv2.DIST_HUBER, 0, 1e-4, 1e-4).ravel().tolist()
    return np.array([-vy, vx, vy * x - vx * y])


@pytest.mark.parametrize("seed", seeds(4))
def test_the_corners_of_a_reference_object_are_where_lines_fitted_to_its_edges_cross(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ground = FlatGround(level=25)
    reference = make_reference(rng, "painted_square", (1.0, -1.0), float(rng.uniform(0.0, 90.0)), ground, 1, worn=False)
    camera = drone_camera(_WIDTH_PX, _HEIGHT_PX, 40.0, rng)
    view = Still.over(camera, np.zeros(2), altitude_m=18.0, pitch_deg=60.0, heading_deg=float(rng.uniform(0, 360)))
    with Renderer((_WIDTH_PX, _HEIGHT_PX)) as renderer:
        renderer.load(ground, ())
        light = random_light(rng, "noon")
        seen = view.fixed
        image = renderer.render(seen, reference.batches + reference.roots, light, Look(exposure=0.35)).image
    coded = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) / 255.0
    # a pixel that two surfaces share mixes their light, not the numbers that encode it
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    corners_px = seen.project(reference.top_m)
    edges = [_edge_points(linear, corners_px[k], corners_px[(k + 1) % 4]) for k in range(4)]
    lines = [_line(camera.undistort(points)) for points in edges]
    crossings = np.array([np.cross(lines[k - 1], lines[k]) for k in range(4)])
    fitted_px = camera.distort(crossings[:, :2] / crossings[:, 2:])
    off_px = np.linalg.norm(fitted_px - corners_px, axis=1)
    assert np.sqrt((off_px**2).mean()) < FOOTING_IN_PICTURE_PX, off_px


def test_the_corners_of_the_board_are_where_a_subpixel_fit_finds_them() -> None:
    _, shot = _clean_shot("board")
    grey = cv2.cvtColor(shot.image, cv2.COLOR_BGR2GRAY)
    corners_px = np.column_stack([shot.frame["board_x_px"], shot.frame["board_y_px"]])
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    fitted_px = cv2.cornerSubPix(grey, np.float32(corners_px[:, None]), (5, 5), (-1, -1), stop)[:, 0]
    off_px = np.linalg.norm(fitted_px - corners_px, axis=1)
    assert np.median(off_px) < BOARD_IN_PICTURE_PX
