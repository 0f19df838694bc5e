"""`hazards.jsonl`: one event a line, on disk as soon as it happens."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

from standoff.core.classes import CLASSES
from standoff.core.types import FrameResult, Hazard, Outcome
from standoff.files.json_text import json_line


class HazardSink:
    """Write hazard events as JSON Lines; numbers that were not measured are null.

    Each line has the hazard's own fields (`zone` only where it is of one), `stream_id`, `frame` (index in the source;
    of the last frame for what the end of the stream closed), and `classes`, one for each track.

    Args:
        path: The file, usually `hazards.jsonl`.
    """

    def __init__(self, path: Path | str) -> None:
        self._file = Path(path).open("w", encoding="utf-8", buffering=1)  # noqa: SIM115 - closed in close()
        self._classes: dict[str, list[str | None]] = {}
        self._stream_id: str | None = None
        self._frame: int | None = None

    def write(self, result: FrameResult) -> None:
        """Append this frame's events."""
        self._stream_id, self._frame = result.frame.stream_id, result.frame.index
        if result.hazards:
            ids_and_classes = zip(result.tracks.track_id.tolist(), result.tracks.class_id.tolist(), strict=True)
            names = {track_id: CLASSES[class_id].name for track_id, class_id in ids_and_classes}
            for event in result.hazards:
                self._classes.setdefault(event.hazard_id, [names.get(track_id) for track_id in event.track_ids])
            self._append(result.hazards)

    def _append(self, events: Iterable[Hazard]) -> None:
        for event in events:
            # a hazard may close after its track has gone, so its classes are those of its first event
            classes = self._classes.get(event.hazard_id, [])
            fields = {name: value for name, value in asdict(event).items() if name != "zone" or value}
            line = {"stream_id": self._stream_id, "frame": self._frame, **fields, "classes": classes}
            self._file.write(json_line(line))
            if event.phase == "closed":
                self._classes.pop(event.hazard_id, None)

    def close(self, outcome: Outcome) -> None:
        """Append what the end of the stream closed."""
        try:
            self._append(outcome.hazards)
        finally:
            self._file.close()
