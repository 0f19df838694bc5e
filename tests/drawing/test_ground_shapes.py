from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from stages.sinks.fake_site import FakeSite
from tolerances import DISTORTION_PX, GEOMETRY_REL

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.types import GroundMap
from standoff.drawing.ground_shapes import circle_outlines_px, clip_in_front

LENS = Camera(1280, 720, np.array([[900.0, 0, 640], [0, 900, 360], [0, 0, 1]]), np.array([-0.28, 0.08, 0, 0, 0]))
GROUNDS = (FakeSite((1280, 720)).ground(), FakeSite((1280, 720), camera=LENS).ground())


def _map_of_camera(height_m: float, pitch_deg: float, camera: Camera | None = None) -> GroundMap:
    """A camera over the origin that looks along y, `pitch_deg` below the horizon."""
    pitch = np.radians(pitch_deg)
    rotation = np.array([[1, 0, 0], [0, -np.sin(pitch), -np.cos(pitch)], [0, np.cos(pitch), -np.sin(pitch)]])
    projection = LENS.matrix @ np.column_stack([rotation, -rotation @ [0, 0, height_m]])
    return GroundMap(
        homography.invert(projection[:, [0, 1, 3]]), np.zeros((9, 9)), (1280, 720), "made up", 0.01, camera=camera
    )


@pytest.mark.parametrize("camera", [None, LENS])
@examples(40)
@given(x=st.floats(-15, 15), y=st.floats(-5, 25), radius=st.floats(0.5, 6))
def test_the_drawn_ellipse_is_the_circle_on_the_ground(
    camera: Camera | None, x: float, y: float, radius: float
) -> None:
    ground, centre = GROUNDS[camera is not None], np.array([[x, y]])
    (runs,) = circle_outlines_px(ground, centre, np.array([radius]))
    for run in runs:
        back, valid = ground.to_ground(run)
        assert valid.all()
        np.testing.assert_allclose(np.linalg.norm(back - centre, axis=1), radius, rtol=1e3 * GEOMETRY_REL)
    if camera is None:
        assert len(runs) == 1
        np.testing.assert_array_equal(runs[0][0], runs[0][-1])


def test_an_ellipse_agrees_with_opencvs_fit() -> None:
    ground = FakeSite((1280, 720)).ground()
    ((run,),) = circle_outlines_px(ground, np.array([[3.0, 5.0]]), np.array([4.0]))
    centre, axes, angle = cv2.fitEllipse(run[:-1].astype(np.float32))
    turn = np.array([[np.cos(np.radians(angle)), np.sin(np.radians(angle))]])
    along = (run - centre) @ np.vstack([turn, turn[:, ::-1] * [-1, 1]]).T
    np.testing.assert_allclose((2.0 * along / axes) ** 2 @ [1, 1], 1.0, atol=1e-3)


def test_a_circle_around_the_camera_leaves_through_the_bottom_of_the_picture() -> None:
    ground = _map_of_camera(10.0, 20.0)
    ((run,),) = circle_outlines_px(ground, np.array([[0.0, 30.0]]), np.array([40.0]))
    back, valid = ground.to_ground(run)
    on_circle = np.abs(np.linalg.norm(back - [0.0, 30.0], axis=1) - 40.0) < 0.15  # the cut lies on a chord
    assert valid.all()
    inside = (run >= 0).all(axis=1) & (run <= [1279, 719]).all(axis=1)
    assert inside.any()
    assert on_circle[inside].all()
    assert run[:, 1].max() > 3 * 720


def test_what_lies_behind_the_camera_or_has_no_position_is_not_drawn() -> None:
    ground = _map_of_camera(10.0, 20.0)
    places = np.array([[0.0, -30.0], [np.nan, np.nan], [0.0, 30.0]])
    behind, unknown, seen = circle_outlines_px(ground, places, np.array([3.0, 3.0, 3.0]))
    assert behind == []
    assert unknown == []
    assert len(seen) == 1


def test_a_folding_lens_brings_nothing_back_into_the_picture() -> None:
    folding = replace(LENS, distortion=np.array([-0.2, 0.0, 0, 0, 0]))
    ground = _map_of_camera(10.0, 60.0, folding)
    far_outside = homography.apply(ground.image_to_ground, np.array([[640 + 900 * 2.2, 400.0]]))[0]
    ray = np.array([[2.2, (400.0 - 360) / 900, 1.0]])
    folded = cv2.projectPoints(ray, np.zeros(3), np.zeros(3), folding.matrix, folding.distortion)[0].ravel()
    assert ((folded > 0) & (folded < [1280, 720])).all()  # the trap: the lens polynomial alone puts it in the picture
    (runs,) = circle_outlines_px(ground, far_outside, np.array([0.5]))
    assert runs == []


@pytest.mark.parametrize("seed", range(5))
def test_runs_stay_on_the_circle_with_a_lens(seed: int) -> None:
    rng, ground = np.random.default_rng(seed), _map_of_camera(10.0, 45.0, LENS)
    centres, radii = np.column_stack([rng.uniform(-15, 15, 30), rng.uniform(2, 30, 30)]), rng.uniform(1, 12, 30)
    for centre, radius, runs in zip(centres, radii, circle_outlines_px(ground, centres, radii), strict=True):
        for run in runs:
            again = LENS.distort(LENS.undistort(run))
            np.testing.assert_allclose(again, run, atol=DISTORTION_PX)
            in_picture = (run >= 0).all(axis=1) & (run <= [1279, 719]).all(axis=1)
            back, _ = ground.to_ground(run[in_picture])
            np.testing.assert_allclose(np.linalg.norm(back - centre, axis=1), radius, rtol=1e-6)


@given(st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=3, max_size=12))
def test_a_clipped_polygon_is_in_front(points: list[tuple[float, float]]) -> None:
    matrix: FloatArray = np.array([[1.0, 0, 0], [0, 1.0, 0], [0.3, -0.2, 1.0]])
    polygon = np.array(points)
    clipped = clip_in_front(matrix, polygon, 0.5)
    depth = polygon @ matrix[2, :2] + matrix[2, 2]
    assert (clipped @ matrix[2, :2] + matrix[2, 2] >= 0.5 - 1e-9).all()
    assert len(clipped) >= (depth >= 0.5).sum()
    assert bool(len(clipped)) == bool((depth >= 0.5).any())
