"""Rough ground seen by a camera that flies: pictures with exactly known motion."""

from __future__ import annotations

import cv2
import numpy as np
from drawn_ground import SIZE_PX, GrayPicture, lens, view

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.types import CameraMotion, Detections, Frame, ImageArray, NoCameraMotion
from standoff.stages.motion import MotionEstimator

NOTHING = Detections.empty()
LENS = lens()
FPS = 25.0
ROUND_S = 12.0
_SIDE = 1400
_STEP_M = 0.035
_TO_GROUND = np.array([[_STEP_M, 0.0, -_SIDE / 2 * _STEP_M], [0.0, _STEP_M, -_SIDE / 2 * _STEP_M], [0.0, 0.0, 1.0]])


def rough(seed: int) -> ImageArray:
    """Return ground from above: stones of a few texels, and larger patches."""
    rng = np.random.default_rng(seed)
    fine = cv2.GaussianBlur(rng.normal(0.0, 1.0, (_SIDE, _SIDE)).astype(np.float32), (0, 0), 1.8)
    coarse = cv2.resize(
        rng.normal(0.0, 18.0, (40, 40)).astype(np.float32), (_SIDE, _SIDE), interpolation=cv2.INTER_CUBIC
    )
    return np.asarray(np.clip(120.0 + fine * (25.0 / fine.std()) + coarse, 0, 255), dtype=np.uint8)


GROUND, OTHER_GROUND = rough(1), rough(2)


def seen(ground_to_image: FloatArray, *, ground: ImageArray = GROUND, noise: float = 2.0, seed: int = 0) -> ImageArray:
    """Return what a camera without distortion sees, with sensor noise."""
    clean = cv2.warpPerspective(ground, ground_to_image @ _TO_GROUND, SIZE_PX, flags=cv2.INTER_LINEAR).astype(
        np.float32
    )
    noisy = clean + np.random.default_rng(seed).standard_normal(clean.shape, dtype=np.float32) * noise
    return np.asarray(np.clip(np.rint(noisy), 0, 255), dtype=np.uint8)


def frame(gray: ImageArray, index: int, fps: float = FPS) -> Frame:
    return Frame("flown", index, index / fps, GrayPicture(gray))


def flight(time_s: float, camera: Camera = LENS) -> FloatArray:
    """Return ground_to_image of a drone that flies a round, climbs, tilts and turns by up to 21 degrees a second."""
    phase = 2.0 * np.pi * time_s / ROUND_S
    target = (5.0 * np.sin(phase), 4.0 * (1.0 - np.cos(phase)))
    away_m = 13.0 + 2.0 * np.sin(phase)
    return view(camera, target, away_m, 30.0 + 5.0 * np.sin(2.0 * phase), 40.0 * np.sin(phase))


def moved(result: CameraMotion | NoCameraMotion) -> CameraMotion:
    assert isinstance(result, CameraMotion), result
    return result


def reason(result: CameraMotion | NoCameraMotion) -> str:
    assert isinstance(result, NoCameraMotion), result
    return result.reason


def grid() -> FloatArray:
    """Return (35, 2) points over the picture."""
    x, y = np.meshgrid(np.linspace(20, SIZE_PX[0] - 20, 7), np.linspace(20, SIZE_PX[1] - 20, 5))
    return np.stack([x.ravel(), y.ravel()], axis=1)


def error_px(found: FloatArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """Return (N, 2) how far points of the picture before that are also in the one after are carried wrongly."""
    true, _ = homography.apply(after @ homography.invert(before), grid())
    here = ((true >= 0) & (true < SIZE_PX)).all(axis=1)
    found_px, _ = homography.apply(found, grid()[here])
    return found_px - true[here]


def follow(pictures: list[ImageArray], every: int = 1) -> list[CameraMotion | NoCameraMotion]:
    """Return the motion of every so manieth picture."""
    estimator = MotionEstimator()
    return [estimator.update(frame(pictures[index], index), NOTHING) for index in range(0, len(pictures), every)]
