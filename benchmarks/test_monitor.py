"""Milliseconds of one core that the monitor's own work takes a frame, 1080p and ten tracks; and parts of it.

python -m pytest benchmarks/test_monitor.py --benchmark-columns=min,median,iqr

Own work is all that is neither decoding, inference, motion, the ground map nor encoding. The baseline is in the same
run: on a busy machine the ratio to it says more than the milliseconds.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from standoff.core import homography, protocols
from standoff.core.camera import Camera
from standoff.core.protocols import AnyGround, AnyMotion
from standoff.core.types import Detections, Frame, GroundMap, Tracks
from standoff.evaluation.bench_workload import BenchSite, SiteFilm, workload_sinks
from standoff.monitor import Monitor, Run
from standoff.stages.hazard import HazardMonitor
from standoff.stages.locate import Locator
from standoff.stages.motion import MotionEstimator
from standoff.stages.proximity import ProximityMeter, ProximityParams
from standoff.stages.track import Tracker
from standoff.stages.watched import GroundWatcher

pytestmark = pytest.mark.benchmark(timer=time.process_time)

SIZE_PX = (1920, 1080)
OWN_WORK_FRAMES, OWN_WORK_WARM_UP = 240, 40
FRAME_S = 1.0 / 30.0
WARM_UP_FRAMES = 60
CORNERS_PX = np.array([[700.0, 500.0], [1250.0, 520.0], [1400.0, 900.0], [560.0, 880.0]])
CORNERS_M = np.array([[0.0, 12.0], [12.0, 12.0], [12.0, 0.0], [0.0, 0.0]])
MATRIX = np.array([[1500.0, 0.0, 959.5], [0.0, 1500.0, 539.5], [0.0, 0.0, 1.0]])


def ground_map(camera: Camera | None) -> GroundMap:
    matrix = homography.fit(CORNERS_PX, CORNERS_M)
    covariance = homography.fit_covariance(matrix, CORNERS_PX, np.tile(np.eye(2), (4, 1, 1)))
    polygon = np.array([[0.0, 300.0], [1920.0, 300.0], [1920.0, 1080.0], [0.0, 1080.0]])
    return GroundMap(matrix, covariance, SIZE_PX, "four corners", 0.02, valid_px=polygon, camera=camera)


def ten_tracks() -> Tracks:
    """Return six workers and four machines spread over the picture."""
    rng = np.random.default_rng(0)
    foot = np.column_stack([rng.uniform(200, 1700, 10), rng.uniform(500, 950, 10)])
    boxes = np.column_stack([foot - np.array([20.0, 80.0]), foot + np.array([20.0, 0.0])])
    class_id = np.array([0] * 6 + [1, 2, 3, 4])
    return Tracks(np.arange(1, 11), boxes, np.ones(10), class_id, np.ones(10, dtype=np.bool_), np.ones(10))


@pytest.mark.parametrize("pairs", [(("worker", "equipment"),), (("any", "any"),)], ids=["24 pairs", "45 pairs"])
@pytest.mark.parametrize("map_kind", ["fixed", "new each frame", "new each frame, lens"])
def test_one_frame_from_tracks_to_hazards(
    benchmark: Callable[..., Any], map_kind: str, pairs: tuple[tuple[str, str], ...]
) -> None:
    lens = np.array([-0.12, 0.03, 0.001, -0.0008, 0.0])
    camera = Camera(*SIZE_PX, MATRIX, lens) if map_kind.endswith("lens") else None
    grounds = [ground_map(camera) for _ in range(1 if map_kind == "fixed" else 2)]
    locator, meter, monitor = Locator(), ProximityMeter(ProximityParams(pairs=pairs)), HazardMonitor()
    tracks = ten_tracks()
    frame, followed = 0, np.zeros(1, dtype=np.bool_)

    def one_frame() -> int:
        nonlocal frame
        frame += 1
        time_s, ground = frame * FRAME_S, grounds[frame % len(grounds)]
        positions = locator.update(time_s, tracks, ground)
        proximities = meter.update(time_s, positions, ground)
        monitor.update(time_s, positions, proximities, ground, followed)
        return len(proximities)

    for _ in range(WARM_UP_FRAMES):
        one_frame()
    assert benchmark(one_frame) == (45 if pairs == (("any", "any"),) else 24)


class KnownBefore(protocols.Source, protocols.Detector):
    """What detector, motion and ground say of each frame of a site, worked out in advance.

    Args:
        site: What they see.
        frames: How many.
    """

    def __init__(self, site: BenchSite, frames: int) -> None:
        self._site, self._frames = site, list(SiteFilm(site, frames).frames())
        self._detections: list[Detections] = [site.detections(frame.index) for frame in self._frames]
        motion, ground = MotionEstimator(), site.ground("surveyed")
        seen = list(zip(self._frames, self._detections, strict=True))
        self._motions: list[AnyMotion] = [motion.update(frame, detections) for frame, detections in seen]
        self._maps: list[AnyGround] = [
            ground.update(*one, moved) for one, moved in zip(seen, self._motions, strict=True)
        ]

    @property
    def size_px(self) -> tuple[int, int]:
        return self._site.size_px

    def frames(self) -> Iterator[Frame]:
        return iter(self._frames)

    def close(self) -> None:
        pass

    def detect(self, frame: Frame) -> Detections:
        return self._detections[frame.index]

    def motion_of(self, frame: Frame, detections: Detections) -> AnyMotion:
        return self._motions[frame.index]

    def map_of(self, frame: Frame, detections: Detections, motion: AnyMotion) -> AnyGround:
        return self._maps[frame.index]


class Moving(protocols.CameraMotionEstimator):
    """Says the motion that is known before."""

    def __init__(self, known: KnownBefore) -> None:
        self._known = known

    def update(self, frame: Frame, detections: Detections) -> AnyMotion:
        return self._known.motion_of(frame, detections)


class Mapped(protocols.Ground):
    """Says the map that is known before."""

    def __init__(self, known: KnownBefore) -> None:
        self._known = known

    def update(self, frame: Frame, detections: Detections, motion: AnyMotion) -> AnyGround:
        return self._known.map_of(frame, detections, motion)


@pytest.mark.parametrize("film", [False, True], ids=["no film", "film"])
def test_own_work_of_a_frame(benchmark: BenchmarkFixture, tmp_path: Path, film: bool) -> None:
    benchmark.group = "own work"
    cv2.setNumThreads(1)
    known = KnownBefore(BenchSite(SIZE_PX, 10), OWN_WORK_FRAMES)
    monitor = Monitor(
        detector=known,
        motion=Moving(known),
        ground=Mapped(known),
        tracker=Tracker(),
        locator=Locator(),
        watcher=GroundWatcher(),
        proximity=ProximityMeter(),
        hazard=HazardMonitor(),
    )
    run = iter(Run(known, monitor, workload_sinks(tmp_path, film=film)))
    take: Callable[..., Any] = benchmark.pedantic
    result = take(lambda: next(run), rounds=OWN_WORK_FRAMES - OWN_WORK_WARM_UP, warmup_rounds=OWN_WORK_WARM_UP)
    assert len(result.tracks) == 10


def test_baseline_halving_the_picture_with_opencv(benchmark: BenchmarkFixture) -> None:
    benchmark.group = "own work"
    cv2.setNumThreads(1)
    picture = BenchSite(SIZE_PX, 10).picture()
    assert benchmark(lambda: cv2.resize(picture, (960, 540), interpolation=cv2.INTER_AREA)).shape == (540, 960, 3)
