"""Tables of a clip, a run and a truth file as a bad copy leaves them: read, or refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from mutations import mutated

from standoff.clips import RunFolder, read_clip_table, read_detections
from standoff.clips.detections import COLUMNS, metadata_of
from standoff.core.errors import DataError
from standoff.evaluation.positions_input import TRACK_COLUMNS, read_truth

_TRUTH_CSV = b"frame,id,x,y,w,h,conf,X,Y\n" + b"".join(
    f"{frame},{person},10.5,20.25,30,40,1,{frame}.5,-{person}.25\n".encode()
    for frame in range(1, 5)
    for person in (1, 2)
)
_TRUTH = ("frame", "entity_id", "class_id", "x_m", "y_m", "x1_px", "y1_px", "x2_px", "y2_px", "foot_x_px", "foot_y_px")


def _detections() -> pa.Table:
    rows = [
        {
            "stream_id": "film",
            "frame": frame,
            "time_s": frame / 10,
            "detected": True,
            "x1_px": 1.0,
            "y1_px": 2.0,
            "x2_px": 11.0,
            "y2_px": 22.0,
            "score": 0.9,
            "class": "worker",
            "class_id": 0,
        }
        for frame in range(6)
    ]
    schema = pa.schema([(name, kind) for name, kind, *_ in COLUMNS if name in rows[0]])
    table = pa.Table.from_pylist(rows, schema=schema)
    return table.replace_schema_metadata(metadata_of((64, 48), {"name": "film"}, {}))


def _truth() -> pa.Table:
    rows = np.arange(6.0)
    return pa.table(
        {name: rows.astype(np.int64) if name in ("frame", "entity_id", "class_id") else rows for name in _TRUTH}
    )


def _tracks() -> pa.Table:
    rows = np.arange(6.0)
    return pa.table({name: pa.array(["worker"] * 6) if name == "class" else rows for name in TRACK_COLUMNS})


def _bytes(table: pa.Table) -> bytes:
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink)
    content: bytes = sink.getvalue().to_pybytes()
    return content


_PARQUET = {"detections": _bytes(_detections()), "truth": _bytes(_truth()), "tracks": _bytes(_tracks())}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tables")


def read(path: Path, kind: str) -> int:
    """Return how many rows a table has."""
    if kind == "detections":
        return len(read_detections(path).detections)
    if kind == "truth":
        return len(read_clip_table(path.parent, path.name, _TRUTH)["frame"])
    return len(RunFolder(path.parent).table("tracks", TRACK_COLUMNS)["frame"])


@pytest.mark.parametrize("kind", _PARQUET)
def test_half_a_table_is_never_a_smaller_one(folder: Path, kind: str) -> None:
    whole = _PARQUET[kind]
    path = folder / f"{kind}.parquet"
    path.write_bytes(whole)
    assert read(path, kind) == 6
    for end in {*range(0, len(whole), 61), *range(len(whole) - 9, len(whole))}:
        path.write_bytes(whole[:end])
        with pytest.raises(DataError):
            read(path, kind)


@given(st.sampled_from(sorted(_PARQUET)), st.data())
@examples(200)
def test_a_table_is_read_or_refused(folder: Path, kind: str, data: st.DataObject) -> None:
    path = folder / f"{kind}.parquet"
    path.write_bytes(data.draw(mutated(st.just(_PARQUET[kind]))))
    try:
        read(path, kind)
    except DataError as error:
        assert "\n" not in str(error)


@given(mutated(st.just(_TRUTH_CSV)))
@examples(100)
def test_a_truth_file_is_read_or_refused(folder: Path, content: bytes) -> None:
    path = folder / "truth.csv"
    path.write_bytes(content)
    try:
        truth = read_truth(path)
    except DataError as error:
        assert "\n" not in str(error)
        return
    assert len({len(column) for column in truth.values()}) == 1
