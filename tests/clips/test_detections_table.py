from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stages.sinks.fake_site import FakeSite

from standoff.clips import RecordedDetections, read_detections
from standoff.core.classes import CLASSES
from standoff.core.errors import DataError
from standoff.core.types import Detections, FrameResult, Outcome
from standoff.stages.sinks import TableParams, TableSink, detections_table

RESULT = FakeSite((320, 180)).result(0)
SOURCE = {"name": "site.mp4", "size_px": [320, 180], "fingerprint": "abc", "every": 2}
DETECTOR = {"model": "yolo.onnx", "class_map": {"person": "worker"}}

Seen = Detections | None
"""What the detector said of a frame; None: it rested."""


def write(folder: Path, seen: list[Seen], params: TableParams | None = None) -> Path:
    """Write a run that read every second frame."""
    with closing_table(folder, params) as sink:
        for number, detections in enumerate(seen):
            sink.write(result_of(2 * number, detections))
    return folder


@contextmanager
def closing_table(folder: Path, params: TableParams | None = None) -> Iterator[TableSink]:
    sink = TableSink(folder / "detections.parquet", detections_table(SOURCE, DETECTOR), params)
    yield sink
    sink.close(Outcome("complete"))


def result_of(index: int, seen: Seen) -> FrameResult:
    frame = replace(RESULT.frame, index=index, time_s=index / 25)
    return replace(
        RESULT, frame=frame, detected=seen is not None, detections=Detections.empty() if seen is None else seen
    )


def some(count: int) -> Detections:
    rng = np.random.default_rng(count)
    xyxy_px = np.sort(rng.uniform(0, 180, (count, 2, 2)), axis=1).reshape(-1, 4)
    return Detections(xyxy_px, rng.uniform(0, 1, count), rng.integers(0, len(CLASSES), count))


def columns_of(recorded: RecordedDetections, row: int) -> list[Any]:
    found = recorded.detections_at(row)
    return [found.xyxy_px.tolist(), found.score.tolist(), found.class_id.tolist()]


@settings(max_examples=25, deadline=None)
@given(
    counts=st.lists(st.one_of(st.none(), st.integers(0, 4)), max_size=12),
    flush_rows=st.integers(1, 8),
)
def test_every_frame_comes_back_as_it_was_whatever_was_seen(counts: list[int | None], flush_rows: int) -> None:
    seen = [None if count is None else some(count) for count in counts]
    with TemporaryDirectory() as folder:
        recorded = read_detections(write(Path(folder), seen, TableParams(flush_rows=flush_rows)))
    assert recorded.frame.tolist() == [2 * number for number in range(len(seen))]
    assert recorded.time_s.tolist() == [2 * number / 25 for number in range(len(seen))]
    assert recorded.detected.tolist() == [detections is not None for detections in seen]
    for row, detections in enumerate(seen):
        assert recorded.row_of(2 * row) == row
        assert recorded.row_of(2 * row + 1) is None
        expected = Detections.empty() if detections is None else detections
        assert columns_of(recorded, row) == [
            expected.xyxy_px.tolist(), expected.score.tolist(), expected.class_id.tolist()
        ]  # fmt: skip


def test_the_file_says_whose_detections_it_holds(tmp_path: Path) -> None:
    recorded = read_detections(write(tmp_path, [some(2)]))
    assert recorded.size_px == (320, 180)
    assert (recorded.source, recorded.detector) == (SOURCE, DETECTOR)


def test_the_table_itself_does_as_well_as_its_folder(tmp_path: Path) -> None:
    write(tmp_path, [some(3)])
    recorded = read_detections((tmp_path / "detections.parquet").rename(tmp_path / "else.parquet"))
    assert len(recorded.detections) == 3


def change(folder: Path, edit: Callable[[pa.Table], pa.Table]) -> Path:
    path = folder / "detections.parquet"
    pq.write_table(edit(pq.read_table(path)), path)
    return folder


def about(**changes: object) -> Callable[[pa.Table], pa.Table]:
    def edit(table: pa.Table) -> pa.Table:
        metadata = table.schema.metadata
        content = {**json.loads(metadata[b"standoff_detections"]), **changes}
        return table.replace_schema_metadata({**metadata, b"standoff_detections": json.dumps(content)})

    return edit


def column(name: str, values: object, kind: pa.DataType | None = None) -> Callable[[pa.Table], pa.Table]:
    def edit(table: pa.Table) -> pa.Table:
        array = pa.array(values, kind) if isinstance(values, list) else values(table[name])  # type: ignore[operator]
        return table.set_column(table.column_names.index(name), name, array)

    return edit


def test_more_columns_in_another_order_make_no_difference(tmp_path: Path) -> None:
    seen: list[Seen] = [some(2), None, some(0), some(1)]
    before = read_detections(write(tmp_path, seen))

    def edit(table: pa.Table) -> pa.Table:
        table = table.append_column("ground_x_px", pa.array([1.0] * table.num_rows))
        return table.select(table.column_names[::-1]).replace_schema_metadata(table.schema.metadata)

    after = read_detections(change(tmp_path, edit))
    assert [columns_of(after, row) for row in range(4)] == [columns_of(before, row) for row in range(4)]


def test_a_class_is_known_by_its_name_not_by_its_number(tmp_path: Path) -> None:
    before = read_detections(write(tmp_path, [some(4)]))
    after = read_detections(change(tmp_path, column("class_id", [99, 99, 99, 99])))
    assert columns_of(after, 0) == columns_of(before, 0)


