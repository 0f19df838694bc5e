"""The stages called in order; nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Lock
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
    Stage,
    Tracker,
)
from standoff.core.run_counts import RunCounts
from standoff.core.types import (
    Detections,
    Frame,
    FrameResult,
    Hazard,
    NoGroundMap,
    OpenHazards,
    Proximities,
    Silence,
    Tracks,
    WatchedGround,
)
from standoff.core.unfollowed import SURE_SCORE, unfollowed

_AHEAD_S = 1.0
"""A gap that closes counts as what it will be then."""


@dataclass(frozen=True, slots=True)
class Seen:
    """What the detector saw in a frame, and how long it looked.

    Attributes:
        detections: All of it.
        stage_ms: Milliseconds, by stage.
    """

    detections: Detections
    stage_ms: Mapping[str, float]


@dataclass
class Monitor:
    """One stream's stages and what they know of it: neither where frames come from nor where results go.

    Attributes:
        detector: Runs on every `detect_every`-th frame, unless it rests there; tracks coast in between. While a pair
            is near, or may be, it runs on every frame (`detect_near_m`).
        motion: Reads every frame.
        ground: Reads every frame.
        sure_score: What the detector is so sure of has to be in a track.
        counts: What happened so far.
        open_hazards: Which hazards are open now.
    """

    detector: Detector
    motion: CameraMotionEstimator
    ground: Ground
    tracker: Tracker
    locator: Locator
    watcher: GroundWatcher
    proximity: ProximityMeter
    hazard: HazardMonitor
    detect_every: int = 1
    detect_near_m: float | None = None
    sure_score: float = SURE_SCORE
    counts: RunCounts = field(default_factory=RunCounts)
    open_hazards: OpenHazards = field(default_factory=OpenHazards)
    _last: FrameResult | None = None
    _is_near: bool = False
    _looking: Lock = field(default_factory=Lock)

    @property
    def stages(self) -> dict[str, Stage]:
        """All stages by name, in the order in which they are called."""
        return {
            "detect": self.detector,
            "motion": self.motion,
            "ground": self.ground,
            "track": self.tracker,
            "locate": self.locator,
            "watched": self.watcher,
            "proximity": self.proximity,
            "hazard": self.hazard,
        }

    def prepare(self, size_px: tuple[int, int]) -> None:
        """Let every stage look at the (width, height) of the stream's pictures, before the first of them.

        Raises:
            StandoffError: A stage cannot work on them.
        """
        for stage in self.stages.values():
            stage.prepare(size_px)

    def looks_at(self, number: int, frame: Frame, *, near: bool = False) -> bool:
        """Return whether the detector runs on the `number`-th frame of the stream, from 0; `near`: somebody is."""
        return (near or number % self.detect_every == 0) and not self.detector.rests(frame)

    def look(self, frame: Frame) -> Seen:
        """Let the detector look at a frame: before `step`, perhaps in another thread."""
        stage_ms: dict[str, float] = {}
        with self._looking, clocked(stage_ms, "detect"):
            detections = self.detector.detect(frame)
        return Seen(detections, stage_ms)

    def step(self, frame: Frame, seen: Seen | None = None) -> FrameResult:
        """Take one frame through all stages.

        Args:
            frame: In the order of time.
            seen: What `look` found in it, where somebody looked already.
        """
        if seen is None and self.looks_at(self.counts.rows["frames"], frame, near=self._is_near):
            seen = self.look(frame)
        detected = seen is not None
        detections = Detections.empty() if seen is None else seen.detections
        stage_ms = {} if seen is None else dict(seen.stage_ms)
        with clocked(stage_ms, "motion"):
            motion = self.motion.update(frame, detections)
        with clocked(stage_ms, "ground"):
            ground = self.ground.update(frame, detections, motion)
        with clocked(stage_ms, "track"):
            tracks = (
                self.tracker.update(frame.time_s, detections, motion, ground)
                if detected
                else self.tracker.coast(frame.time_s, motion)
            )
            lost = unfollowed(detections, tracks, self.sure_score)
        with clocked(stage_ms, "locate"):
            positions = self.locator.update(frame.time_s, tracks, ground)
        with clocked(stage_ms, "watched"):
            watched = self.watcher.update(frame, detections, ground, tracks, positions)
        with clocked(stage_ms, "proximity"):
            proximities = self.proximity.update(frame.time_s, positions, ground)
        with clocked(stage_ms, "hazard"):
            hazards = self.hazard.update(frame.time_s, positions, proximities, ground, lost, watched)
        self.open_hazards = self.open_hazards.after(hazards)
        self._last = FrameResult(
            frame=frame,
            detections=detections,
            detected=detected,
            motion=motion,
            ground=ground,
            tracks=tracks,
            positions=positions,
            proximities=proximities,
            hazards=hazards,
            stage_ms=stage_ms,
            unfollowed=lost,
            watched=watched,
            open_hazards=self.open_hazards,
        )
        self.counts.add(self._last)
        self._is_near = self._are_near(proximities)
        return self._last

    def tick(self, time_s: float, reason: str, stream_id: str = "") -> Silence:
        """Take that nothing arrives: nobody's place is known, and what is open becomes unknown.

        Args:
            time_s: When, in the stream's presentation time.
            reason: Why nothing arrives.
            stream_id: For a stream of which no frame came yet.
        """
        last, ground = self._last, NoGroundMap(reason)
        # To whoever locates and measures it is a moment without a map, in which everybody was there still.
        positions = self.locator.update(time_s, Tracks.empty() if last is None else last.tracks, ground)
        pairs = self.proximity.update(time_s, positions, ground)
        hazards = self.hazard.update(time_s, positions, pairs, ground, np.zeros(0, dtype=np.bool_), WatchedGround())
        self._note(hazards)
        return Silence(stream_id if last is None else last.frame.stream_id, time_s, reason, hazards, self.open_hazards)

    def resume(self) -> None:
        """Take that the next picture comes after a gap: whoever is seen then is followed anew.

        The map is kept: whether the picture still shows the same ground is found out from the picture.
        """
        for stage in (self.tracker, self.locator, self.proximity):
            stage.reset()
        self._is_near = False

    def close(self, time_s: float, *, lost: str = "") -> tuple[Hazard, ...]:
        """End the stream and return what is said last: of what is open, that it closes, or that it is unknown.

        Args:
            time_s: When, in the stream's presentation time.
            lost: Why the stream ended before it should have; empty where it came to its end.
        """
        hazards = self.hazard.lose(time_s, lost) if lost else self.hazard.close(time_s)
        self._note(hazards)
        return hazards

    def _note(self, hazards: tuple[Hazard, ...]) -> None:
        self.open_hazards = self.open_hazards.after(hazards)
        self.counts.add_events(hazards)

    def _are_near(self, proximities: Proximities) -> bool:
        """Return whether a gap is, or within a second will be, below `detect_near_m`, where the rhythm asks for it."""
        if self.detect_every == 1 or self.detect_near_m is None:
            return False
        soon_m = proximities.gap_m - np.maximum(np.nan_to_num(proximities.closing_mps), 0.0) * _AHEAD_S
        # A pair that is not measured may be near.
        return not bool((soon_m >= self.detect_near_m).all())


@contextmanager
def clocked(stage_ms: dict[str, float], stage: str) -> Iterator[None]:
    """Write down how many milliseconds something takes."""
    start_s = perf_counter()
    yield
    stage_ms[stage] = (perf_counter() - start_s) * 1e3
