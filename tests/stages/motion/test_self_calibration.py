from __future__ import annotations

import cv2
import numpy as np
import pytest
from drawn_ground import SIZE_PX, lens
from flown_ground import NOTHING, flight, frame, moved, seen

from standoff.core.camera import Camera, CameraPrior, RadialDistortion
from standoff.core.homography import FloatArray
from standoff.core.types import CameraMotion, ImageArray
from standoff.stages.motion import MotionEstimator
from standoff.stages.motion.self_calibration import SelfCalibration

USUAL_PX = float(CameraPrior.unknown(*SIZE_PX).camera.matrix[0, 0])


def bent(camera: Camera, views: list[FloatArray]) -> list[ImageArray]:
    x, y = np.meshgrid(np.arange(SIZE_PX[0]), np.arange(SIZE_PX[1]))
    ideal = camera.undistort(np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float64))
    maps = ideal.reshape(SIZE_PX[1], SIZE_PX[0], 2).astype(np.float32)
    return [
        cv2.remap(seen(one, seed=index), maps[..., 0], maps[..., 1], cv2.INTER_LINEAR)
        for index, one in enumerate(views)
    ]


def followed(camera: Camera, times_s: FloatArray, known: Camera | None = None) -> CameraMotion:
    estimator = MotionEstimator(camera=known)
    motions = [
        estimator.update(frame(picture, index), NOTHING)
        for index, picture in enumerate(bent(camera, [flight(time_s, camera) for time_s in times_s]))
    ]
    return moved(motions[-1])


@pytest.mark.parametrize(("focal_px", "k1"), [(420.0, -0.14), (300.0, 0.0), (380.0, 0.06)])
def test_a_flight_tells_how_the_lens_bends_the_picture_and_removes_it(focal_px: float, k1: float) -> None:
    camera = lens(focal_px, (k1, 0.0, 0.0, 0.0, 0.0))
    motion = followed(camera, np.arange(0.0, 3.0, 0.1))
    told = motion.distortion
    assert told is not None and told.focal_px == USUAL_PX
    true = k1 * (USUAL_PX / focal_px) ** 2
    assert abs(told.k1 - true) < 2.0 * told.sigma, (told, true)
    assert told.sigma < CameraPrior.unknown(*SIZE_PX).k1_sigma
    assert motion.camera is not None, "it is removed from what is followed from then on"
    assert motion.camera.distortion[0] == pytest.approx(true, abs=2.0 * told.sigma)


def test_a_camera_that_stands_still_tells_nothing_of_its_lens() -> None:
    motion = followed(lens(420.0, (-0.14, 0.0, 0.0, 0.0, 0.0)), np.zeros(12))
    assert motion.distortion is None and motion.camera is None


def test_a_lens_that_is_known_is_not_asked_for() -> None:
    camera = lens(420.0, (-0.14, 0.0, 0.0, 0.0, 0.0))
    assert followed(camera, np.arange(0.0, 1.5, 0.1), known=camera).distortion is None


@pytest.mark.parametrize("seed", range(4))
def test_every_pair_of_pictures_makes_it_surer(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera = CameraPrior.unknown(1280, 720).camera.refocused(1.0, rng.uniform(-0.15, 0.05))
    calibration, sigmas = SelfCalibration((1280, 720)), []
    for _ in range(4):
        ideal = rng.uniform((-100.0, -60.0), (1380.0, 780.0), (300, 2))
        turn = np.eye(3) + rng.normal(0.0, 1.0, (3, 3)) * ((0.03, 0.03, 40.0), (0.03, 0.03, 40.0), (3e-5, 3e-5, 0.0))
        other = cv2.perspectiveTransform(ideal[:, None], turn)[:, 0]
        pictures = [camera.distort(points) for points in (ideal, other)]
        inside = np.all([(one >= 0).all(axis=1) & (one <= (1279, 719)).all(axis=1) for one in pictures], axis=0)
        first, second = (one[inside] + rng.normal(0.0, 0.15, (inside.sum(), 2)) for one in pictures)
        calibration.take(first, second, inlier_px=2.0, followed_px=1.3)
        told = calibration.told
        assert told is not None
        sigmas.append(told.sigma)
        assert abs(told.k1 - camera.distortion[0]) < 2.0 * told.sigma
    assert all(np.diff(sigmas) < 0.0)


def test_what_was_told_in_two_parts_is_what_was_told_at_once() -> None:
    prior = CameraPrior.unknown(1280, 720)
    first, all_of_it = RadialDistortion(-0.06, 0.05, 1000.0), RadialDistortion(-0.11, 0.02, 1000.0)
    once, twice = prior.with_distortion(all_of_it), prior.with_distortion(first).with_distortion(all_of_it.since(first))
    np.testing.assert_allclose(twice.camera.distortion, once.camera.distortion, rtol=1e-9)
    assert twice.k1_sigma == pytest.approx(once.k1_sigma)
