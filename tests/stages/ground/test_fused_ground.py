from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from drawn_ground import frame
from drawn_solid import box_around, distance_and_sigma, drawn, lens, looking_at, motion_between, top_px
from tolerances import KEYED_MAP_M

from standoff.core.camera import CameraPrior
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import CameraMotion, Detections, GroundMap, ImageArray, NoCameraMotion, NoGroundMap
from standoff.stages.ground import FusedGround, FusedParams, Reference, ReferenceParams, ReferenceShape
from standoff.stages.ground.reference_box import NOT_SEEN, NOT_YET, GivenPlace
from standoff.stages.ground.solid import SolidState

SHAPE = ReferenceShape.rectangle(2.0, 2.89)
CAMERA = lens(k1=-0.05)
HEIGHT_M = 0.4
FPS = 5.0
NOTHING = Detections.empty()
STILL = NoCameraMotion("not estimated")
PAIR_PX = np.array([[150.0, 300.0], [480.0, 120.0]])


def _flown(k: int, speed_mps: float = 0.6) -> SolidState:
    """Return what is seen in frame k of a drone that drifts sideways and turns."""
    start = looking_at(CAMERA, (1.2, 1.6), away_m=12.0, heading_deg=25.0, pitch_deg=50.0)
    time_s = k / FPS
    change = np.array([0.01, 0.02, -0.015, speed_mps, -0.3 * speed_mps, 0.1, 0.0, 0.0]) * time_s
    return SolidState(start.changed(change), HEIGHT_M)


def _ground(
    shape: ReferenceShape = SHAPE,
    *,
    box: bool = True,
    height_m: float | None = HEIGHT_M,
    place: GivenPlace | None = None,
    camera: CameraPrior | None = None,
    remember: bool = True,
) -> FusedGround:
    if place is None:
        place = GivenPlace(box_around(SHAPE, _flown(0)) if box else None, first_corner_px=top_px(SHAPE, _flown(0))[0])
    reference = Reference(shape, height_m, place, ReferenceParams(size_sigma=0.0))
    params, prior = FusedParams(sizes=False), camera or CameraPrior.calibrated(CAMERA)
    return FusedGround([reference], camera=prior, params=params, remember=remember)


def _motion(k: int, key: int = 0) -> CameraMotion | NoCameraMotion:
    return STILL if k == key else motion_between(_flown(key).view, _flown(k).view, key / FPS)


def _picture(k: int, *, solid: bool = True) -> ImageArray:
    return drawn(SHAPE, _flown(k), seed=k, solid=solid)


def _run(
    ground: FusedGround, frames: Sequence[int], *, hidden: Sequence[int] = (), keys: dict[int, int] | None = None
) -> list[GroundMap | NoGroundMap]:
    """Run frames whose motions refer to frame 0, or to the keyframes given for them."""
    keys = keys or {}
    return [
        ground.update(frame(_picture(k, solid=k not in hidden), k / FPS), NOTHING, _motion(k, keys.get(k, 0)))
        for k in frames
    ]


def _seen(result: GroundMap | NoGroundMap) -> GroundMap:
    assert isinstance(result, GroundMap), result
    return result


def _true_m(view: View, pair_px: FloatArray = PAIR_PX) -> float:
    one, other = view.to_plane(pair_px)
    return float(np.linalg.norm(other - one))


def test_distances_are_right_within_their_errors_from_the_first_frame_on() -> None:
    for k, result in enumerate(_run(_ground(), range(8))):
        length, sigma = distance_and_sigma(_seen(result), PAIR_PX)
        assert abs(length - _true_m(_flown(k).view)) < 3.0 * sigma
        assert sigma < 0.05 * length


def test_a_rigid_motion_of_the_site_changes_no_distance() -> None:
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    elsewhere = ReferenceShape.from_corners(SHAPE.corners_m @ turn.T + [100.0, -40.0])
    here, there = (_run(_ground(shape), range(4)) for shape in (SHAPE, elsewhere))
    for one, other in zip(here, there, strict=True):
        np.testing.assert_allclose(
            distance_and_sigma(_seen(one), PAIR_PX), distance_and_sigma(_seen(other), PAIR_PX), rtol=1e-3
        )


