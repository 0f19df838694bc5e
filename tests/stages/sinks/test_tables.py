from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from stages.sinks.fake_site import FakeSite

from standoff.core.types import FrameResult, NoGroundMap, Outcome, Proximities, Tracks
from standoff.stages.sinks import DETECTIONS, FRAMES, PROXIMITY, TRACKS, Table, TableParams, TableSink

TRACK_COLUMNS = [
    "stream_id",
    "frame",
    "time_s",
    "captured_at",
    "told_by",
    "track_id",
    "class",
    "score",
    "x1_px",
    "y1_px",
    "x2_px",
    "y2_px",
    "foot_x_px",
    "foot_y_px",
    "foot_sigma_x_px",
    "foot_sigma_y_px",
    "foot_cov_px2",
    "observed",
    "age_s",
    "x_m",
    "y_m",
    "vx_mps",
    "vy_mps",
    "sigma_x_m",
    "sigma_y_m",
    "cov_xy_m2",
    "radius_m",
    "valid",
    "reason",
    "standing_s",
    "sight",
    "around_watched",
]
PROXIMITY_COLUMNS = [
    "stream_id",
    "frame",
    "time_s",
    "captured_at",
    "told_by",
    "track_a",
    "track_b",
    "class_a",
    "class_b",
    "distance_m",
    "gap_m",
    "sigma_m",
    "closing_mps",
    "time_to_contact_s",
    "filtered",
    "measured",
    "observed",
    "closest_m",
    "closest_in_s",
    "breach_now",
    "breach_ahead",
    "excuse",
]


@pytest.fixture(scope="module")
def results() -> list[FrameResult]:
    return list(FakeSite((320, 180)).results(100))


def _written(folder: Path, table: Table, results: list[FrameResult], params: TableParams | None = None) -> Path:
    path = folder / "table.parquet"
    sink = TableSink(path, table, params)
    for result in results:
        sink.write(result)
    sink.close(Outcome("complete"))
    return path


def test_tracks_come_back_as_they_were_measured(tmp_path: Path, results: list[FrameResult]) -> None:
    table = pq.read_table(_written(tmp_path, TRACKS, results))
    assert table.column_names == TRACK_COLUMNS
    assert table.num_rows == sum(len(result.tracks) for result in results)
    expected = np.concatenate([result.positions.xy_m for result in results])
    got = np.column_stack([table["x_m"].to_numpy(), table["y_m"].to_numpy()])
    np.testing.assert_array_equal(got, expected)
    assert table["class"].to_pylist()[:5] == ["worker", "worker", "excavator", "worker", "wheel_loader"]


def test_a_number_that_was_not_measured_is_null_and_says_why(tmp_path: Path, results: list[FrameResult]) -> None:
    table = pq.read_table(_written(tmp_path, TRACKS, results))
    unmeasured = [row for row in table.to_pylist() if not row["valid"]]
    assert {row["reason"] for row in unmeasured} == {"no ground map", "outside the trusted area"}
    for column in ("x_m", "y_m", "vx_mps", "sigma_x_m", "cov_xy_m2"):
        assert all(row[column] is None for row in unmeasured)
        assert not any(isinstance(value, float) and np.isnan(value) for value in table[column].to_pylist())


def test_unmeasured_pairs_have_rows(tmp_path: Path, results: list[FrameResult]) -> None:
    table = pq.read_table(_written(tmp_path, PROXIMITY, results))
    assert table.column_names == PROXIMITY_COLUMNS
    rows = [row for row in table.to_pylist() if row["frame"] == 70]
    assert len(rows) == len(results[70].proximities) > 0
    assert not any(row["measured"] for row in rows)
    assert all(row["distance_m"] is None and row["time_to_contact_s"] is None for row in rows)
    assert np.isinf([row["time_to_contact_s"] or 0.0 for row in table.to_pylist()]).any()


def test_every_frame_has_a_row_also_without_map_and_tracks(tmp_path: Path, results: list[FrameResult]) -> None:
    empty = replace(
        results[0],
        ground=NoGroundMap("nothing there"),
        detected=False,
        tracks=Tracks.empty(),
        positions=results[0].positions[:0],
        proximities=Proximities.empty(),
    )
    rows = pq.read_table(_written(tmp_path, FRAMES, [results[0], empty, results[70]])).to_pylist()
    assert [row["map"] for row in rows] == [True, False, False]
    assert rows[0]["map_method"] == "reference:refined"
    assert rows[0]["image_to_ground"] == results[0].ground.image_to_ground.ravel().tolist()  # type: ignore[union-attr]
    assert rows[1]["map_reason"] == "nothing there"
    assert rows[1]["detections"] is None
    assert rows[1]["tracks"] == 0
    assert rows[2]["image_to_ground"] is None


