"""The folder of a run, read again: its record, tables and hazards; `standoff.clips.detections` has its detections."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from standoff.clips.columns import Columns, chosen_rows, column_names, read_columns
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import DataError
from standoff.core.hazard_life import HazardLife
from standoff.core.hazards import Hazard
from standoff.core.outputs import SCHEMA_VERSION
from standoff.files.json_text import parse_json, read_json
from standoff.files.plain_text import read_text

RunTable = Literal["tracks", "proximity", "frames"]
"""Of a run; what each column holds stands in the file itself."""

_RECORD: Final = "run.json"
_HAZARDS: Final = "hazards.jsonl"
_HAZARD_FIELDS: Final = tuple(field.name for field in fields(Hazard))
_UNKNOWN_NUMBERS: Final = ("distance_m", "gap_m", "sigma_m", "breach_now", "breach_ahead")


@dataclass(frozen=True, slots=True)
class RunFolder:
    """What `standoff run` wrote, read when it is asked for.

    Attributes:
        folder: Of the run.
    """

    folder: Path

    def record(self) -> Mapping[str, Any]:
        """Return what the run says of itself; empty where tables alone were kept.

        Raises:
            DataError: There is a record, and it is broken, or a newer standoff wrote it.
        """
        path = self.folder / _RECORD
        record = read_json(path, "a run's record") if path.is_file() else {}
        parts = [record.get(name) or {} for name in ("source", "settings")] if isinstance(record, dict) else [None]
        if not all(isinstance(part, dict) for part in parts):
            raise DataError(expected="a run's record", found=f"something else in {path}", fix="repeat `standoff run`")
        self._refuse_newer(record.get("schema_version", 0))
        return dict(record)

    def _refuse_newer(self, version: object) -> None:
        """Raise DataError where the files may mean something else than this version takes them for."""
        if isinstance(version, int) and version <= SCHEMA_VERSION:
            return
        raise DataError(
            expected=f"a run whose files are of version {SCHEMA_VERSION}, or older",
            found=f"version {version} in {self.folder}",
            fix="use the version of standoff that made the run, or a newer one",
        )

    def table(self, name: RunTable, columns: Sequence[str], span_s: tuple[float, float] | None = None) -> Columns:
        """Return columns of one of the tables; what was not measured is NaN.

        Args:
            name: Of the table.
            columns: Their names.
            span_s: Of rows from this time up to that one, both included; None: all.

        Raises:
            DataError: The table is missing, unreadable, or lacks a column.
        """
        fix = f"repeat `standoff run` to its end with {name} among its outputs"
        return read_columns(self.folder / f"{name}.parquet", columns, folder="the run folder", fix=fix, span_s=span_s)

    def columns(self, name: RunTable) -> frozenset[str]:
        """Return the names of a table's columns: older runs have fewer; none where the table is missing or broken."""
        try:
            return column_names(pq.read_schema(self.folder / f"{name}.parquet"))
        except (OSError, pa.ArrowException):
            return frozenset()

    def tracks(self, columns: Sequence[str]) -> Columns:
        """Return columns of the tracks, frame by frame, and `class_id` as this version numbers classes.

        Args:
            columns: Their names, `frame` and `class` among them.

        Raises:
            DataError: As for `table`, or this version does not know a class.
        """
        tracks = self.table("tracks", columns)
        names, which = np.unique(tracks["class"].astype(np.str_), return_inverse=True)
        unknown = sorted(set(names.tolist()) - CLASS_BY_NAME.keys())
        if unknown:
            raise DataError(
                expected="classes of standoff",
                found=f"{', '.join(unknown)} in the tracks of {self.folder}",
                fix="repeat the run with this version",
            )
        class_id = np.array([CLASS_BY_NAME[name].id for name in names.tolist()], dtype=np.int64)[which]
        return chosen_rows({**tracks, "class_id": class_id}, np.argsort(tracks["frame"], kind="stable"))

    def hazards(self) -> Mapping[int | None, Sequence[Hazard]]:
        """Return the events by the frame after which they were said, in their order; None: before the first frame.

        Raises:
            DataError: The file is missing or not what it should be.
        """
        events: dict[int | None, list[Hazard]] = {}
        for event, frame, _ in self._events():
            events.setdefault(frame, []).append(event)
        return events

    def hazard_lives(self) -> list[HazardLife]:
        """Return each hazard from its first event to its last, in the order in which they opened.

        Its tracks are called by their classes, "unknown" where the run does not tell.

        Raises:
            DataError: The file is missing or not what it should be.
        """
        lives: dict[str, HazardLife] = {}
        for event, frame, classes in self._events():
            life = lives.get(event.hazard_id)
            if life is None:
                lives[event.hazard_id] = HazardLife.begun(event, classes, frame)
            else:
                life.take(event, frame)
        return list(lives.values())

    def _events(self) -> Iterator[tuple[Hazard, int | None, tuple[str, ...]]]:
        """Yield each event, the frame after which it was said, and the classes of its tracks."""
        path = self.folder / _HAZARDS
        lines = read_text(path, "a run's hazards", DataError).split("\n")
        for number, line in enumerate(filter(None, lines), start=1):
            told = parse_json(line, "a hazard's event", f"{path}, line {number}")
            try:
                classes = told.get("classes") or [None] * len(told["track_ids"])
                yield _event(told), told["frame"], tuple(name or "unknown" for name in classes)
            except (AttributeError, KeyError, TypeError, ValueError) as error:
                raise DataError(
                    expected="a hazard's event", found=f"{error} in {path}, line {number}", fix="repeat `standoff run`"
                ) from error


def _event(told: Mapping[str, Any]) -> Hazard:
    known = {name: told[name] for name in _HAZARD_FIELDS if name in told}
    # Earlier runs lack the probabilities, which are unknown then.
    given = [name for name in _UNKNOWN_NUMBERS if name in known]
    numbers: dict[str, Any] = {name: np.nan if known[name] is None else float(known[name]) for name in given}
    return Hazard(**{**known, **numbers, "track_ids": tuple(known["track_ids"])})