def test_more_pictures_of_the_reference_never_make_the_scale_less_sure() -> None:
    still = [_ground_update(ground, 0, time_s) for ground in [_ground()] for time_s in (0.0, 0.2, 0.4, 0.8, 1.6)]
    sigmas = [distance_and_sigma(_seen(result), PAIR_PX)[1] for result in still]
    assert (np.diff(sigmas) <= 1e-3 * sigmas[0]).all(), sigmas


def _ground_update(ground: FusedGround, k: int, time_s: float, *, solid: bool = True) -> GroundMap | NoGroundMap:
    """Show frame k again at another time, the camera at rest since time 0."""
    motion = STILL if time_s == 0.0 else motion_between(_flown(k).view, _flown(k).view, 0.0)
    return ground.update(frame(drawn(SHAPE, _flown(k), seed=round(time_s * 10), solid=solid), time_s), NOTHING, motion)


def test_a_hidden_reference_is_carried_and_grows_older_and_less_sure() -> None:
    hidden = range(3, 12)
    results = [_seen(result) for result in _run(_ground(), range(12), hidden=hidden)]
    ages = [result.age_s for result in results]
    assert ages[:3] == [0.0] * 3
    np.testing.assert_allclose(ages[3:], (np.arange(3, 12) - 2) / FPS)
    for k in hidden:
        length, sigma = distance_and_sigma(results[k], PAIR_PX)
        assert abs(length - _true_m(_flown(k).view)) < 3.0 * sigma
    at_rest = _ground()
    results = [_seen(_ground_update(at_rest, 0, time_s, solid=time_s < 0.5)) for time_s in (0.0, 0.4, 0.8, 1.6)]
    sigmas = [distance_and_sigma(result, PAIR_PX)[1] for result in results[1:]]
    assert (np.diff(sigmas) >= -1e-9).all(), sigmas


def test_a_hidden_reference_carried_from_keyframe_to_keyframe_ends_in_no_map() -> None:
    ground = _ground()
    _seen(ground.update(frame(_picture(0), 0.0), NOTHING, STILL))
    sigmas = []
    for k in range(1, 40):
        motion = motion_between(_flown(0).view, _flown(0).view, (k - 1) / FPS, sigma_px=10.0)
        result = ground.update(frame(drawn(SHAPE, _flown(0), solid=False), k / FPS), NOTHING, motion)
        if isinstance(result, NoGroundMap):
            break
        sigmas.append(distance_and_sigma(result, PAIR_PX)[1])
    assert isinstance(result, NoGroundMap)
    assert len(sigmas) > 2 and (np.diff(sigmas) > 0).all()


def test_without_motion_and_without_the_reference_there_is_no_map() -> None:
    ground = _ground()
    _seen(ground.update(frame(_picture(0), 0.0), NOTHING, STILL))
    hidden = drawn(SHAPE, _flown(1), solid=False)
    assert isinstance(ground.update(frame(hidden, 1.0), NOTHING, STILL), NoGroundMap)


def test_one_frame_that_shows_the_reference_elsewhere_hardly_moves_the_map() -> None:
    for shift in ((20.0, 0.0), (0.0, 20.0), (-14.0, 14.0)):
        ground = _ground()
        _run(ground, range(4))
        moved = np.roll(_picture(4), np.rint(shift).astype(int)[::-1], axis=(0, 1))
        wrong = _seen(ground.update(frame(moved, 4 / FPS), NOTHING, _motion(4)))
        assert np.linalg.norm(wrong.anchors_px - top_px(SHAPE, _flown(4)), axis=1).max() < 2.0
        right = _seen(ground.update(frame(_picture(5), 5 / FPS), NOTHING, _motion(5)))
        length, sigma = distance_and_sigma(right, PAIR_PX)
        assert abs(length - _true_m(_flown(5).view)) < 3.0 * sigma


def test_a_new_keyframe_changes_nothing_where_motions_are_exact() -> None:
    plain = _run(_ground(), range(8), hidden=range(2, 8))
    rekeyed = _run(_ground(), range(8), hidden=range(2, 8), keys=dict.fromkeys(range(4, 8), 3))
    for one, other in zip(plain, rekeyed, strict=True):
        lengths = [distance_and_sigma(_seen(result), PAIR_PX)[0] for result in (one, other)]
        assert lengths[0] == pytest.approx(lengths[1], abs=KEYED_MAP_M)


def test_a_reset_forgets_everything() -> None:
    ground = _ground()
    first = _run(ground, range(3))
    ground.reset()
    again = _run(ground, range(3))
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(_seen(one).image_to_ground, _seen(other).image_to_ground)
        np.testing.assert_array_equal(_seen(one).covariance, _seen(other).covariance)


