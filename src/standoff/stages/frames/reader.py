"""What a reader of one kind of source must offer, which part of it is wanted, and the shots that it yields."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, NamedTuple, Protocol

from standoff.core.camera import CameraPrior
from standoff.core.errors import FrameSizeChanged, SourceError
from standoff.core.telemetry import Telemetry
from standoff.core.types import Picture
from standoff.files.orientation import Orientation
from standoff.stages.frames.drone_cameras import DroneCamera

TIME_ROUNDING_S = 1e-6
"""A picture this little before a limit counts as on it: 0.3 s in floating point lies beyond 3 ticks of 0.1 s."""


@dataclass(frozen=True, slots=True)
class Shot:
    """One picture of a source.

    Attributes:
        index: Position in the source, counting every picture.
        time_s: Seconds from the first picture.
        picture: The pixels.
        label: What an operator would call it ("frame 30", "0031.jpg").
        telemetry: What the picture says of the moment itself; None: nothing.
    """

    index: int
    time_s: float
    picture: Picture
    label: str
    telemetry: Telemetry | None = None


class Selection(NamedTuple):
    """Which part of a source is wanted.

    Attributes:
        start_s: First moment, seconds from the first picture.
        stop_s: Moment before which it ends; None: the end.
        every: 1: every picture from the start on, 2: every second one, ...
    """

    start_s: float = 0.0
    stop_s: float | None = None
    every: int = 1

    def expected_of(self, total_frames: int | None, rate_fps: float) -> int | None:
        """Return how many of a source's pictures are wanted, or None when that cannot be told.

        Exact at a constant rate, an estimate at a variable one.

        >>> Selection(start_s=1.0, stop_s=2.0, every=3).expected_of(100, 10.0)
        4
        """
        if total_frames is None:
            return None
        first, last = 0, total_frames
        if self.start_s > 0 or self.stop_s is not None:
            if rate_fps <= 0:
                return None
            first, last = self.first_index(rate_fps), self.end_index(total_frames, rate_fps)
        return math.ceil(max(0, last - first) / self.every)

    def first_index(self, rate_fps: float) -> int:
        """Return the index of the first picture that is wanted, at a constant rate."""
        return max(0, math.ceil((self.start_s - TIME_ROUNDING_S) * rate_fps))

    def end_index(self, total_frames: int, rate_fps: float) -> int:
        """Return the index of the first picture that is not wanted any more, at a constant rate."""
        if self.stop_s is None:
            return total_frames
        return min(total_frames, math.ceil((self.stop_s - TIME_ROUNDING_S) * rate_fps))

    def check(self) -> None:
        """Raise SourceError for a part that no source can have."""
        if not (math.isfinite(self.start_s) and self.start_s >= 0):
            raise SourceError(
                expected="a start of 0 s or later", found=f"{self.start_s} s", fix="give seconds from the first picture"
            )
        if self.stop_s is not None and not self.stop_s > self.start_s:
            raise SourceError(
                expected=f"a stop after the start ({self.start_s} s)", found=f"{self.stop_s} s", fix="give a later stop"
            )
        if self.every < 1:
            raise SourceError(expected="every 1 or more", found=str(self.every), fix="give 1 for every picture")


def check_size(picture: Picture, size_px: tuple[int, int], label: str) -> None:
    """Raise FrameSizeChanged when a picture is not `size_px` (width, height)."""
    found_px = (picture.width_px, picture.height_px)
    if found_px != size_px:
        raise size_changed(size_px, "{}x{} at {}".format(*found_px, label))


def size_changed(size_px: tuple[int, int], found: str) -> FrameSizeChanged:
    """Return the error for pictures of another size than the first (width, height)."""
    return FrameSizeChanged(
        expected="pictures of {}x{} as at the start".format(*size_px),
        found=found,
        fix="give each size as a source of its own",
    )


class Reader(Protocol):
    """One kind of source, opened.

    Attributes:
        size_px: (width, height) of its first picture, upright.
        total_frames: How many pictures it says or is known to hold; None when it does not tell.
        rate_fps: Average pictures a second; 0 when unknown.
        started_at: Aware UTC time of the first picture, or None.
        orientation: How its stored pictures are turned and mirrored before they are shown, where all are alike.
        camera_prior: What it says of its camera.
        drone: The camera's model, if it says and it is known.
    """

    size_px: tuple[int, int]
    total_frames: int | None
    rate_fps: float
    started_at: datetime | None
    orientation: Orientation
    camera_prior: CameraPrior
    drone: DroneCamera | None

    def shots(self, wanted: Selection) -> Iterator[Shot]:
        """Yield the pictures that are wanted, and perhaps some after their stop; called once.

        Raises:
            FrameSizeChanged: A picture has another size than `size_px`.
        """
        ...

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is odd about what it says, and about what was read of it so far, a clause each."""
        ...

    def describe(self) -> Mapping[str, Any]:
        """Return what it is, for the record."""
        ...

    def close(self) -> None:
        """Let go of the file."""
        ...
