"""A run replayed from its own detections is the same run."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import tolerances
import yaml
from cli.calling import Call
from cli.test_cli import FINDS, make_video

from standoff.config import load_settings
from standoff.core import protocols
from standoff.core.types import Detections, Frame
from standoff.monitor import open_run

FRAMES = 36
NOTHING_SEEN = (16, 17, 18)
"""Frames in which the detector finds nothing at all."""

TABLES = ("tracks", "proximity", "frames", "detections")
SELECTIONS: dict[str, dict[str, Any]] = {
    "all": {},
    "every": {"source": {"every": 2}},
    "detect_every": {"detect_every": 3},
    "part": {"source": {"start_s": 0.55, "stop_s": 3.2}},
    "everything": {"detect_every": 2, "source": {"every": 2, "start_s": 0.3, "stop_s": 3.5}},
}


class Unsure(protocols.Detector):
    """A detector of two people and an excavator: boxes a little off, now and then one missing or nothing at all."""

    def describe(self) -> Mapping[str, Any]:
        return {"model": "unsure", "class_map": {"man": "worker", "digger": "excavator"}} | FINDS

    def detect(self, frame: Frame) -> Detections:
        if frame.index in NOTHING_SEEN:
            return Detections.empty()
        rng = np.random.default_rng(frame.index)
        left, top = 150.0 + 25.0 * frame.time_s, 180.0 - 10.0 * frame.time_s
        boxes = np.array([[left, 100, left + 24, 140], [240, 90, 300, 140], [60, top, 84, top + 40]])
        found = Detections(boxes + rng.normal(0, 0.5, boxes.shape), rng.uniform(0.4, 1, 3), np.array([0, 1, 0]))
        return found[rng.uniform(size=3) < 0.95]


class Forbidden(protocols.Detector):
    """A detector that must never be asked."""

    def detect(self, frame: Frame) -> Detections:
        raise AssertionError("a replay detects nothing anew")


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_video(tmp_path_factory.mktemp("films") / "site.mp4", FRAMES)


@pytest.fixture
def recording(site: Path) -> Path:
    return with_detector(site, "Unsure")


def with_detector(site: Path, name: str) -> Path:
    settings = yaml.safe_load(site.read_text())
    settings["replace"] = {"detect": {"factory": f"cli.test_replay:{name}"}}
    path = site.with_name(f"{name}.yaml")
    path.write_text(yaml.safe_dump(settings), encoding="utf-8")
    return path


def monitor(film: Path, config: Path, out: Path, **more: object) -> Path:
    settings = load_settings(config, {"outputs": [*TABLES, "hazards"], **more})
    for _ in open_run(film, out, settings):
        pass
    return out


def contents(out: Path) -> dict[str, list[dict[str, Any]]]:
    """Return everything that a run says, its hazards without their random ids."""
    events = [json.loads(line) for line in (out / "hazards.jsonl").read_text().splitlines()]
    number: dict[str, int] = {}
    for event in events:
        event["hazard_id"] = number.setdefault(event["hazard_id"], len(number))
    return {"hazards": events, **{name: pq.read_table(out / f"{name}.parquet").to_pylist() for name in TABLES}}


def assert_same(out: Path, expected: Path) -> None:
    """What was detected is equal; what was measured is, but for sums in another order."""
    found, wanted = contents(out), contents(expected)
    assert all(wanted.values()), "a law about nothing"
    assert found["detections"] == wanted["detections"]
    for name, rows in wanted.items():
        assert len(found[name]) == len(rows)
        for one, other in zip(found[name], rows, strict=True):
            assert one.keys() == other.keys()
            for column, value in other.items():
                is_number = isinstance(value, float) or column == "image_to_ground"
                assert one[column] == (
                    pytest.approx(value, rel=tolerances.GEOMETRY_REL, abs=1e-9) if is_number else value
                ), f"{name}.{column}"


@pytest.mark.parametrize("selection", SELECTIONS.values(), ids=SELECTIONS.keys())
def test_a_run_replayed_from_its_own_detections_is_the_same_run(
    film: Path, recording: Path, tmp_path: Path, selection: dict[str, Any]
) -> None:
    original = monitor(film, recording, tmp_path / "original", **selection)
    # How often the detector rested is known from the recording.
    again = {name: value for name, value in selection.items() if name != "detect_every"}
    forbidden = with_detector(recording, "Forbidden")
    replay = monitor(film, forbidden, tmp_path / "replay", detections=str(original), **again)
    assert_same(replay, original)
    assert any(not row["observed"] for row in contents(replay)["tracks"])
    assert len(contents(replay)["hazards"]) > 1


def test_a_recording_that_does_not_say_who_told_the_time_is_replayed_all_the_same(
    film: Path, recording: Path, tmp_path: Path
) -> None:
    original = monitor(film, recording, tmp_path / "original")
    table = pq.read_table(original / "detections.parquet").drop_columns(["captured_at", "told_by"])
    pq.write_table(table, tmp_path / "earlier.parquet")
    forbidden = with_detector(recording, "Forbidden")
    replay = monitor(film, forbidden, tmp_path / "replay", detections=str(tmp_path / "earlier.parquet"))
    assert_same(replay, original)


def test_every_frame_is_in_the_table_and_says_whether_the_detector_ran(
    film: Path, recording: Path, tmp_path: Path
) -> None:
    said = contents(monitor(film, recording, tmp_path / "run", detect_every=2, detect_near_m=None))
    of_frame: dict[int, list[dict[str, Any]]] = {}
    for row in said["detections"]:
        of_frame.setdefault(row["frame"], []).append(row)
    assert sorted(of_frame) == list(range(FRAMES))
    for frame in said["frames"]:
        rows = of_frame[frame["frame"]]
        assert {row["detected"] for row in rows} == {frame["detected"]} == {frame["frame"] % 2 == 0}
        assert sum(row["score"] is not None for row in rows) == (frame["detections"] or 0)
    assert [row["x1_px"] for row in of_frame[NOTHING_SEEN[0]]] == [None]


def test_a_part_of_a_recording_can_be_replayed_with_fewer_detections(
    film: Path, recording: Path, tmp_path: Path
) -> None:
    table = monitor(film, recording, tmp_path / "whole") / "detections.parquet"
    selection = SELECTIONS["everything"]
    expected = monitor(film, recording, tmp_path / "detected", **selection)
    assert_same(monitor(film, recording, tmp_path / "replay", detections=str(table), **selection), expected)


def test_a_replay_can_be_replayed_and_knows_the_true_detector(
    call: Call, film: Path, recording: Path, tmp_path: Path
) -> None:
    original = monitor(film, recording, tmp_path / "original")
    once, twice = tmp_path / "once", tmp_path / "twice"
    for replayed, out in ((original, once), (once, twice)):
        words = ("run", film, "--config", recording, "--out", out, "--detections", replayed)
        assert call(*words, "--outputs", "tracks,proximity,frames,detections,hazards", "--quiet") == (0, "", "")
    assert_same(twice, original)
    model = json.loads((twice / "run.json").read_text())["model"]
    assert model["kind"] == "recorded"
    assert model["detector"]["detector"] == Unsure().describe()
    assert model["class_map"] == Unsure().describe()["class_map"]


def test_frames_that_were_not_recorded_end_the_replay_in_one_line(
    call: Call, film: Path, recording: Path, tmp_path: Path
) -> None:
    short = monitor(film, recording, tmp_path / "short", source={"every": 2, "stop_s": 0.4})
    code, _, error = call(
        "run", film, "--config", recording, "--out", tmp_path / "replay", "--detections", short, "--quiet"
    )
    assert (code, error.count("\n")) == (2, 1)
    assert "expected frame 1 (0.100 s)" in error and "--every 2" in error
    assert json.loads((tmp_path / "replay" / "run.json").read_text())["status"] == "failed"


@pytest.mark.parametrize(
    ("case", "said"),
    [
        ("another video", "longer.mp4 with other content"),
        ("no run", "no-such-run"),
        ("a run without detections", "no "),
        ("a broken table", "a whole Parquet table"),
        ("another table", "does not say whose detections"),
        ("a model as well", "--model or --detections"),
        ("into the recorded run", "outputs apart from the recorded detections"),
        ("a class that the model does not know", "without any vehicle"),
    ],
)
def test_what_cannot_be_replayed_is_one_line_exit_2_and_no_folder(
    call: Call, film: Path, recording: Path, tmp_path: Path, case: str, said: str
) -> None:
    run = monitor(film, recording, tmp_path / "run", source={"stop_s": 0.4})
    table = run / "detections.parquet"
    replayed, source, out, more = run, film, tmp_path / "replay", list[object]()
    match case:
        case "another video":
            source = tmp_path / "longer.mp4"
            # The same pictures in a longer file: as like it as another video can be.
            source.write_bytes(film.read_bytes() + b"\0\0\0\x08free")
        case "no run":
            replayed = tmp_path / "no-such-run"
        case "a run without detections":
            table.unlink()
        case "a broken table":
            table.write_bytes(table.read_bytes()[:100])
        case "another table":
            shutil.copy(run / "tracks.parquet", table)
        case "a model as well":
            more = ["--model", "site"]
        case "into the recorded run":
            out, more = run, ["--overwrite"]
        case "a class that the model does not know":
            settings = yaml.safe_load(recording.read_text()) | {"proximity": {"pairs": [["person", "vehicle"]]}}
            recording.write_text(yaml.safe_dump(settings))
    before = table.read_bytes() if table.exists() else b""
    code, _, error = call("run", source, "--config", recording, "--out", out, "--detections", replayed, *more)
    assert (code, error.count("\n")) == (2, 1)
    assert said in error
    assert out == run or not out.exists()
    assert (table.read_bytes() if table.exists() else b"") == before


def test_a_model_on_the_command_line_wins_over_recorded_detections_in_the_file(
    call: Call, film: Path, tmp_path: Path
) -> None:
    (tmp_path / "site.yaml").write_text("detections: runs/first\n")
    assert load_settings(tmp_path / "site.yaml").detections == tmp_path / "runs" / "first"
    words = ("run", film, "--config", tmp_path / "site.yaml", "--out", tmp_path / "out")
    assert "runs/first" in call(*words)[2]
    assert "no-such.onnx" in call(*words, "--model", tmp_path / "no-such.onnx")[2]