def test_pictures_of_another_size_start_anew() -> None:
    ground = _ground(box=False)
    sized = [_detected(box_around(SHAPE, _flown(0)))]
    _seen(ground.update(frame(_picture(0), 0.0), sized[0], STILL))
    half = _picture(0)[::2, ::2]
    small = ground.update(frame(np.ascontiguousarray(half), 0.2), _detected(box_around(SHAPE, _flown(0)) / 2.0), STILL)
    if isinstance(small, GroundMap):
        assert small.image_size_px == (320, 180)
        length, sigma = distance_and_sigma(small, PAIR_PX / 2.0)
        assert abs(length - _true_m(_flown(0).view)) < 4.0 * sigma


def _detected(box: FloatArray) -> Detections:
    return Detections(box[None], np.array([0.9]), np.array([CLASS_BY_NAME["reference"].id]))


def test_a_camera_for_pictures_of_another_shape_is_refused() -> None:
    ground = _ground(camera=CameraPrior.calibrated(lens(size_px=(640, 480))))
    with pytest.raises(GroundError, match="aspect"):
        ground.prepare((640, 360))
    with pytest.raises(GroundError, match="aspect"):
        ground.update(frame(_picture(0), 0.0), NOTHING, STILL)


def test_a_box_given_for_a_later_frame_is_used_then() -> None:
    place = GivenPlace(box_around(SHAPE, _flown(3)), box_time_s=3 / FPS, first_corner_px=top_px(SHAPE, _flown(3))[0])
    results = _run(_ground(place=place), range(5))
    for k in range(3):
        assert results[k].reason == NOT_YET  # type: ignore[union-attr]
    for k in (3, 4):
        length, sigma = distance_and_sigma(_seen(results[k]), PAIR_PX)
        assert abs(length - _true_m(_flown(k).view)) < 3.0 * sigma


def test_without_a_box_the_detector_says_where_and_its_silence_is_no_map() -> None:
    ground = _ground(box=False)
    nothing = ground.update(frame(_picture(0), 0.0), NOTHING, STILL)
    assert isinstance(nothing, NoGroundMap) and nothing.reason == NOT_SEEN
    found = ground.update(frame(_picture(1), 1 / FPS), _detected(box_around(SHAPE, _flown(1))), STILL)
    length, sigma = distance_and_sigma(_seen(found), PAIR_PX)
    assert abs(length - _true_m(_flown(1).view)) < 3.0 * sigma


def test_a_height_that_nobody_measured_is_learned_where_the_base_shows() -> None:
    ground = _ground(height_m=None)
    results = _run(ground, range(6))
    length, sigma = distance_and_sigma(_seen(results[-1]), PAIR_PX)
    assert abs(length - _true_m(_flown(5).view)) < 3.0 * sigma


def test_the_record_of_a_run_says_what_the_ground_was_told() -> None:
    described = _ground().describe()
    assert described["method"] == "fused" and described["camera"] == "camera file"
    assert _ground(remember=False).describe()["method"] == "refined"


def test_frames_taken_each_by_itself_need_no_motion() -> None:
    ground = _ground(remember=False)
    for k in range(3):
        result = ground.update(frame(_picture(k), k / FPS), NOTHING, STILL)
        length, sigma = distance_and_sigma(_seen(result), PAIR_PX)
        assert abs(length - _true_m(_flown(k).view)) < 3.0 * sigma
        assert _seen(result).site_frame == 0, "places of one reference can be compared from frame to frame"


@pytest.mark.parametrize(("wider", "believed"), [(1.0, True), (1.15, True), (1.6, False)])
def test_what_fills_only_a_part_of_the_detectors_box_is_something_else(wider: float, believed: bool) -> None:
    """A frame in front of a reference that is mostly hidden may have its shape."""
    box = box_around(SHAPE, _flown(0))
    middle, half = (box[:2] + box[2:]) / 2.0, wider * (box[2:] - box[:2]) / 2.0
    loose = np.concatenate([middle - half, middle + half])[None]
    detected = Detections(loose, np.array([0.9]), np.array([CLASS_BY_NAME["reference"].id]))
    result = _ground(place=GivenPlace()).update(frame(_picture(0)), detected, STILL)
    assert isinstance(result, GroundMap) == believed
