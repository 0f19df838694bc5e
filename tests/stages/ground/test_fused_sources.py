from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drawn_ground import GrayPicture
from hypothesis import given, settings
from hypothesis import strategies as st
from walking_crowd import drone_camera, random_crowd

from standoff.core.camera import Camera, CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.telemetry import Telemetry
from standoff.core.types import CameraMotion, Detections, Frame, GroundMap, ImageArray, NoCameraMotion, NoGroundMap
from standoff.evaluation.drawn_markers import Hardship, draw_marker, through_camera
from standoff.stages.ground import FusedGround, FusedParams, MarkerObserver, MarkerPlace, marker_pattern
from standoff.stages.ground.marker_fit import agrees
from standoff.stages.ground.marker_observer import NO_MARKER
from standoff.stages.ground.sizes_view import CONTRADICTION, FEW_PEOPLE

CAMERA = Camera(640, 480, np.array([[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]]), np.zeros(5))
PLACE = MarkerPlace.lying(7, 1.2)
NOTHING = Detections.empty()
STILL = NoCameraMotion("not told")


def looking(heading_deg: float = 30.0, pitch_deg: float = 55.0, distance_m: float = 9.0) -> View:
    heading, pitch = np.deg2rad([heading_deg, pitch_deg])
    ahead = np.array([np.cos(pitch) * np.sin(heading), np.cos(pitch) * np.cos(heading), -np.sin(pitch)])
    middle_m = PLACE.corners_m.mean(axis=0)
    return View.aimed(CAMERA, middle_m - distance_m * ahead, heading_deg=heading_deg, pitch_deg=pitch_deg)


def pictured(view: View, places: tuple[MarkerPlace, ...] = (PLACE,), seed: int = 3) -> ImageArray:
    light = np.full((480, 640), 0.2)
    for place in places:
        draw_marker(light, marker_pattern("apriltag36h11", place.marker_id), view.project(place.corners_m))
    return through_camera(light, Hardship("clean", noise=1.0), np.random.default_rng(seed))


BARE = pictured(looking(), ())


def frame(gray: ImageArray, time_s: float = 0.0, telemetry: Telemetry | None = None) -> Frame:
    return Frame("drawn", round(time_s * 30), time_s, GrayPicture(gray), telemetry=telemetry)


def unmoved(keyframe_s: float = 0.0) -> CameraMotion:
    return CameraMotion(np.eye(3), 1e-12 * np.eye(9), keyframe_s)


def by_marker(*places: MarkerPlace, camera: CameraPrior | None = None) -> FusedGround:
    prior = CameraPrior.calibrated(CAMERA) if camera is None else camera
    return FusedGround((), MarkerObserver(places or (PLACE,)), camera=prior)


def mapped(result: GroundMap | NoGroundMap) -> GroundMap:
    assert isinstance(result, GroundMap), result
    return result


def reason(result: GroundMap | NoGroundMap) -> str:
    assert isinstance(result, NoGroundMap)
    return result.reason


def error_in_sigmas(ground: GroundMap, view: View) -> FloatArray:
    """Return how many standard errors lengths of ground are off, of pairs of pixels within 10 m of the middle."""
    pixels = np.random.default_rng(0).uniform([100.0, 200.0], [540.0, 460.0], (40, 2))
    true_m, (found_m, _) = view.to_plane(pixels), ground.to_ground(pixels)
    apart_m = np.linalg.norm(true_m[::2] - true_m[1::2], axis=1)
    off = np.log(np.linalg.norm(found_m[::2] - found_m[1::2], axis=1) / apart_m)
    steps = np.linalg.cholesky(ground.covariance[:9, :9] + 1e-18 * np.eye(9)).T * 1e-3
    variance = np.zeros(len(off))
    for step in steps:
        other_m, _ = replace(ground, image_to_ground=ground.image_to_ground + step.reshape(3, 3)).to_ground(pixels)
        longer = np.linalg.norm(other_m[::2] - other_m[1::2], axis=1) / np.linalg.norm(
            found_m[::2] - found_m[1::2], axis=1
        )
        variance += (np.log(longer) / 1e-3) ** 2
    in_sigmas: FloatArray = np.abs(off) / np.sqrt(variance)
    return in_sigmas


def telemetry_of(view: View, rng: np.random.Generator | None = None, /, **changes: float) -> Telemetry:
    """Return what a drone with these errors says of a view."""
    axes = view.site_to_camera
    pitch, heading = np.rad2deg(np.arcsin(-axes[2, 2])), np.rad2deg(np.arctan2(-axes[0, 1], axes[0, 0]))
    sigma = {"height_m": 0.8, "pitch_deg": 0.5, "roll_deg": 0.5, "heading_deg": 4.0}
    values = {"height_m": float(view.position_m[2]), "pitch_deg": pitch, "roll_deg": 0.0, "heading_deg": heading}
    if rng is not None:
        values = {name: float(value + sigma[name] * rng.normal()) for name, value in values.items()}
    named = {name.rsplit("_", 1)[0] + "_sigma_" + name.rsplit("_", 1)[1]: one for name, one in sigma.items()}
    place = {"latitude_deg": 45.0, "longitude_deg": 9.0, "position_sigma_m": 1.5}
    return Telemetry(0.0, "drawn", **{**values, **named, **place, **changes})


