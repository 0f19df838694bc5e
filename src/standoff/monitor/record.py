"""`run.json`: what was run, with what, how it ended and how long each stage took."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from standoff.core.errors import OutputError
from standoff.core.outcome import Outcome, Status
from standoff.core.outputs import RECORD_FILE, SCHEMA_VERSION
from standoff.core.run_counts import RunCounts
from standoff.files.in_use import FolderInUse
from standoff.files.json_text import json_text, plain, write_json
from standoff.files.versions import library_versions


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRecord:
    """What there is to say of a run.

    Attributes:
        status: "running", or how it ended, as in `Outcome`. A run that lost an output has failed.
        message: One line; empty while running and when complete.
        folder: Where the outputs are.
        started_at: Aware UTC time.
        versions: Of standoff, Python and the libraries that results depend on.
        about: What settings, source and stages say of themselves, by heading; `warnings` among them.
        counts: What happened.
        stages: Median, 90th percentile and total milliseconds of each stage and output.
        finished_at: Aware UTC time; None while running.
        wall_s: How long it took; 0 while running.
        sink_errors: Message of each output that gave up, by name.
    """

    folder: Path
    started_at: datetime
    versions: Mapping[str, str]
    about: Mapping[str, Any]
    status: Status | Literal["running"] = "running"
    message: str = ""
    counts: RunCounts = field(default_factory=RunCounts)
    stages: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    finished_at: datetime | None = None
    wall_s: float = 0.0
    sink_errors: Mapping[str, str] = field(default_factory=dict)

    @property
    def frames_per_s(self) -> float | None:
        """Frames for each second that the run took; None while running."""
        return round(self.counts.rows["frames"] / self.wall_s, 2) if self.wall_s > 0 else None

    def to_dict(self) -> dict[str, Any]:
        """Return what the file says: plain values; what JSON has no word for is text, what is not finite null."""
        head = {"status": self.status, "message": self.message, "schema_version": SCHEMA_VERSION}
        begun = {"started_at": self.started_at, "versions": self.versions, **self.about}
        if self.finished_at is None:
            return _plain({**head, **begun})
        return _plain(
            {
                **head,
                **begun,
                "finished_at": self.finished_at,
                "wall_s": round(self.wall_s, 3),
                "frames_per_s": self.frames_per_s,
                "counts": self.counts.to_dict(),
                "watched_ground": self.counts.watched.summary(),
                "stages": self.stages,
                "sink_errors": self.sink_errors,
            }
        )


class RecordKeeper:
    """Keep the record of a run in its folder, which says "running" at the start and how it ended at the end.

    A record that still says "running" after its process has gone belongs to a killed run. Nobody else may write to the
    folder until `finish`.

    Args:
        path: An existing folder.
        about: What is known before the first frame.

    Attributes:
        path: The folder.
        record: What its record says, or should say where it could not be written.

    Raises:
        OutputError: Somebody else is writing to it, or the record cannot be written.
    """

    def __init__(self, path: Path, about: Mapping[str, Any]) -> None:
        self.path = path
        self._mark = FolderInUse(path)
        self._begun_s = time.monotonic()
        self.record = RunRecord(folder=path, started_at=datetime.now(UTC), versions=library_versions(), about=about)
        write_json(path / RECORD_FILE, self.record.to_dict())

    def finish(self, outcome: Outcome, stages: Mapping[str, Mapping[str, float]]) -> None:
        """Write the final record; where there is no room for it, at least how the run ended.

        Args:
            outcome: How it ended; without a word about anything, what was known at the start stays.
            stages: As in `RunRecord`.

        Raises:
            OutputError: The whole record could not be written.
        """
        status, message = outcome.status, outcome.message
        if outcome.sink_errors and status == "complete":
            # Whoever looks for "complete" relies on every file of the folder.
            status, message = "failed", f"not whole: {', '.join(outcome.sink_errors)} (see sink_errors)"
        self.record = replace(
            self.record,
            status=status,
            message=message,
            about=outcome.about or self.record.about,
            counts=outcome.counts,
            stages=stages,
            finished_at=datetime.now(UTC),
            wall_s=time.monotonic() - self._begun_s,
            sink_errors=dict(outcome.sink_errors),
        )
        try:
            write_json(self.path / RECORD_FILE, self.record.to_dict())
        except OutputError as error:
            self.record = replace(
                self.record,
                status="failed",
                message=f"{message or 'the run came to its end'}; this record is not whole: {error.found}",
                sink_errors={**outcome.sink_errors, "record": str(error)},
            )
            short = {name: getattr(self.record, name) for name in ("status", "message", "sink_errors")}
            _write_over(self.path / RECORD_FILE, short)
            raise
        finally:
            self._mark.release()


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    made: dict[str, Any] = plain(values)
    return made


def _write_over(path: Path, short: Mapping[str, Any]) -> None:
    """Put something short in the place of a longer text, which takes no room that is not there."""
    with suppress(OSError), path.open("r+", encoding="utf-8") as file:
        file.write(json_text(short))
        file.truncate()
