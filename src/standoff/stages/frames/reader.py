"""What a reader of one kind of source must offer, and the shots that it yields."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Protocol

from standoff.core.camera import CameraPrior
from standoff.core.errors import FrameSizeChanged
from standoff.core.telemetry import Telemetry
from standoff.core.types import Picture
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


def check_size(picture: Picture, size_px: tuple[int, int], label: str) -> None:
    """Raise FrameSizeChanged when a picture is not `size_px` (width, height)."""
    found_px = (picture.width_px, picture.height_px)
    if found_px != size_px:
        raise FrameSizeChanged(
            expected="pictures of {}x{} as at the start".format(*size_px),
            found="{}x{} at {}".format(*found_px, label),
            fix="give each size as a source of its own",
        )


class Reader(Protocol):
    """One kind of source, opened.

    Attributes:
        size_px: (width, height) of its first picture, upright.
        total_frames: How many pictures it says or is known to hold; None when it does not tell.
        rate_fps: Average pictures a second; 0 when unknown.
        started_at: Aware UTC time of the first picture, or None.
        rotation_deg: By how much its pictures are turned before they are shown.
        camera_prior: What it says of its camera.
        drone: The camera's model, if it says and it is known.
        warnings: What is odd about what it says, a clause each.
    """

    size_px: tuple[int, int]
    total_frames: int | None
    rate_fps: float
    started_at: datetime | None
    rotation_deg: int
    camera_prior: CameraPrior
    drone: DroneCamera | None
    warnings: tuple[str, ...]

    def shots(self, start_s: float, every: int) -> Iterator[Shot]:
        """Yield every `every`-th picture from the first one at or after `start_s`; called once.

        Raises:
            FrameSizeChanged: A picture has another size than `size_px`.
        """
        ...

    @property
    def description(self) -> Mapping[str, Any]:
        """What it is, for the record."""
        ...

    def close(self) -> None:
        """Let go of the file."""
        ...