@settings(max_examples=4, deadline=None)
@given(st.floats(-180.0, 180.0), st.floats(35.0, 80.0), st.floats(5.0, 12.0))
def test_a_marker_gives_metres_within_its_stated_errors(
    heading_deg: float, pitch_deg: float, distance_m: float
) -> None:
    view = looking(heading_deg, pitch_deg, distance_m)
    result = mapped(by_marker().update(frame(pictured(view)), NOTHING, STILL))
    assert result.method == "markers"
    assert result.frame_stated
    assert error_in_sigmas(result, view).max() < 4.0
    corners_m, _ = result.to_ground(view.project(PLACE.corners_m))
    assert np.abs(corners_m - PLACE.corners_m[:, :2]).max() < 0.05


def test_telemetry_alone_gives_metres_within_its_stated_errors() -> None:
    off = []
    for seed in range(30):
        view = looking(20.0, 40.0 + seed % 30, 25.0)
        said = telemetry_of(view, np.random.default_rng(seed))
        result = mapped(
            FusedGround(camera=CameraPrior.calibrated(CAMERA)).update(frame(BARE, 0.0, said), NOTHING, STILL)
        )
        off.append(np.median(error_in_sigmas(result, view)))
        assert not result.frame_stated
    assert np.mean(np.array(off) < 2.0) > 0.9


def test_more_telemetry_does_not_make_lengths_surer() -> None:
    ground, said = FusedGround(camera=CameraPrior.calibrated(CAMERA)), telemetry_of(looking())
    sigmas = [length_after(ground, time_s, said) for time_s in np.arange(0.0, 5.0, 0.5)]
    assert (np.diff(sigmas) >= -1e-9).all()


def length_after(ground: FusedGround, time_s: float, said: Telemetry | None, gray: ImageArray = BARE) -> float:
    """Return the relative standard error of lengths after one frame more of a camera that stands still."""
    result = mapped(ground.update(frame(gray, time_s, said), NOTHING, unmoved()))
    pixels = np.array([[300.0, 300.0], [340.0, 300.0]])
    steps = np.linalg.cholesky(result.covariance[:9, :9] + 1e-18 * np.eye(9)).T * 1e-3
    found_m, _ = result.to_ground(pixels)
    others = [
        replace(result, image_to_ground=result.image_to_ground + one.reshape(3, 3)).to_ground(pixels)[0]
        for one in steps
    ]
    longer = [np.log(np.linalg.norm(np.diff(one, axis=0)) / np.linalg.norm(np.diff(found_m, axis=0))) for one in others]
    return float(np.linalg.norm(longer)) / 1e-3


def test_a_second_good_look_never_makes_lengths_less_sure_and_no_look_never_surer() -> None:
    ground, view = by_marker(camera=CameraPrior.unknown(640, 480)), looking()
    seen = [
        length_after(ground, time_s, None, pictured(view, seed=int(10 * time_s))) for time_s in (0.0, 0.5, 1.0, 1.5)
    ]
    assert (np.diff(seen) <= 1e-6).all()
    hidden = [length_after(ground, time_s, None) for time_s in (2.0, 2.5, 3.0)]
    assert (np.diff([seen[-1], *hidden]) >= -1e-9).all()


def test_a_marker_where_it_cannot_be_is_left_out() -> None:
    places = tuple(MarkerPlace.lying(k, 1.0, xy_m=(1.8 * k, 0.4 * k)) for k in range(3))
    elsewhere = MarkerPlace.lying(2, 1.0, xy_m=(3.6, 2.2))
    view = looking(0.0, 60.0, 11.0)
    result = mapped(by_marker(*places).update(frame(pictured(view, (*places[:2], elsewhere))), NOTHING, STILL))
    assert len(result.anchors_px) == 8
    assert error_in_sigmas(result, view).max() < 4.0


def test_the_gate_lets_pass_what_the_covariance_allows() -> None:
    view, covariance = looking(), np.diag([1e-4] * 3 + [1e-2] * 3 + [1e-6] * 2) ** 2
    (seen,) = MarkerObserver([PLACE]).observe(pictured(view))
    assert agrees(view, covariance, seen, 0.0)
    away = replace(seen, points_px=seen.points_px + 8.0)
    assert not agrees(view, covariance, away, 0.0)
    assert agrees(view, covariance * 1e4, away, 0.0)


