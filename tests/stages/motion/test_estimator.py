from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
import pytest
import tolerances
from drawn_ground import SIZE_PX, lens, view
from flown_ground import (
    FPS,
    GROUND,
    LENS,
    NOTHING,
    OTHER_GROUND,
    error_px,
    flight,
    follow,
    frame,
    grid,
    moved,
    reason,
    seen,
)  # fmt: skip

from standoff.core import homography
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.picture_step import picture_step
from standoff.core.types import CameraMotion, Detections, ImageArray, NoCameraMotion
from standoff.stages.motion import MotionEstimator

HOME = flight(0.0)
TRUCK = CLASS_BY_NAME["dump_truck"].id


def shifted(x_px: float, y_px: float = 0.0) -> FloatArray:
    return np.array([[1.0, 0.0, x_px], [0.0, 1.0, y_px], [0.0, 0.0, 1.0]]) @ HOME


def scaled(factor: float) -> FloatArray:
    half = np.array([[1.0, 0.0, SIZE_PX[0] / 2], [0.0, 1.0, SIZE_PX[1] / 2], [0.0, 0.0, 1.0]])
    return half @ np.diag([factor, factor, 1.0]) @ np.linalg.inv(half) @ HOME


def lengths(errors: FloatArray) -> FloatArray:
    return np.hypot(errors[:, 0], errors[:, 1])


def test_the_first_frame_is_its_own_keyframe_and_has_not_moved() -> None:
    first = moved(MotionEstimator().update(frame(seen(HOME), 7), NOTHING))
    assert (first.keyframe_to_image == np.eye(3)).all()
    assert first.keyframe_s == 7 / FPS
    assert not first.covariance.any() and not first.repeated


def test_a_camera_that_stands_still_is_seen_to() -> None:
    motions = [moved(m) for m in follow([seen(HOME, seed=index) for index in range(8)])]
    for motion in motions:
        assert lengths(error_px(motion.keyframe_to_image, HOME, HOME)).max() < tolerances.FOLLOWED_PX
        assert motion.keyframe_s == 0.0 and not motion.repeated


@pytest.fixture(scope="module")
def flown() -> list[ImageArray]:
    return [seen(flight(index / FPS), seed=index) for index in range(300)]


def carried(motions: list[CameraMotion | NoCameraMotion], every: int = 1) -> tuple[FloatArray, int]:
    """Return the composed motion from the first to the last frame, and how many keyframes there were."""
    total, keys = np.eye(3), set()
    for index, (before, now) in enumerate(pairwise(motions)):
        step = picture_step(before, index * every / FPS, now)
        assert step is not None
        total = step @ total
        keys.add(moved(now).keyframe_s)
    return total / np.linalg.norm(total), len(keys)


def test_a_flight_adds_up_to_less_than_a_pixel_over_all_its_keyframes(flown: list[ImageArray]) -> None:
    total, keys = carried(follow(flown))
    assert keys > 5
    assert lengths(error_px(total, flight(0.0), flight(299 / FPS))).mean() < 1.0


def test_half_the_frames_tell_the_same_motion(flown: list[ImageArray]) -> None:
    all_of_them, half = follow(flown[:61]), follow(flown[:61], every=2)
    whole, _ = carried(all_of_them)
    sparse, _ = carried(half, every=2)
    apart = homography.apply(whole, grid())[0] - homography.apply(sparse, grid())[0]
    assert lengths(apart).max() < tolerances.COMPOSED_PX


def test_a_keyframe_is_always_a_frame_before(flown: list[ImageArray]) -> None:
    motions = [moved(motion) for motion in follow(flown[:80])]
    for index, (before, now) in enumerate(pairwise(motions)):
        assert now.keyframe_s in (before.keyframe_s, index / FPS)