# The rows: two detections in frame 0, none in frame 2, frame 4 rested, one in frame 6.
BROKEN: dict[str, tuple[Callable[[pa.Table], pa.Table], str]] = {
    "another table": (lambda table: table.replace_schema_metadata({}), "does not say whose"),
    "no description": (lambda table: table.replace_schema_metadata({"standoff_detections": "[]"}), "a description"),
    "no JSON": (lambda table: table.replace_schema_metadata({"standoff_detections": "{"}), "a description"),
    "a newer format": (about(format=2), "format 2"),
    "no size": (about(picture_size_px=[320]), "picture_size_px"),
    "no detector": (about(detector=None), "detector"),
    "no box": (lambda table: table.drop_columns(["y2_px"]), "without y2_px"),
    "no time": (lambda table: table.drop_columns(["time_s"]), "without time_s"),
    "text for numbers": (column("score", ["a", "b", None, None, "c"]), "score as double"),
    "half a box": (column("x1_px", [1.0, None, None, None, 1.0]), "box, score and class"),
    "a frame without number": (column("frame", [0, 0, 2, None, 6]), "frame in every row"),
    "frames out of order": (column("frame", [2, 2, 0, 4, 6]), "rising order"),
    "two times for a frame": (column("time_s", [0.0, 0.01, 0.08, 0.16, 0.24]), "one time_s"),
    "an infinite time": (column("time_s", [0.0, 0.0, 0.08, 0.16, float("inf")]), "finite time_s"),
    "half a rest": (column("detected", [True, False, True, False, True]), "one detected"),
    "boxes while it rested": (column("detected", [False, False, True, False, True]), "rested"),
    "an empty row too many": (column("frame", [0, 0, 0, 4, 6]), "one time_s"),
    "boxes inside out": (column("x2_px", lambda old: pc.subtract(old, 1e4)), "left, top, right, bottom"),
    "a sure score": (column("score", [2.0, 2.0, None, None, 2.0]), "between 0 and 1"),
    "an unknown class": (column("class", ["worker", "drone", None, None, "worker"]), "drone"),
}


@pytest.mark.parametrize(("edit", "said"), BROKEN.values(), ids=BROKEN.keys())
def test_a_table_that_cannot_be_is_refused_in_one_line(
    tmp_path: Path, edit: Callable[[pa.Table], pa.Table], said: str
) -> None:
    write(tmp_path, [some(2), some(0), None, some(1)])
    with pytest.raises(DataError) as refused:
        read_detections(change(tmp_path, edit))
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_an_empty_row_beside_detections_is_refused(tmp_path: Path) -> None:
    write(tmp_path, [some(2), some(0)])

    def edit(table: pa.Table) -> pa.Table:
        return column("time_s", [0.0] * 3)(column("frame", [0] * 3)(table))

    with pytest.raises(DataError, match="only where it is the frame's only one"):
        read_detections(change(tmp_path, edit))


def test_what_is_no_table_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"no .*detections\.parquet"):
        read_detections(tmp_path)
    (tmp_path / "detections.parquet").write_bytes(b"PAR1 and no more")
    with pytest.raises(DataError, match="a whole Parquet table"):
        read_detections(tmp_path)


@pytest.mark.parametrize("seed", range(3))
def test_ground_points_come_back_and_stay_unknown_where_they_are(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 3.0, (5, 2, 2))
    foot_px, covariance_px2 = rng.uniform(-50.0, 400.0, (5, 2)), root @ root.transpose(0, 2, 1)
    unknown = rng.random(5) < 0.5
    foot_px[unknown], covariance_px2[unknown] = np.nan, np.nan
    seen = replace(some(5), foot_px=foot_px, foot_covariance_px2=covariance_px2)
    found = read_detections(write(tmp_path, [None, seen, some(0)])).detections
    np.testing.assert_allclose(found.foot_px, foot_px)
    np.testing.assert_allclose(found.foot_covariance_px2, covariance_px2)


def test_every_row_says_when_the_picture_was_taken_also_where_nothing_was_seen(tmp_path: Path) -> None:
    begun = datetime(2026, 5, 4, 9, 12, tzinfo=UTC)
    with closing_table(tmp_path) as sink:
        for number, seen in enumerate([some(2), some(0), None]):
            result = result_of(number, seen)
            taken = begun + timedelta(seconds=number / 25)
            sink.write(replace(result, frame=replace(result.frame, captured_at=taken, told_by="telemetry")))
        sink.write(result_of(3, some(1)))
    rows = pq.read_table(tmp_path / "detections.parquet").to_pylist()
    seconds = [None if row["captured_at"] is None else (row["captured_at"] - begun).total_seconds() for row in rows]
    assert seconds == [0.0, 0.0, 0.04, 0.08, None]
    assert [row["told_by"] for row in rows] == ["telemetry"] * 4 + [None]


def test_tables_from_before_somebody_told_when_a_picture_was_taken_are_read(tmp_path: Path) -> None:
    seen: list[Seen] = [some(2), None, some(1)]
    before = read_detections(write(tmp_path, seen))
    after = read_detections(change(tmp_path, lambda table: table.drop_columns(["captured_at", "told_by"])))
    assert [columns_of(after, row) for row in range(3)] == [columns_of(before, row) for row in range(3)]
    assert after.time_s.tolist() == before.time_s.tolist()


def test_tables_from_before_ground_points_are_read(tmp_path: Path) -> None:
    folder = write(tmp_path, [some(3)])
    change(folder, lambda table: table.select([name for name in table.column_names if not name.startswith("foot")]))
    assert np.isnan(read_detections(folder).detections.foot_px).all()
