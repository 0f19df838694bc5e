"""Columns of tables: what they are called, hold and mean, and how they are read from files that may be damaged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet

from standoff.core.errors import DataError
from standoff.core.homography import BoolArray
from standoff.core.types import IntArray

Column = tuple[str, pa.DataType, str, str]
"""Name, type, unit, meaning."""

Columns = Mapping[str, npt.NDArray[Any]]
"""By name, all of one length."""

FRAME_COLUMNS: Final[tuple[Column, ...]] = (
    ("stream_id", pa.string(), "", "name of the stream"),
    ("frame", pa.int64(), "", "index in the source, from 0, skipped frames counted"),
    ("time_s", pa.float64(), "s", "presentation timestamp from the start of the source"),
    ("captured_at", pa.timestamp("us", tz="UTC"), "", "when the picture was taken; null: nobody tells"),
    ("told_by", pa.string(), "", "who tells when it was taken: file, arrival, rtcp, telemetry; null: nobody"),
)
"""Which frame a row is of, and when: the first columns of every table of a run."""


def schema_of(columns: Sequence[Column], about: Mapping[str, str] | None = None) -> pa.Schema:
    """Return the schema of a file in which each column says its unit and what it means.

    Args:
        columns: In their order.
        about: Texts about the whole file.
    """
    fields = [pa.field(name, kind, metadata={"unit": unit, "description": text}) for name, kind, unit, text in columns]
    return pa.schema(fields, metadata=about)


def column_names(table: pa.Table | pa.Schema) -> frozenset[str]:
    """Return the names of a table's columns; none of them where one is no text, as in a damaged file."""
    try:
        return frozenset(table.names if isinstance(table, pa.Schema) else table.column_names)
    except UnicodeDecodeError:
        return frozenset()


def chosen_rows(columns: Columns, chosen: BoolArray | IntArray) -> Columns:
    """Return the same columns with the chosen rows only."""
    return {name: column[chosen] for name, column in columns.items()}


def read_columns(
    path: Path, names: Sequence[str], *, folder: str, fix: str, span_s: tuple[float, float] | None = None
) -> Columns:
    """Read columns of a Parquet table; numbers that are null are NaN, lists become arrays of objects.

    Args:
        path: The table.
        names: Of the columns.
        folder: What it should be in, for messages.
        fix: What to do where it is not, for messages.
        span_s: Of rows whose `time_s` is from this up to that, both included; None: all.

    Raises:
        DataError: The table is missing, unreadable, or lacks a column.
    """
    if not path.is_file():
        raise DataError(expected=f"{path.name} in {folder}", found=f"no {path}", fix=fix)
    within = None if span_s is None else [("time_s", ">=", span_s[0]), ("time_s", "<=", span_s[1])]
    try:
        present = column_names(pyarrow.parquet.read_schema(path))
        wanted = [name for name in names if name in present]
        table = pyarrow.parquet.read_table(path, columns=wanted, filters=within)
    except (OSError, pa.ArrowException) as error:
        raise DataError(expected=f"a whole Parquet table in {path}", found=str(error), fix=fix) from error
    return columns_of(table, names, path, fix=fix)


def columns_of(table: pa.Table, names: Sequence[str], path: Path | str, *, fix: str) -> Columns:
    """Return columns of a table as arrays.

    Args:
        table: As it was read.
        names: Of the columns.
        path: Its file, for messages.
        fix: What to do where one is missing, for messages.

    Raises:
        DataError: One is missing.
    """
    present = column_names(table)
    missing = [name for name in names if name not in present]
    if missing:
        raise DataError(expected=f"the columns {','.join(names)}", found=f"{path} without {','.join(missing)}", fix=fix)
    columns = {name: table.column(name) for name in names}
    return {
        name: (column.cast(pa.string()) if pa.types.is_dictionary(column.type) else column).to_numpy()
        for name, column in columns.items()
    }
