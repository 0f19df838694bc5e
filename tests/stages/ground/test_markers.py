from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import MARKER_CORNER_PX

from standoff.core.camera import Camera
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import ImageArray
from standoff.evaluation.drawn_markers import Hardship, draw_marker, through_camera
from standoff.stages.ground import (
    MARKER_FAMILIES,
    MarkerFamily,
    MarkerObserver,
    MarkerPlace,
    PointObservation,
    find_markers,
    marker_pattern,
)

CAMERA = Camera(640, 480, np.array([[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]]), np.zeros(5))
GROUND_LIGHT = 0.2


def pictured(corners_px: FloatArray, family: MarkerFamily = "apriltag36h11", marker_id: int = 7) -> ImageArray:
    light = np.full((480, 640), GROUND_LIGHT)
    draw_marker(light, marker_pattern(family, marker_id), corners_px)
    return through_camera(light, Hardship("clean", noise=1.0), np.random.default_rng(3))


def looking(heading_deg: float, pitch_deg: float, distance_m: float, middle_m: FloatArray) -> View:
    heading, pitch = np.deg2rad([heading_deg, pitch_deg])
    ahead = np.array([np.cos(pitch) * np.sin(heading), np.cos(pitch) * np.cos(heading), -np.sin(pitch)])
    return View.aimed(CAMERA, middle_m - distance_m * ahead, heading_deg=heading_deg, pitch_deg=pitch_deg)


@settings(max_examples=8, deadline=None)
@given(
    heading_deg=st.floats(-180.0, 180.0),
    pitch_deg=st.floats(40.0, 90.0),
    side_px=st.floats(24.0, 110.0),
    marker_id=st.integers(0, 586),
)
def test_a_drawn_marker_is_found_with_its_id_its_corners_in_order_and_to_a_fraction_of_a_pixel(
    heading_deg: float, pitch_deg: float, side_px: float, marker_id: int
) -> None:
    place = MarkerPlace.lying(marker_id, 1.2, xy_m=(3.0, -2.0), heading_deg=20.0)
    view = looking(heading_deg, pitch_deg, 600.0 * 1.2 / side_px, place.corners_m.mean(axis=0))
    truth_px = view.project(place.corners_m)
    found = find_markers(pictured(truth_px, marker_id=marker_id), "apriltag36h11")
    assert found.ids.tolist() == [marker_id]
    assert np.abs(found.corners_px[0] - truth_px).max() < MARKER_CORNER_PX
    assert (found.sigma_px > 0).all()


@pytest.mark.parametrize("family", MARKER_FAMILIES)
def test_every_family_is_read(family: MarkerFamily) -> None:
    truth_px = np.array([[200.0, 300.0], [250.0, 310.0], [260.0, 262.0], [208.0, 255.0]])
    found = find_markers(pictured(truth_px, family, 11), family)
    assert found.ids.tolist() == [11]
    assert np.abs(found.corners_px[0] - truth_px).max() < MARKER_CORNER_PX


def test_the_apriltag_pattern_is_upright_as_its_makers_publish_it() -> None:
    # tag36h11's first code word, 36 bits row by row from the upper left
    bits = np.array([int(bit) for bit in f"{0xD5D628584:036b}"]).reshape(6, 6)
    assert np.array_equal(marker_pattern("apriltag36h11", 0)[1:-1, 1:-1], bits.astype(bool))


def test_bare_ground_and_a_dark_square_on_white_are_no_markers() -> None:
    rng = np.random.default_rng(0)
    picture = rng.integers(60, 160, (480, 640)).astype(np.uint8)
    picture[100:180, 100:180] = 240
    picture[115:165, 115:165] = 10
    for family in MARKER_FAMILIES:
        assert len(find_markers(picture, family)) == 0


def test_only_wanted_markers_are_reported() -> None:
    truth_px = np.array([[200.0, 300.0], [250.0, 310.0], [260.0, 262.0], [208.0, 255.0]])
    assert len(find_markers(pictured(truth_px), "apriltag36h11", wanted={8})) == 0


@pytest.mark.parametrize("marker_id", [-1, 587])
def test_an_id_outside_the_family_is_refused(marker_id: int) -> None:
    with pytest.raises(GroundError, match="0 to 586"):
        MarkerObserver([MarkerPlace.lying(marker_id, 1.0)])


def test_two_places_for_one_marker_are_refused() -> None:
    with pytest.raises(GroundError, match="twice"):
        MarkerObserver([MarkerPlace.lying(1, 1.0), MarkerPlace.lying(1, 1.0, xy_m=(5.0, 0.0))])


@pytest.mark.parametrize(
    "corners_m",
    [
        [[0, 0, 0], [1, 0, 0], [1, 1, 0]],
        [[0, 0, 0], [1, 0, 0], [1, 1.2, 0], [0, 1.2, 0]],
        [[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]],
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, np.nan, 0]],
    ],
)
def test_corners_that_are_no_square_seen_from_above_are_refused(corners_m: list[list[float]]) -> None:
    with pytest.raises(GroundError, match="0 to 3"):
        MarkerPlace(0, np.array(corners_m))


def test_an_observation_names_the_marker_and_pairs_its_corners() -> None:
    place = MarkerPlace.lying(7, 1.2, height_m=0.4)
    view = looking(30.0, 60.0, 15.0, place.corners_m.mean(axis=0))
    (seen,) = MarkerObserver([place]).observe(pictured(view.project(place.corners_m)))
    assert seen.name == "marker 7"
    assert np.array_equal(seen.points_m, place.corners_m)
    assert np.abs(view.project(seen.points_m) - seen.points_px).max() < MARKER_CORNER_PX


def test_a_lost_marker_is_searched_for_once_a_second_and_a_guess_finds_it_at_once() -> None:
    place = MarkerPlace.lying(7, 1.2)
    view = looking(30.0, 60.0, 15.0, place.corners_m.mean(axis=0))
    picture, empty = pictured(view.project(place.corners_m)), np.full((480, 640), 110, np.uint8)
    observer = MarkerObserver([place])
    assert observer.observe(empty, time_s=0.0) == []
    assert observer.observe(picture, time_s=0.5) == []
    assert len(observer.observe(picture, view, time_s=0.6)) == 1
    assert len(observer.observe(picture, time_s=0.7)) == 1
    observer.reset()
    assert observer.observe(empty, time_s=1.0) == []
    assert len(observer.observe(picture, time_s=2.0)) == 1


def test_a_marker_that_moves_in_the_picture_is_followed() -> None:
    place = MarkerPlace.lying(7, 1.2)
    corners_px = np.array([[200.0, 300.0], [250.0, 310.0], [260.0, 262.0], [208.0, 255.0]])
    observer = MarkerObserver([place])
    for step in range(4):
        moved_px = corners_px + step * np.array([15.0, -6.0])
        (seen,) = observer.observe(pictured(moved_px), time_s=step * 0.04)
        assert np.abs(seen.points_px - moved_px).max() < MARKER_CORNER_PX


def test_an_observation_without_a_positive_error_is_refused() -> None:
    with pytest.raises(ValueError, match="positive"):
        PointObservation("x", np.zeros((1, 3)), np.zeros((1, 2)), np.zeros(1))
    with pytest.raises(ValueError, match="shape"):
        PointObservation("x", np.zeros((1, 3)), np.zeros((2, 2)), np.ones(1))
