"""Milliseconds per frame of following the picture, at 1080p and 4K, the luma already there; beside plain OpenCV."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from standoff.core.camera import Camera
from standoff.core.types import Detections, Frame, ImageArray
from standoff.stages.frames import frame_from_array
from standoff.stages.motion import MotionEstimator

FRAMES = 30
SIZES = {"1080p": (1920, 1080), "4K": (3840, 2160)}
NOTHING = Detections.empty()


def flight(size_px: tuple[int, int]) -> list[Frame]:
    """Return frames of rough ground under a camera that sways, their luma converted."""
    rng = np.random.default_rng(0)
    ground = cv2.resize(rng.normal(120.0, 30.0, (540, 960)).astype(np.float32), size_px, interpolation=cv2.INTER_CUBIC)
    frames = []
    for index in range(FRAMES):
        sway = np.array([[1.0, 1e-4 * index, 0.4 * index], [-1e-4 * index, 1.0, 0.2 * index], [1e-8 * index, 0.0, 1.0]])
        gray = cv2.warpPerspective(ground, sway, size_px) + rng.normal(0.0, 2.0, size_px[::-1])
        image: ImageArray = np.repeat(np.clip(gray, 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)
        frames.append(frame_from_array(image, index=index, time_s=index / 25))
        frames[-1].picture.gray()
    return frames


def lens(size_px: tuple[int, int]) -> Camera:
    matrix = np.array(
        [[0.7 * size_px[0], 0.0, size_px[0] / 2], [0.0, 0.7 * size_px[0], size_px[1] / 2], [0.0, 0.0, 1.0]]
    )
    return Camera(*size_px, matrix, np.array([-0.11, 0.01, 0.0, 0.0, 0.0]))


@pytest.mark.benchmark(group=f"motion, {FRAMES} frames")
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("with_lens", [False, True])
def test_standoff(benchmark: BenchmarkFixture, size: str, with_lens: bool) -> None:
    cv2.setNumThreads(1)
    frames = flight(SIZES[size])

    def follow() -> int:
        estimator = MotionEstimator(camera=lens(SIZES[size]) if with_lens else None)
        return sum(bool(estimator.update(frame, NOTHING)) for frame in frames)

    assert benchmark(follow) == FRAMES


@pytest.mark.benchmark(group=f"motion, {FRAMES} frames")
def test_opencv_alone_without_covariance_masks_or_keyframes(benchmark: BenchmarkFixture) -> None:
    cv2.setNumThreads(1)
    frames = flight(SIZES["1080p"])

    def follow() -> int:
        first, points, found = None, np.zeros((0, 1, 2), np.float32), 0
        for frame in frames:
            gray = cv2.resize(frame.picture.gray(), (960, 540), interpolation=cv2.INTER_AREA)
            if first is None:
                first, points = gray, cv2.goodFeaturesToTrack(gray, 112, 0.01, 30)
                last = points
                continue
            last, ahead, _ = cv2.calcOpticalFlowPyrLK(first, gray, points, last.copy(), flags=4, winSize=(15, 15))
            back, _, _ = cv2.calcOpticalFlowPyrLK(gray, first, last, points.copy(), flags=4, winSize=(15, 15))
            good = (ahead.ravel() == 1) & (np.linalg.norm(back - points, axis=2).ravel() < 0.5)
            found += cv2.findHomography(points[good], last[good], cv2.USAC_MAGSAC, 1.5)[0] is not None
        return found

    assert benchmark(follow) == FRAMES - 1
