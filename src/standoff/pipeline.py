"""The stages called in order; nothing else."""

from __future__ import annotations

import logging
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from standoff.core.protocols import (
    CameraMotionEstimator,
    Detector,
    Ground,
    GroundWatcher,
    HazardMonitor,
    Locator,
    ProximityMeter,
    RestingDetector,
    Tracker,
)
from standoff.core.types import Detections, Frame, FrameResult, Hazard, Outcome, Proximities, Sink
from standoff.core.unfollowed import SURE_SCORE, unfollowed

_LOG = logging.getLogger(__name__)

_AHEAD_S = 1.0
"""A gap that closes counts as what it will be then."""


@contextmanager
def _clocked(stage_ms: dict[str, float], stage: str) -> Iterator[None]:
    start_s = perf_counter()
    yield
    stage_ms[stage] = (perf_counter() - start_s) * 1e3


@dataclass
class Pipeline:
    """One stream's stages and their state.

    Attributes:
        frames: The source.
        detector: Runs on every `detect_every`-th frame, unless it rests there; tracks coast in between. While a pair
            is near, or may be, it runs on every frame (`detect_near_m`).
        motion: Reads every frame.
        ground: Reads every frame.
        sure_score: What the detector is so sure of has to be in a track.
        sinks: By name. One that fails is logged and left out from then on; the others go on.
        sink_errors: Message of each sink that failed.
    """

    frames: Iterable[Frame]
    detector: Detector
    motion: CameraMotionEstimator
    ground: Ground
    tracker: Tracker
    locator: Locator
    watcher: GroundWatcher
    proximity: ProximityMeter
    hazard: HazardMonitor
    sinks: Mapping[str, Sink] = field(default_factory=dict)
    detect_every: int = 1
    detect_near_m: float | None = None
    sure_score: float = SURE_SCORE
    sink_errors: dict[str, str] = field(default_factory=dict)

    def run(self) -> Generator[FrameResult, None, None]:
        """Yield each frame's result after the sinks have it; close the sinks however the run ends."""
        outcome, time_s, count, near = Outcome("complete"), 0.0, 0, False
        try:
            frames = iter(self.frames)
            while True:
                stage_ms: dict[str, float] = {}
                with _clocked(stage_ms, "frames"):
                    frame = next(frames, None)
                if frame is None:
                    break
                time_s = frame.time_s
                result = self.step(frame, stage_ms, detect=near or count % self.detect_every == 0)
                self._write(result, stage_ms)
                count, near = count + 1, self._is_near(result.proximities)
                yield result
        except (KeyboardInterrupt, GeneratorExit):
            outcome = Outcome("interrupted", "stopped before the end of the source")
            raise
        except BaseException as error:
            outcome = Outcome("failed", str(error) or type(error).__name__)
            raise
        finally:
            hazards: tuple[Hazard, ...] = ()
            try:
                hazards = self.hazard.close(time_s)
            finally:
                self._close(outcome, hazards)

    def step(self, frame: Frame, stage_ms: dict[str, float], *, detect: bool = True) -> FrameResult:
        """Take one frame through all stages; add each stage's milliseconds to `stage_ms`."""
        detections = Detections.empty()
        if detect and isinstance(self.detector, RestingDetector):
            detect = not self.detector.rests(frame)
        if detect:
            with _clocked(stage_ms, "detect"):
                detections = self.detector.detect(frame)
        with _clocked(stage_ms, "motion"):
            motion = self.motion.update(frame, detections)
        with _clocked(stage_ms, "ground"):
            ground = self.ground.update(frame, detections, motion)
        with _clocked(stage_ms, "track"):
            tracks = (
                self.tracker.update(frame.time_s, detections, motion, ground)
                if detect
                else self.tracker.coast(frame.time_s, motion)
            )
            lost = unfollowed(detections, tracks, self.sure_score)
        with _clocked(stage_ms, "locate"):
            positions = self.locator.update(frame.time_s, tracks, ground)
        with _clocked(stage_ms, "watched"):
            watched = self.watcher.update(frame, ground, tracks, positions)
        with _clocked(stage_ms, "proximity"):
            proximities = self.proximity.update(frame.time_s, positions, ground)
        with _clocked(stage_ms, "hazard"):
            hazards = self.hazard.update(frame.time_s, positions, proximities, ground, lost, watched)
        return FrameResult(
            frame, detections, detect, motion, ground, tracks, positions, proximities, hazards, stage_ms, lost, watched
        )

    def _is_near(self, proximities: Proximities) -> bool:
        """Return whether a gap is, or within a second will be, below `detect_near_m`, where the rhythm asks for it."""
        if self.detect_every == 1 or self.detect_near_m is None:
            return False
        soon_m = proximities.gap_m - np.maximum(np.nan_to_num(proximities.closing_mps), 0.0) * _AHEAD_S
        # A pair that is not measured may be near.
        return not bool((soon_m >= self.detect_near_m).all())

    def _write(self, result: FrameResult, stage_ms: dict[str, float]) -> None:
        for name, sink in self.sinks.items():
            if name in self.sink_errors:
                continue
            with _clocked(stage_ms, f"sinks.{name}"):
                try:
                    sink.write(result)
                except Exception as error:  # noqa: BLE001 - a full disk must not stop the monitoring
                    self._give_up(name, error)

    def _close(self, outcome: Outcome, hazards: tuple[Hazard, ...]) -> None:
        for name, sink in self.sinks.items():
            try:
                sink.close(Outcome(outcome.status, outcome.message, hazards, dict(self.sink_errors)))
            except Exception as error:  # noqa: BLE001 - the other outputs must still be finished
                self._give_up(name, error)

    def _give_up(self, name: str, error: Exception) -> None:
        if name not in self.sink_errors:
            _LOG.error("output %s stopped: %s", name, error)
        self.sink_errors.setdefault(name, str(error) or type(error).__name__)
