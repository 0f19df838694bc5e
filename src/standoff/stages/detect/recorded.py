"""Give back what an earlier run detected: a trial of everything after the detector, without its inference."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from standoff.clips import RecordedDetections, read_detections
from standoff.core import protocols
from standoff.core.errors import DataError
from standoff.core.types import Detections, Frame
from standoff.files.fingerprint import file_sha256

_FIX: Final = "choose --start, --stop and --every as in that run, or record the whole source"


class RecordedDetector(protocols.Detector):
    """Detector that replays the detections of an earlier run of the same source, frame by frame.

    Args:
        path: The run's folder, or its `detections.parquet`.

    Raises:
        DataError: There is no such table, or it cannot be used.
    """

    def __init__(self, path: str | Path) -> None:
        self._recorded = read_detections(path)
        self._sha256 = file_sha256(self._recorded.path)

    @property
    def recorded(self) -> RecordedDetections:
        """All of it."""
        return self._recorded

    def describe(self) -> dict[str, Any]:
        """Return facts for the record: that nothing was detected anew, which file, of which source, the true detector.

        `class_map` is the true detector's, where it has one.
        """
        recorded = self._recorded
        class_map = recorded.detector.get("class_map")
        return {
            "kind": "recorded",
            "file": str(recorded.path),
            "sha256": self._sha256,
            "source": dict(recorded.source),
            "detector": dict(recorded.detector),
            **({} if class_map is None else {"class_map": dict(class_map)}),
        }

    def check_source(self, description: Mapping[str, Any]) -> None:
        """Raise DataError where a source is not the recorded one, as far as both can tell before a frame is read.

        Args:
            description: As the source describes itself.
        """
        before, now = self._recorded.source.get("fingerprint"), description.get("fingerprint")
        if before is not None and now is not None and before != now:
            raise DataError(
                expected=f"the source of the detections in {self._recorded.path} ({self._source_name()})",
                found=f"{description.get('name', 'a source')} with other content",
                fix="give the run of this source, or detect anew",
            )

    def prepare(self, size_px: tuple[int, int]) -> None:
        """Make sure that pictures of this (width, height) were recorded.

        Raises:
            DataError: They had another size.
        """
        if size_px != self._recorded.size_px:
            raise DataError(
                expected="pictures of {}x{} as in {} ({})".format(
                    *self._recorded.size_px, self._recorded.path, self._source_name()
                ),
                found="{}x{}".format(*size_px),
                fix="give the run of this source, or detect anew",
            )

    def rests(self, frame: Frame) -> bool:
        """Tell whether the recorded run's detector rested on a frame, so that its tracks coasted.

        Raises:
            DataError: The recorded run did not read this frame, or it was one of another source.
        """
        return not self._recorded.detected[self._row(frame)]

    def detect(self, frame: Frame) -> Detections:
        """Return what was detected in a frame.

        Raises:
            DataError: As `rests`; or the detector rested, which is not the same as seeing nothing.
        """
        row = self._row(frame)
        if not self._recorded.detected[row]:
            raise DataError(
                expected=f"detections of frame {frame.index} in {self._recorded.path}",
                found="that the detector rested there",
                fix="let the tracks coast where rests(frame) is true",
            )
        return self._recorded.detections_at(row)

    def _row(self, frame: Frame) -> int:
        self.prepare(frame.size_px)
        row = self._recorded.row_of(frame.index)
        if row is None:
            raise DataError(
                expected=f"frame {frame.index} ({frame.time_s:.3f} s) among the detections in {self._recorded.path}",
                found=self._extent(),
                fix=_FIX,
            )
        if not self._recorded.is_at(row, frame.time_s):
            raise DataError(
                expected=f"frame {frame.index} at {self._recorded.time_s[row]:.6f} s as in {self._recorded.path} "
                f"({self._source_name()})",
                found=f"it at {frame.time_s:.6f} s",
                fix="give the run of this source (with the same --fps), or detect anew",
            )
        return row

    def _source_name(self) -> str:
        return str(self._recorded.source.get("name", "a source without a name"))

    def _extent(self) -> str:
        """Return in words which frames the recorded run read."""
        frame = self._recorded.frame
        if not len(frame):
            return "no frame at all"
        every = self._recorded.source.get("every", 1)
        step = f", read with --every {every}" if every != 1 else ""
        return f"frames {frame[0]} to {frame[-1]}{step}"
