"""A Parquet file that survives a killed process: small whole parts, merged at the end."""

from __future__ import annotations

import itertools
import shutil
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from standoff.files.whole import partial_file
from standoff.stages.sinks.folder import parts_folder

Column = npt.NDArray[Any] | Sequence[Any]
Columns = Mapping[str, Column]

_ROW_GROUP_ROWS = 65_536


class WaitingRows:
    """Rows that are not written yet.

    Args:
        flush_s: Seconds of wall time since the last were written after which these are due.
        flush_rows: Number of rows at which they are.

    Attributes:
        chunks: As they came.
    """

    def __init__(self, flush_s: float, flush_rows: int) -> None:
        self._flush_s, self._flush_rows = flush_s, flush_rows
        self.begin()

    def begin(self) -> None:
        """Begin anew: all that waited are written."""
        self.chunks: list[Columns] = []
        self._count = 0
        self._begun_s = time.monotonic()

    def __len__(self) -> int:
        return self._count

    def add(self, columns: Columns) -> None:
        """Add one array or list for each column, all of one length."""
        count = len(next(iter(columns.values())))
        if count:
            self.chunks.append(columns)
            self._count += count

    @property
    def are_due(self) -> bool:
        """Whether it is time to write them."""
        return self._count >= self._flush_rows or time.monotonic() - self._begun_s >= self._flush_s


class ParquetParts:
    """Collect rows; write a part now and then; make one file of all parts at the end.

    `tracks.parquet` appears when it is whole. Until then `tracks.parts/` holds readable Parquet files
    (`pyarrow.parquet.read_table("tracks.parts")` reads them all), so a kill costs the last seconds only.

    Args:
        path: Final name.
        schema: Columns, with the file's metadata.
        flush_s: Seconds of wall time after which the collected rows become a part.
        flush_rows: Number of rows after which they do.
    """

    def __init__(self, path: Path, schema: pa.Schema, *, flush_s: float, flush_rows: int) -> None:
        self._path, self._schema = path, schema
        self._waiting = WaitingRows(flush_s, flush_rows)
        self._parts: list[Path] = []
        self._is_whole = True
        self._folder = parts_folder(path)
        self._folder.mkdir(exist_ok=True)

    def append(self, columns: Columns) -> None:
        """Add rows: one array or list for each column of the schema, all of one length; NaN becomes null."""
        self._waiting.add(columns)
        if self._waiting.are_due:
            self._flush()

    def _flush(self) -> None:
        if len(self._waiting):
            self._is_whole = False
            part = self._folder / f"part-{len(self._parts):06d}.parquet"
            write_rows(part, self._schema, self._waiting.chunks)
            self._parts.append(part)
            self._is_whole = True
        self._waiting.begin()

    def close(self) -> None:
        """Merge all parts under the final name and remove them.

        When a part could not be written the others stay as they are: the final name is for whole tables only.
        """
        if not self._is_whole:
            return
        self._flush()
        with partial_file(self._path) as partial, pq.ParquetWriter(partial, self._schema) as writer:
            gathered: list[pa.Table] = []
            for part in self._parts:
                gathered.append(pq.read_table(part, schema=self._schema))
                if sum(table.num_rows for table in gathered) >= _ROW_GROUP_ROWS:
                    writer.write_table(pa.concat_tables(gathered))
                    gathered = []
            if gathered:
                writer.write_table(pa.concat_tables(gathered))
        shutil.rmtree(self._folder)


def write_rows(path: Path, schema: pa.Schema, chunks: Sequence[Columns]) -> None:
    """Write rows as one whole file, on the disk before it has its name; NaN becomes null.

    Raises:
        OSError: There is no room.
    """
    columns = [_joined([chunk[field.name] for chunk in chunks], field.type) for field in schema]
    with partial_file(path) as partial:
        pq.write_table(pa.Table.from_arrays(columns, schema=schema), partial)


def _joined(chunks: list[Column], arrow_type: pa.DataType) -> pa.Array:
    arrays = [chunk for chunk in chunks if isinstance(chunk, np.ndarray)]
    values = np.concatenate(arrays) if arrays else list(itertools.chain.from_iterable(chunks))
    return pa.array(values, arrow_type, from_pandas=True)