def test_nineteen_of_twenty_points_lie_in_their_ellipses() -> None:
    rng = np.random.default_rng(4)
    inside: list[FloatArray] = []
    for trial in range(40):
        estimator = MotionEstimator()
        start_s = float(rng.uniform(0.0, 20.0))
        views = [flight(start_s + step * 0.04) for step in range(4)]
        noise = float(rng.uniform(1.0, 6.0))
        for index, ground_to_image in enumerate(views):
            picture = seen(ground_to_image, noise=noise, seed=10 * trial + index)
            motion = moved(estimator.update(frame(picture, index), NOTHING))
        error = error_px(motion.keyframe_to_image, views[0], views[-1])
        by_entries = homography.parameter_jacobian(motion.keyframe_to_image, grid()[: len(error)])
        covariance = by_entries @ motion.covariance @ by_entries.transpose(0, 2, 1)
        inside.append(np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error) < 5.991)
    share = float(np.concatenate(inside).mean())
    assert 0.90 <= share <= 0.99, share


def block(gray: ImageArray, left: int, width: int) -> ImageArray:
    """Draw a lorry with a pattern of its own that fills the picture's height."""
    drawn = gray.copy()
    drawn[:, max(left, 0) : left + width] = OTHER_GROUND[200 : 200 + SIZE_PX[1], 300 + max(-left, 0) : 300 + width]
    return drawn


def test_a_lorry_that_fills_half_the_picture_does_not_carry_the_ground_along() -> None:
    estimator = MotionEstimator()
    for index in range(12):
        left, width = 20 + 5 * index, 240
        box = np.array([[left, 0.0, left + width, SIZE_PX[1]]])
        truck = Detections(box, np.array([0.9]), np.array([TRUCK]))
        now = shifted(-2.0 * index)
        motion = moved(estimator.update(frame(block(seen(now, seed=index), left, width), index), truck))
        key = shifted(-2.0 * round(motion.keyframe_s * FPS))
        assert lengths(error_px(motion.keyframe_to_image, key, now)).max() < tolerances.HALF_SEEN_PX


def test_the_last_boxes_are_left_out_while_the_detector_rests() -> None:
    estimator = MotionEstimator()
    for index in range(12):
        left, width = 20 + 3 * index, 270
        box = np.array([[left, 0.0, left + width, SIZE_PX[1]]])
        truck = Detections(box, np.array([0.9]), np.array([TRUCK])) if index % 4 == 0 else NOTHING
        picture = block(seen(HOME, seed=index), left, width)
        motion = moved(estimator.update(frame(picture, index), truck))
        assert lengths(error_px(motion.keyframe_to_image, HOME, HOME)).max() < tolerances.HALF_SEEN_PX


def test_a_second_plane_with_many_points_makes_the_first_less_sure() -> None:
    sigmas = []
    for width in (0, 170):
        estimator = MotionEstimator()
        for index in range(4):
            picture = block(seen(HOME, seed=index), 2 * index, width) if width else seen(HOME, seed=index)
            motion = moved(estimator.update(frame(picture, index), NOTHING))
        by_entries = homography.parameter_jacobian(motion.keyframe_to_image, grid())
        spread = by_entries @ motion.covariance @ by_entries.transpose(0, 2, 1)
        sigmas.append(float(np.sqrt(spread[:, 0, 0]).mean()))
        assert lengths(error_px(motion.keyframe_to_image, HOME, HOME)).max() < tolerances.HALF_SEEN_PX
    assert sigmas[1] > 10.0 * sigmas[0]


def test_a_cut_is_told_once_and_followed_from_there() -> None:
    pictures = [seen(HOME, seed=index) for index in range(4)]
    pictures += [seen(HOME, ground=OTHER_GROUND, seed=index) for index in range(4)]
    results = follow(pictures)
    assert [bool(result) for result in results] == [True] * 4 + [False] + [True] * 3
    assert reason(results[4]) == "the picture was cut"
    assert {moved(result).keyframe_s for result in results[5:]} == {4 / FPS}


def test_a_zoom_is_told_from_its_second_frame_on_and_followed_after_it() -> None:
    factors = [1.0] * 4 + [1.05**step for step in range(1, 9)] + [1.05**8] * 4
    results = follow([seen(scaled(factor), seed=index) for index, factor in enumerate(factors)])
    told = [isinstance(result, NoCameraMotion) and result.reason == "the camera zoomed" for result in results]
    assert told == [False] * 5 + [True] * 7 + [False] * 4
    assert all(results[12:])


