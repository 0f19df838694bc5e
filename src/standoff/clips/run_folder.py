"""The folder of a run, read again: its record and its tables. Its detections are in `standoff.clips.detections`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from standoff.clips.columns import Columns, chosen_rows, read_columns
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import DataError
from standoff.files.json_text import read_json

RunTable = Literal["tracks", "proximity", "frames"]
"""Of a run; what each column holds stands in the file itself."""

_RECORD: Final = "run.json"


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
            DataError: There is a record, and it is broken.
        """
        path = self.folder / _RECORD
        record = read_json(path, "a run's record") if path.is_file() else {}
        parts = [record.get(name) or {} for name in ("source", "settings")] if isinstance(record, dict) else [None]
        if not all(isinstance(part, dict) for part in parts):
            raise DataError(expected="a run's record", found=f"something else in {path}", fix="repeat `standoff run`")
        return dict(record)

    def table(self, name: RunTable, columns: Sequence[str]) -> Columns:
        """Return columns of one of the tables; what was not measured is NaN.

        Args:
            name: Of the table.
            columns: Their names.

        Raises:
            DataError: The table is missing, unreadable, or lacks a column.
        """
        fix = f"repeat `standoff run` to its end with {name} among its outputs"
        return read_columns(self.folder / f"{name}.parquet", columns, folder="the run folder", fix=fix)

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