@pytest.mark.parametrize("table", [TRACKS, PROXIMITY, FRAMES, DETECTIONS])
def test_parts_make_no_difference(tmp_path: Path, results: list[FrameResult], table: Table) -> None:
    (tmp_path / "whole").mkdir()
    (tmp_path / "parts").mkdir()
    whole = pq.read_table(_written(tmp_path / "whole", table, results))
    parts = pq.read_table(_written(tmp_path / "parts", table, results, TableParams(flush_rows=7)))
    assert parts.to_pylist() == whole.to_pylist()
    assert [path.name for path in (tmp_path / "parts").iterdir()] == ["table.parquet"]


@pytest.mark.parametrize("table", [TRACKS, PROXIMITY, FRAMES, DETECTIONS])
def test_a_run_without_frames_leaves_an_empty_table(tmp_path: Path, table: Table) -> None:
    read = pq.read_table(_written(tmp_path, table, []))
    assert read.num_rows == 0
    assert read.column_names == table.schema.names


@pytest.mark.parametrize("table", [TRACKS, PROXIMITY, FRAMES, DETECTIONS])
def test_columns_say_their_unit_and_meaning(tmp_path: Path, results: list[FrameResult], table: Table) -> None:
    schema = pq.read_schema(_written(tmp_path, table, results[:3]))
    assert schema.metadata[b"standoff_version"]
    for field in schema:
        assert field.metadata[b"description"], field.name
        expected = field.name.rsplit("_", 1)[-1].replace("mps", "m/s").replace("m2", "m^2")
        if expected in ("m", "m/s", "m^2", "s") or field.name.endswith(("1_px", "2_px")):
            assert field.metadata[b"unit"].decode() == expected, field.name


def test_a_killed_process_leaves_readable_parts(tmp_path: Path) -> None:
    script = textwrap.dedent(
        """
        import sys
        from stages.sinks.fake_site import FakeSite
        from standoff.stages.sinks import TRACKS, TableParams, TableSink
        sink = TableSink(sys.argv[1], TRACKS, TableParams(flush_rows=20))
        for index, result in enumerate(FakeSite((64, 36)).results(10_000)):
            sink.write(result)
            if index == 50:
                print("going", flush=True)
        """
    )
    tests = str(Path(__file__).parents[2])
    process = subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path / "tracks.parquet")],
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([tests, os.environ.get("PYTHONPATH", "")])},
    )
    with process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    assert not (tmp_path / "tracks.parquet").exists()
    table = pq.read_table(tmp_path / "tracks.parts")
    assert table.num_rows > 51 * 5 - 20  # less than one part is lost
    frames = table["frame"].to_numpy()
    np.testing.assert_array_equal(frames, np.sort(frames))


def test_a_table_that_lost_a_part_never_gets_the_final_name(
    tmp_path: Path, results: list[FrameResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_arguments: object) -> None:
        raise OSError(28, "No space left on device")

    sink = TableSink(tmp_path / "tracks.parquet", TRACKS, TableParams(flush_rows=5))
    sink.write(results[0])
    with monkeypatch.context() as full_disk:
        full_disk.setattr("pyarrow.parquet.write_table", refuse)
        with pytest.raises(OSError, match="No space"):
            sink.write(results[1])
    sink.close(Outcome("complete", sink_errors={"tracks": "No space left on device"}))
    assert not (tmp_path / "tracks.parquet").exists()
    assert set(pq.read_table(tmp_path / "tracks.parts")["frame"].to_pylist()) == {0}


def test_a_pair_is_observed_when_both_of_its_tracks_are(tmp_path: Path, results: list[FrameResult]) -> None:
    sink = TableSink(tmp_path / "proximity.parquet", PROXIMITY)
    expected: list[bool] = []
    for result in results:
        sink.write(result)
        seen = dict(zip(result.tracks.track_id.tolist(), result.tracks.observed.tolist(), strict=True))
        pairs = zip(result.proximities.track_a.tolist(), result.proximities.track_b.tolist(), strict=True)
        expected += [seen[a] and seen[b] for a, b in pairs]
    sink.close(Outcome("complete"))
    assert pq.read_table(tmp_path / "proximity.parquet")["observed"].to_pylist() == expected
    assert set(expected) == {True, False}
