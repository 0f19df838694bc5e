"""Which telemetry a source uses: the file that is asked for, the one beside the film, the pictures' own, or none."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from standoff.core.camera import CameraPrior
from standoff.core.errors import SourceError
from standoff.core.telemetry import Telemetry
from standoff.stages.frames.flight_log import FlightLog, log_beside, read_flight_log
from standoff.stages.frames.prior import told_prior
from standoff.stages.frames.reader import Reader, Shot

NO_TELEMETRY = "none"


@dataclass(frozen=True, slots=True)
class TelemetryChoice:
    """Where a source's telemetry comes from.

    Attributes:
        log: The drone's log; None: none.
        own: Whether pictures' own data are used where there is no log.
        warnings: Where it does not fit the source.
    """

    log: FlightLog | None = None
    own: bool = True
    warnings: tuple[str, ...] = ()

    def at(self, shot: Shot) -> Telemetry | None:
        """Return the readings for a picture."""
        if self.log is not None:
            return self.log.at(shot.time_s)
        return shot.telemetry if self.own else None

    def camera_prior(self, reader: Reader) -> CameraPrior:
        """Return the best that is known of the camera."""
        if self.log is None or self.log.is_zoomed_digitally:
            return reader.camera_prior if self.log is None else CameraPrior.unknown(*reader.size_px)
        told = self.log.told_focal_mm_35()
        if not len(told):
            return reader.camera_prior
        return told_prior(reader.size_px, told, reader.drone, self.log.name, film=True)

    def describe(self) -> dict[str, Any]:
        """Return what it is, for the record."""
        if self.log is not None:
            return self.log.describe()
        return {"origin": "EXIF and XMP of the pictures, where they have any" if self.own else NO_TELEMETRY}


def choose_telemetry(reader: Reader, path: Path, wanted: str | PathLike[str] | None) -> TelemetryChoice:
    """Find the telemetry of an opened source.

    Args:
        reader: The source.
        path: Where it is.
        wanted: A log; "none"; or None for the one beside the film.

    Raises:
        SourceError: The log that is asked for cannot be used.
    """
    if wanted is not None and str(wanted) == NO_TELEMETRY:
        return TelemetryChoice(own=False)
    if wanted is None:
        if path.is_dir():
            return TelemetryChoice()
        found = log_beside(path)
        if found.log is None:
            return TelemetryChoice(own=False, warnings=found.warnings)
        return _fitted(found.log, reader)
    log = read_flight_log(Path(wanted))
    if not isinstance(log, FlightLog):
        raise SourceError(
            expected="a drone's log that is whole",
            found=str(log),
            fix="give another file for telemetry, or `none`",
        )
    return _fitted(log, reader)


def _fitted(log: FlightLog, reader: Reader) -> TelemetryChoice:
    """Say where the log and the source disagree."""
    total, rate_fps = reader.total_frames, reader.rate_fps
    duration_s = total / rate_fps if total and rate_fps else None
    warnings = log.disagreements(duration_s, total)
    if not reader.orientation.is_upright and log.has_attitude:
        warnings = (*warnings, f"{log.name}: the film is turned; its gimbal angles are not used")
        log = log.without_attitude()
    return TelemetryChoice(log, warnings=warnings)
