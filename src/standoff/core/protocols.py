"""The whole contract: what a source, each stage and each sink must be able to do to stand in a monitor.

A class that derives from one of these inherits what it does not need of its own: it says nothing of itself, takes every
picture size, and has nothing to forget. `missing_of` tells what another class lacks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final, Protocol, runtime_checkable

from standoff.core.homography import BoolArray
from standoff.core.types import (
    CameraMotion,
    Detections,
    Frame,
    FrameResult,
    GroundMap,
    GroundPositions,
    Hazard,
    NoCameraMotion,
    NoGroundMap,
    Outcome,
    Proximities,
    Silence,
    Tracks,
    WatchedGround,
)

AnyGround = GroundMap | NoGroundMap
AnyMotion = CameraMotion | NoCameraMotion

EACH_ALONE: Final = "each_frame_alone"
"""In a detector's description, where it is true: what it sees in a frame depends on that frame and on nothing before
it. Only then may frames be looked at in another order, on another machine, or not again after a power cut."""

_NOTHING: Mapping[str, Any] = {}


@runtime_checkable
class Described(Protocol):
    """Something that has a word on itself in the record of a run."""

    def describe(self) -> Mapping[str, Any]:
        """Return what there is to say of it so far; `warnings` in it are clauses for people.

        A run asks at its start and again at its end: what was lost or seen meanwhile is known only then.
        """
        return _NOTHING


@runtime_checkable
class Source(Described, Protocol):
    """Where frames come from; nothing is opened before the first question, which raises what is wrong with it."""

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of every frame; opens what is not open yet."""
        ...

    @property
    def frame_count(self) -> int | None:
        """How many frames it should yield; None where it does not tell."""
        return None

    def frames(self) -> Iterator[Frame]:
        """Yield frames in the order of their time; once."""
        ...

    def close(self) -> None:
        """Let go of what is open; frames already yielded stay valid."""
        ...


@runtime_checkable
class Stage(Described, Protocol):
    """One step from a frame to a hazard; all its state belongs to one stream."""

    def prepare(self, size_px: tuple[int, int]) -> None:
        """Take the (width, height) of the stream's pictures, before the first of them.

        Raises:
            StandoffError: It cannot work on them.
        """
        return None

    def reset(self) -> None:
        """Forget all that was seen of the stream; what was set stays."""
        return None


@runtime_checkable
class Detector(Stage, Protocol):
    """Find entities in a picture."""

    def detect(self, frame: Frame) -> Detections:
        """Return what is seen, in full-size picture pixels and the site's classes."""
        ...

    def rests(self, frame: Frame) -> bool:
        """Tell whether it has nothing to say of this frame, which is not the same as seeing nothing there."""
        return False


@runtime_checkable
class CameraMotionEstimator(Stage, Protocol):
    """Find out how the picture of the ground moved."""

    def update(self, frame: Frame, detections: Detections) -> AnyMotion:
        """Return the motion since a keyframe, or the reason why there is none.

        `detections` are of this frame, so that what moves by itself can be left out; empty where the detector rested.
        """
        ...


@runtime_checkable
class Ground(Stage, Protocol):
    """Find out where a pixel stands on the ground."""

    def update(self, frame: Frame, detections: Detections, motion: AnyMotion) -> AnyGround:
        """Return the frame's map, or the reason why there is none."""
        ...


@runtime_checkable
class Tracker(Stage, Protocol):
    """Follow entities over time."""

    def update(self, time_s: float, detections: Detections, motion: AnyMotion, ground: AnyGround) -> Tracks:
        """Return the live tracks after a frame on which the detector ran."""
        ...

    def coast(self, time_s: float, motion: AnyMotion) -> Tracks:
        """Return the live tracks, all predicted, at a frame on which the detector rested."""
        ...


@runtime_checkable
class Locator(Stage, Protocol):
    """Place tracks on the ground."""

    def update(self, time_s: float, tracks: Tracks, ground: AnyGround) -> GroundPositions:
        """Return one row for each track, invalid ones included."""
        ...


@runtime_checkable
class GroundWatcher(Stage, Protocol):
    """Judge which of the ground is watched."""

    def update(
        self, frame: Frame, detections: Detections, ground: AnyGround, tracks: Tracks, positions: GroundPositions
    ) -> WatchedGround:
        """Return what would be found where in this frame; `detections` are empty where the detector rested."""
        ...


@runtime_checkable
class ProximityMeter(Stage, Protocol):
    """Measure how close entities are."""

    def update(self, time_s: float, positions: GroundPositions, ground: AnyGround) -> Proximities:
        """Return one row for each configured pair, unmeasured ones included."""
        ...


@runtime_checkable
class HazardMonitor(Stage, Protocol):
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

    def lose(self, time_s: float, reason: str) -> tuple[Hazard, ...]:
        """Return the last events of a stream that was lost: what was open is unknown from now on, not over."""
        ...


@runtime_checkable
class Sink(Protocol):
    """Something that writes results down."""

    def write(self, result: FrameResult) -> None:
        """Take one frame's result."""
        ...

    def close(self, outcome: Outcome) -> None:
        """Finish what was written; called once, also after an interruption."""
        ...


@runtime_checkable
class LiveSink(Sink, Protocol):
    """A sink that is also told when nothing arrives."""

    def tell(self, silence: Silence) -> None:
        """Take that a stream says nothing."""
        ...


def missing_of(part: object, contract: type) -> list[str]:
    """Return which methods and properties of a contract something lacks, by name.

    >>> missing_of(object(), Sink)
    ['close', 'write']
    """
    names = {name for base in contract.__mro__ for name in vars(base) if not name.startswith("_")}
    own = getattr(part, "__dict__", {})
    return sorted(name for name in names if not hasattr(type(part), name) and name not in own)
