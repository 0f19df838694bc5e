"""What each stage must be able to do to stand in the pipeline; a replacement needs nothing more."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from standoff.core.homography import BoolArray
from standoff.core.types import (
    CameraMotion,
    Detections,
    Frame,
    GroundMap,
    GroundPositions,
    Hazard,
    NoCameraMotion,
    NoGroundMap,
    Proximities,
    Tracks,
    WatchedGround,
)

AnyGround = GroundMap | NoGroundMap
AnyMotion = CameraMotion | NoCameraMotion


class Detector(Protocol):
    """Find entities in a picture."""

    def detect(self, frame: Frame) -> Detections:
        """Return what is seen, in full-size picture pixels and the site's classes."""
        ...


@runtime_checkable
class RestingDetector(Detector, Protocol):
    """A detector that has nothing to say of some frames, which is not the same as seeing nothing there."""

    def rests(self, frame: Frame) -> bool:
        """Tell whether tracks must coast at this frame, whatever `detect_every` is."""
        ...


class CameraMotionEstimator(Protocol):
    """Find out how the picture of the ground moved."""

    def update(self, frame: Frame, detections: Detections) -> AnyMotion:
        """Return the motion since a keyframe, or the reason why there is none.

        `detections` are of this frame, so that what moves by itself can be left out; empty where the detector rested.
        """
        ...


class Ground(Protocol):
    """Find out where a pixel stands on the ground."""

    def update(self, frame: Frame, detections: Detections, motion: AnyMotion) -> AnyGround:
        """Return the frame's map, or the reason why there is none."""
        ...


class Tracker(Protocol):
    """Follow entities over time."""

    def update(self, time_s: float, detections: Detections, motion: AnyMotion, ground: AnyGround) -> Tracks:
        """Return the live tracks after a frame on which the detector ran."""
        ...

    def coast(self, time_s: float, motion: AnyMotion) -> Tracks:
        """Return the live tracks, all predicted, at a frame on which the detector rested."""
        ...


class Locator(Protocol):
    """Place tracks on the ground."""

    def update(self, time_s: float, tracks: Tracks, ground: AnyGround) -> GroundPositions:
        """Return one row for each track, invalid ones included."""
        ...


class GroundWatcher(Protocol):
    """Judge which of the ground is watched."""

    def update(self, frame: Frame, ground: AnyGround, tracks: Tracks, positions: GroundPositions) -> WatchedGround:
        """Return what would be found where in this frame."""
        ...


class ProximityMeter(Protocol):
    """Measure how close entities are."""

    def update(self, time_s: float, positions: GroundPositions, ground: AnyGround) -> Proximities:
        """Return one row for each configured pair, unmeasured ones included."""
        ...


class HazardMonitor(Protocol):
    """Decide when somebody is in danger."""

    def update(
        self,
        time_s: float,
        positions: GroundPositions,
        proximities: Proximities,
        ground: AnyGround,
        unfollowed: BoolArray,
        watched: WatchedGround,
    ) -> tuple[Hazard, ...]:
        """Return the events of this frame; `unfollowed` (K,) tells which of its sure detections no track shows."""
        ...

    def close(self, time_s: float) -> tuple[Hazard, ...]:
        """Return the closing events at the end of the stream."""
        ...