def test_a_descent_is_no_zoom() -> None:
    heights = [flight(0.0)] + [view(LENS, (0.0, 0.0), 13.0 - 0.2 * step, 30.0, 0.0) for step in range(1, 25)]
    assert all(follow([seen(height, seed=index) for index, height in enumerate(heights)]))


def test_a_picture_that_is_shown_again_is_told_and_has_not_moved() -> None:
    pictures = [seen(shifted(3.0 * index), seed=index) for index in range(4)]
    again = pictures[3].copy()
    again[10, 10:40] ^= 1
    results = [moved(result) for result in follow([*pictures, pictures[3], again, seen(shifted(18.0), seed=9)])]
    assert [result.repeated for result in results] == [False] * 4 + [True, True, False]
    assert (results[5].keyframe_to_image == results[3].keyframe_to_image).all()
    assert lengths(error_px(results[6].keyframe_to_image, HOME, shifted(18.0))).max() < tolerances.FOLLOWED_PX


def test_a_change_of_size_is_told_and_followed_from_there() -> None:
    small = [np.ascontiguousarray(cv2.resize(seen(HOME, seed=index), (320, 240))) for index in range(3)]
    results = follow([seen(HOME), *small])
    assert reason(results[1]) == "the picture's size changed"
    assert moved(results[2]).keyframe_s == 1 / FPS


def test_a_clock_that_goes_backwards_is_told() -> None:
    estimator = MotionEstimator()
    estimator.update(frame(seen(HOME), 5), NOTHING)
    assert reason(estimator.update(frame(seen(HOME, seed=1), 2), NOTHING)) == "the clock went backwards"
    assert moved(estimator.update(frame(seen(HOME, seed=2), 3), NOTHING)).keyframe_s == 2 / FPS


def test_darkness_is_too_little_to_follow_and_the_keyframe_outlives_it() -> None:
    dark = np.full((SIZE_PX[1], SIZE_PX[0]), 3, np.uint8)
    dark[::7] = 4
    results = follow([seen(HOME), seen(HOME, seed=1), dark, dark, seen(shifted(2.0), seed=2)])
    assert [reason(result) for result in results[2:4]] == ["too little to follow"] * 2
    assert moved(results[4]).keyframe_s == 0.0
    assert lengths(error_px(moved(results[4]).keyframe_to_image, HOME, shifted(2.0))).max() < tolerances.FOLLOWED_PX


def test_a_film_that_begins_dark_begins_where_it_can_be_seen() -> None:
    dark = np.full((SIZE_PX[1], SIZE_PX[0]), 3, np.uint8)
    results = follow([dark, seen(HOME), seen(HOME, seed=1)])
    assert reason(results[0]) == "too little to follow"
    assert [moved(result).keyframe_s for result in results[1:]] == [1 / FPS] * 2


def test_the_lens_is_removed_where_it_is_known() -> None:
    wide = lens(420.0, (-0.15, 0.03, 0.001, -0.001, 0.0))
    x, y = np.meshgrid(np.arange(SIZE_PX[0]), np.arange(SIZE_PX[1]))
    ideal = wide.undistort(np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float64))
    maps = ideal.reshape(SIZE_PX[1], SIZE_PX[0], 2).astype(np.float32)
    views = [flight(0.04 * index) for index in range(10)]
    estimator = MotionEstimator(camera=wide)
    for index, ground_to_image in enumerate(views):
        picture = cv2.remap(seen(ground_to_image, seed=index), maps[..., 0], maps[..., 1], cv2.INTER_LINEAR)
        motion = moved(estimator.update(frame(picture, index), NOTHING))
    assert motion.camera is not None and motion.camera.distortion[0] == -0.15
    assert lengths(error_px(motion.keyframe_to_image, views[0], views[-1])).max() < tolerances.FOLLOWED_PX


def test_a_camera_of_another_shape_is_refused() -> None:
    with pytest.raises(GroundError, match="another aspect ratio"):
        MotionEstimator(camera=LENS).update(frame(GROUND[:200, :400], 0), NOTHING)


def test_resetting_forgets_everything() -> None:
    estimator = MotionEstimator()
    estimator.update(frame(seen(HOME), 5), NOTHING)
    estimator.reset()
    assert (moved(estimator.update(frame(seen(shifted(9.0)), 0), NOTHING)).keyframe_to_image == np.eye(3)).all()
