"""What the detector saw so far, on the disk: what takes longest of a run is not done twice."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from standoff.clips import KeptLooks, part_path
from standoff.core.types import Detections, Frame, FrameResult, Outcome
from standoff.stages.sinks.params import TableParams
from standoff.stages.sinks.parquet_parts import WaitingRows, write_rows
from standoff.stages.sinks.tables import detection_rows, detections_table


class LooksSink:
    """Keep what the detector sees, until the run is complete; a run that goes on takes it from there.

    Args:
        folder: Of the parts; created. What is kept there of other runs of the film lies beside it.
        kept: What was there before, and is not written again.
        source: The source's description, `size_px` among it.
        detector: The detector's.
        params: How often parts are written.
    """

    def __init__(
        self,
        folder: Path,
        kept: KeptLooks,
        source: Mapping[str, Any],
        detector: Mapping[str, Any],
        params: TableParams,
    ) -> None:
        self._folder, self._kept = folder, kept
        self._schema = detections_table(source, detector).schema
        folder.mkdir(parents=True, exist_ok=True)
        self._waiting = WaitingRows(params.flush_s, params.flush_rows)
        self._frames: list[int] = []

    def write(self, result: FrameResult) -> None:
        """Keep what was seen in a frame; where the detector rested, nothing was."""
        if result.detected:
            self.keep(result.frame, result.detections)

    def keep(self, frame: Frame, seen: Detections) -> None:
        """Keep what was seen in a frame, unless that was kept before; frames come in their order.

        Raises:
            OSError: There is no room.
        """
        if self._kept.of(frame) is not None:
            return
        self._waiting.add(detection_rows(frame, seen, detected=True))
        self._frames.append(frame.index)
        if self._waiting.are_due:
            self.flush()

    def flush(self) -> None:
        """Write what was not written yet.

        Raises:
            OSError: There is no room.
        """
        if self._frames:
            path = part_path(self._folder, self._frames[0], self._frames[-1])
            write_rows(path, self._schema, self._waiting.chunks)
            self._frames = []
        self._waiting.begin()

    def close(self, outcome: Outcome) -> None:
        """Remove all that is kept of the film where its run is complete; otherwise write the rest."""
        if outcome.status == "complete" and not outcome.sink_errors:
            shutil.rmtree(self._folder.parent)
        else:
            self.flush()
