"""Milliseconds of one core that motion and ground take for a frame with a reference, beside one Lucas-Kanade.

python -m pytest benchmarks/test_ground.py --benchmark-columns=min,median,iqr

The number in brackets is the ratio to the quickest of the group, the Lucas-Kanade of 112 points from one picture 960 px
wide to the next. Decoding is left out, what becomes of the decoder's luma is not.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import av
import cv2
import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from standoff.core.camera import Camera, CameraPrior
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.protocols import AnyMotion
from standoff.core.types import Detections, Frame, ImageArray
from standoff.stages.frames import AvPicture, Scaler
from standoff.stages.ground import FusedGround, Reference, ReferenceShape
from standoff.stages.motion import MotionEstimator

pytestmark = pytest.mark.benchmark(timer=time.process_time)

SIZES_PX = {"1080p": (1920, 1080), "4K": (3840, 2160)}
SHAPE = ReferenceShape.square(2.89)
HEIGHT_M = 0.5
FRAMES, ROUNDS = 12, 60
TEXEL_M = 0.05
LIT_TOP, LIT_SIDE = 205, 130


class Flight:
    """A drone that sways over a footing on rough ground, 30 m away, there and back for ever.

    Args:
        size_px: (width, height) of its pictures.
    """

    def __init__(self, size_px: tuple[int, int]) -> None:
        self._camera = Camera(
            *size_px,
            np.array([[0.71 * size_px[0], 0, size_px[0] / 2], [0, 0.71 * size_px[0], size_px[1] / 2], [0, 0, 1]]),
            np.zeros(5),
        )
        rng = np.random.default_rng(0)
        rough = cv2.GaussianBlur(rng.normal(0.0, 60.0, (4000, 4000)).astype(np.float32), (0, 0), 1.5)
        self._ground = np.clip(rough + 105.0, 0, 255).astype(np.uint8)
        self._noise = rng.normal(0.0, 2.0, size_px[::-1])
        self._views = [self._view(0.04 * index) for index in range(FRAMES)]
        self._decoded = [
            av.VideoFrame.from_ndarray(self._picture(view), format="gray").reformat(format="yuv420p")
            for view in self._views
        ]
        self._scaler = Scaler()

    @property
    def camera(self) -> CameraPrior:
        return CameraPrior.calibrated(self._camera)

    def _view(self, east_m: float) -> View:
        place_m = np.array([1.4 + east_m, -20.0, 22.0])
        return View.aimed(self._camera, place_m, heading_deg=3.0 + east_m, pitch_deg=45.0)

    def _picture(self, view: View) -> ImageArray:
        size_px = (self._camera.width_px, self._camera.height_px)
        to_ground = np.array([[TEXEL_M, 0, -2000 * TEXEL_M], [0, TEXEL_M, -2000 * TEXEL_M], [0, 0, 1]])
        picture = cv2.warpPerspective(self._ground, view.plane_to_pinhole() @ to_ground, size_px)
        for level in np.linspace(0.0, HEIGHT_M, 40):
            self._fill(picture, view, float(level), LIT_SIDE)
        self._fill(picture, view, HEIGHT_M, LIT_TOP)
        return np.asarray(np.clip(cv2.GaussianBlur(picture, (0, 0), 0.8) + self._noise, 0, 255), dtype=np.uint8)

    def _fill(self, picture: ImageArray, view: View, height_m: float, level: int) -> None:
        corners_px = view.project(np.column_stack([SHAPE.corners_m, np.full(4, height_m)]))
        cv2.fillConvexPoly(picture, np.rint(corners_px * 16).astype(np.int32), level, cv2.LINE_AA, 4)

    def box(self, view: View) -> FloatArray:
        heights = np.repeat([0.0, HEIGHT_M], 4)
        outline_px = view.project(np.column_stack([np.tile(SHAPE.corners_m, (2, 1)), heights]))
        return np.concatenate([outline_px.min(axis=0) - 4.0, outline_px.max(axis=0) + 4.0])

    def frames(self) -> Iterator[tuple[Frame, Detections]]:
        for index in range(10**6):
            at = abs((index + FRAMES - 1) % (2 * FRAMES - 2) - FRAMES + 1)
            found = Detections(self.box(self._views[at])[None], np.ones(1), np.array([CLASS_BY_NAME["reference"].id]))
            yield Frame("flight", index, index / 25.0, AvPicture(self._decoded[at], scaler=self._scaler)), found


@pytest.fixture(scope="module", params=SIZES_PX)
def flight(request: pytest.FixtureRequest) -> Flight:
    cv2.setNumThreads(1)
    return Flight(SIZES_PX[request.param])


def group(benchmark: BenchmarkFixture, flight: Flight) -> None:
    benchmark.group = f"a frame with the reference in sight, {flight.camera.camera.width_px} px wide"


def last_of(benchmark: BenchmarkFixture, rounds: int, act: Callable[..., Any], setup: Callable[[], Any]) -> Any:  # noqa: ANN401
    """Time `act` in frame after frame; what `setup` does is left out."""
    pedantic: Callable[..., Any] = benchmark.pedantic
    return pedantic(act, setup=setup, rounds=rounds, iterations=1, warmup_rounds=2)


def test_baseline_one_lucas_kanade_of_as_many_points(benchmark: BenchmarkFixture, flight: Flight) -> None:
    group(benchmark, flight)
    frames = flight.frames()
    before, now = (
        cv2.resize(next(frames)[0].picture.gray(), (960, 540), interpolation=cv2.INTER_AREA) for _ in range(2)
    )
    x, y = np.meshgrid(np.linspace(30, 930, 14), np.linspace(30, 510, 8))
    points = np.column_stack([x.ravel(), y.ravel()]).astype(np.float32)[:, None]
    follow: Callable[..., Any] = cv2.calcOpticalFlowPyrLK
    assert benchmark(lambda: follow(before, now, points, None, winSize=(15, 15), maxLevel=1)[1].mean()) > 0.9


def test_motion(benchmark: BenchmarkFixture, flight: Flight) -> None:
    group(benchmark, flight)
    estimator, frames = MotionEstimator(), flight.frames()
    estimator.update(*next(frames))
    assert last_of(benchmark, ROUNDS, estimator.update, lambda: (next(frames), {}))


def test_ground(benchmark: BenchmarkFixture, flight: Flight) -> None:
    group(benchmark, flight)
    estimator, frames = MotionEstimator(), flight.frames()
    ground = FusedGround([Reference(SHAPE, HEIGHT_M)], camera=flight.camera)

    def moved() -> tuple[tuple[Frame, Detections, AnyMotion], dict[str, object]]:
        frame, found = next(frames)
        return (frame, found, estimator.update(frame, found)), {}

    ground.update(*moved()[0])
    mapped = last_of(benchmark, ROUNDS, ground.update, moved)
    assert mapped and mapped.age_s == 0.0


def test_ground_the_first_frame(benchmark: BenchmarkFixture, flight: Flight) -> None:
    group(benchmark, flight)
    ground = FusedGround([Reference(SHAPE, HEIGHT_M)], camera=flight.camera)
    estimator, frames = MotionEstimator(), flight.frames()
    frame, found = next(frames)
    motion = estimator.update(frame, found)

    def anew() -> tuple[tuple[Frame, Detections, AnyMotion], dict[str, object]]:
        ground.reset()
        return (frame, found, motion), {}

    assert last_of(benchmark, 5, ground.update, anew)