@pytest.mark.live
def test_a_hidden_marker_s_map_is_carried_and_ends_when_nobody_knows_how_the_camera_moved() -> None:
    ground, view = by_marker(), looking()
    ground.update(frame(pictured(view)), NOTHING, unmoved())
    carried = mapped(ground.update(frame(BARE, 0.5), NOTHING, unmoved()))
    assert (carried.method, carried.age_s) == ("markers", 0.5)
    assert NO_MARKER in reason(ground.update(frame(BARE, 1.0), NOTHING, STILL))
    assert mapped(ground.update(frame(BARE, 1.5), NOTHING, unmoved())).age_s == 1.5


def test_a_belief_begun_between_keyframes_is_carried_at_once() -> None:
    ground, view = by_marker(), looking()
    ground.update(frame(BARE), NOTHING, unmoved())
    shift = np.array([[1.0, 0.0, 5.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    moved = CameraMotion(shift, 1e-12 * np.eye(9), 0.0)
    mapped(ground.update(frame(pictured(view), 1.0), NOTHING, moved))
    carried = mapped(ground.update(frame(BARE, 1.1), NOTHING, moved))
    corners_m, _ = carried.to_ground(view.project(PLACE.corners_m))
    assert np.abs(corners_m - PLACE.corners_m[:, :2]).max() < 0.05


def test_telemetry_steadies_a_small_marker() -> None:
    view = looking(0.0, 50.0, 24.0)
    gray, said = pictured(view), telemetry_of(view)
    alone, beside = (by_marker(camera=CameraPrior.unknown(640, 480)) for _ in range(2))
    without = alone.update(frame(gray), NOTHING, unmoved())
    assert length_after(beside, 0.0, said, gray) < (length_after(alone, 0.0, None, gray) if without else np.inf)


def people(boxes: FloatArray) -> Detections:
    return Detections(boxes, np.ones(len(boxes)), np.zeros(len(boxes), dtype=np.int64))


def test_people_alone_give_a_map_or_a_reason_never_silence() -> None:
    gray = np.zeros((720, 1280), dtype=np.uint8)
    mapped_ones = 0
    for seed in range(6):
        crowd, ground = random_crowd(seed), FusedGround()
        results = [ground.update(frame(gray, time_s), people(boxes), unmoved()) for time_s, boxes in crowd.pictures]
        assert all(result or reason(result) for result in results)
        if isinstance(results[-1], GroundMap):
            assert results[-1].method == "sizes"
            assert not results[-1].frame_stated
            pixels = np.array([[600.0, 400.0], [680.0, 400.0]])
            ratio = np.linalg.norm(np.diff(results[-1].to_ground(pixels)[0], axis=0)) / np.linalg.norm(
                np.diff(crowd.view.to_plane(pixels), axis=0)
            )
            assert abs(np.log(ratio)) < 2.0 * ground.length_sigma
            mapped_ones += 1
    assert mapped_ones >= 3


def test_a_few_people_need_the_drone_s_height_beside_them() -> None:
    crowd = random_crowd(2, clean=True, people=4)
    gray = np.zeros((720, 1280), dtype=np.uint8)
    said = Telemetry(0.0, "drawn", height_m=float(crowd.view.position_m[2]), height_sigma_m=0.8)
    wrong = replace(said, height_m=10.0 * said.height_m)
    last: dict[str, GroundMap | NoGroundMap] = {}
    for name, telemetry in (("alone", None), ("height", said), ("wrong", wrong)):
        ground = FusedGround(camera=CameraPrior.calibrated(drone_camera()))
        for time_s, boxes in crowd.pictures:
            last[name] = ground.update(frame(gray, time_s, telemetry), people(boxes), unmoved())
    assert FEW_PEOPLE in reason(last["alone"])
    assert mapped(last["height"]).method == "sizes"
    assert CONTRADICTION in reason(last["wrong"])


def test_what_the_metres_rest_on_is_said_once_it_is_known() -> None:
    ground = by_marker()
    assert ground.describe()["basis"].endswith("not seen yet")
    assert "first frame" in FusedGround().describe()["basis"]
    ground.update(frame(pictured(looking())), NOTHING, unmoved())
    assert ground.describe()["basis"].startswith(
        "a printed marker of 1.2 m, its camera's lens from a camera file: expect"
    )
    nothing = FusedGround(params=FusedParams(telemetry=False, sizes=False))
    assert "would help" in reason(nothing.update(frame(BARE), NOTHING, STILL))
    assert nothing.describe()["basis"].startswith("nothing")


@pytest.mark.parametrize("missing", ["pitch_deg", "height_m"])
def test_telemetry_that_lacks_something_is_no_map_and_says_what(missing: str) -> None:
    said = telemetry_of(looking(), None, **{missing: np.nan})
    result = FusedGround(camera=CameraPrior.calibrated(CAMERA)).update(frame(BARE, 0.0, said), NOTHING, STILL)
    assert "telemetry without" in reason(result)
