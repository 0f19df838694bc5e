"""Settings of a source."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Ge, Gt
from typing_extensions import Doc


@dataclass(frozen=True, slots=True)
class SourceParams:
    """Which part of a source is read, and how."""

    start_s: Annotated[float, Ge(0), Doc("Begin with the first picture at or after this time; s.")] = 0.0
    stop_s: Annotated[
        float | None, Gt(0), Doc("End before the first picture at or after this time; s. Absent: the source's end.")
    ] = None
    every: Annotated[int, Ge(1), Doc("Read every k-th picture only, the first one included.")] = 1
    fps: Annotated[
        float | None,
        Gt(0),
        Doc(
            "Pictures a second of a folder, which has no clock. Of a video it replaces the timestamps: only where they "
            "are missing or wrong."
        ),
    ] = None
    telemetry: Annotated[
        Literal["none"] | Path | None,
        Doc(
            "The drone's log (SubRip), or none. Absent: the log beside the film (`film.srt`, or `telemetry.srt` in its "
            "folder), or the pictures' EXIF data."
        ),
    ] = None
