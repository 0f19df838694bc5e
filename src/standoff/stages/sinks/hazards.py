"""`hazards.jsonl`: one event a line, on disk as soon as it happens."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from datetime import timedelta
from pathlib import Path
from typing import Any

from standoff.core.classes import CLASSES
from standoff.core.protocols import LiveSink
from standoff.core.types import Frame, FrameResult, Hazard, Outcome, Silence, Tracks
from standoff.files.json_text import json_line


class HazardSink(LiveSink):
    """Write hazard events as JSON Lines; numbers that were not measured are null.

    Each line has the hazard's own fields (`zone` only where it is of one), `stream_id`, `frame` (index in the source;
    of the last frame for what was said while nothing arrived, and at the end), `captured_at` and `told_by` (UTC of the
    event, and who tells it), and `classes`, one for each track.

    Args:
        path: The file, usually `hazards.jsonl`.
    """

    def __init__(self, path: Path | str) -> None:
        self._file = Path(path).open("w", encoding="utf-8", buffering=1)  # noqa: SIM115 - closed in close()
        self._classes: dict[str, list[str | None]] = {}
        self._frame: Frame | None = None
        self._tracks = Tracks.empty()

    def write(self, result: FrameResult) -> None:
        """Append this frame's events."""
        self._frame = result.frame
        self._tracks = result.tracks
        self._append(result.hazards)

    def tell(self, silence: Silence) -> None:
        """Append what was said while nothing arrived."""
        self._append(silence.hazards)

    def _append(self, events: Sequence[Hazard]) -> None:
        ids_and_classes = zip(self._tracks.track_id.tolist(), self._tracks.class_id.tolist(), strict=True)
        names = {track_id: CLASSES[class_id].name for track_id, class_id in ids_and_classes} if events else {}
        for event in events:
            # A hazard may close after its track has gone, so its classes are those of its first event.
            classes = self._classes.setdefault(event.hazard_id, [names.get(track_id) for track_id in event.track_ids])
            fields = {name: value for name, value in asdict(event).items() if name != "zone" or value}
            line = {**_moment(self._frame, event.time_s), **fields, "classes": classes}
            self._file.write(json_line(line))
            if event.phase == "closed":
                self._classes.pop(event.hazard_id, None)

    def close(self, outcome: Outcome) -> None:
        """Append what the end of the stream closed."""
        try:
            self._append(outcome.hazards)
        finally:
            self._file.close()


def _moment(frame: Frame | None, time_s: float) -> dict[str, Any]:
    """Return where in the stream something was said, and when: so long after the last frame was taken."""
    if frame is None:
        return {"stream_id": None, "frame": None, "captured_at": None, "told_by": None}
    after = timedelta(seconds=time_s - frame.time_s)
    said_at = None if frame.captured_at is None else frame.captured_at + after
    return {"stream_id": frame.stream_id, "frame": frame.index, "captured_at": said_at, "told_by": frame.told_by}
