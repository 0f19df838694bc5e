"""`batch.parquet` and `batch.csv`: a row for each film, for those who go on with it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from standoff.clips import Column, schema_of
from standoff.core.hazards import GRAVENESS
from standoff.files.whole import whole_file
from standoff.scale.result import FilmResult, Findings

_FINDINGS: Final[tuple[Column, ...]] = (
    ("watched_s", pa.float64(), "s", "of the film that was looked at; null: the film does not say how long it is"),
    ("mapped_share", pa.float64(), "", "of the frames that have a ground map; the others are unknown, not safe"),
    ("ground_share", pa.float64(), "", "of the ground in the pictures that counted as watched; null: nobody judged"),
    ("worker_hours", pa.float64(), "h", "of workers in sight"),
    ("alarms", pa.int64(), "", "hazards that somebody would have been told of"),
)
"""Attributes of `Findings`, and null where the film failed."""
_COLUMNS: Final[tuple[Column, ...]] = (
    ("film", pa.string(), "", "file"),
    ("folder", pa.string(), "", "of its run"),
    ("status", pa.string(), "", "complete, or failed: then nothing is known of the film"),
    ("message", pa.string(), "", "why it failed"),
    ("is_new", pa.bool_(), "", "false: it was finished in an earlier batch"),
    *_FINDINGS,
    *((severity, pa.int64(), "", f"hazards that were {severity} at their gravest") for severity in GRAVENESS[::-1]),
)


def batch_table(results: Sequence[FilmResult]) -> pa.Table:
    """Return a row for each film; nothing that was not found out is a number."""
    return pa.Table.from_pylist([_row(one) for one in results], schema=schema_of(_COLUMNS))


def write_tables(results: Sequence[FilmResult], folder: Path) -> None:
    """Write `batch.parquet` and `batch.csv`, each whole or not at all.

    Raises:
        OutputError: One cannot be written.
    """
    table = batch_table(results)
    with whole_file(folder / "batch.parquet") as partial:
        pq.write_table(table, partial)
    with whole_file(folder / "batch.csv") as partial:
        pyarrow.csv.write_csv(table, partial)


def _row(one: FilmResult) -> dict[str, Any]:
    row = {name: getattr(one, name) for name in ("status", "message", "is_new")}
    return {"film": str(one.film), "folder": str(one.folder), **row, **_found(one.found)}


def _found(found: Findings | None) -> dict[str, Any]:
    if found is None:
        return {}
    values = {name: getattr(found, name) for name, *_ in _FINDINGS}
    known = {name: None if math.isnan(value) else value for name, value in values.items()}
    return {**known, **{severity: found.hazards.get(severity, 0) for severity in GRAVENESS}}
