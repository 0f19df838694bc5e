from __future__ import annotations

import json
import shutil
from pathlib import Path

import drawn_clip
import pytest
from cli.calling import Call

from standoff.clips import load_clip
from standoff.evaluation.paper.truth_detector import TrueBoxes


@pytest.fixture
def clip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A quick film, and a detector that knows it."""
    folder = drawn_clip.write_clip(tmp_path / "clip")
    known = load_clip(folder)
    monkeypatch.setattr("standoff.config.build.find_model", lambda model: model)
    monkeypatch.setattr("standoff.config.build.OnnxDetector", lambda path, params: TrueBoxes(known))
    # People and machines that are boxes have no height: the watch over the scale would refuse the metres.
    monkeypatch.setattr("standoff.config.build.ScaleWatch", lambda inner, _camera: inner)
    return folder


def run_of(clip: Path, out: Path, call: Call, *options: str) -> Path:
    config, outputs = clip / "reference.yaml", "tracks,proximity,frames,detections,hazards"
    call("run", clip / "video.mp4", "--config", config, "--out", out, "--outputs", outputs, "--quiet", *options)
    assert json.loads((out / "run.json").read_text())["status"] == "complete"
    return out


def test_a_finished_run_is_scored_from_its_folder(clip: Path, tmp_path: Path, call: Call) -> None:
    run = run_of(clip, tmp_path / "run", call)
    code, said, _ = call("evaluate", "run", run, clip)
    assert code == 0
    for words in ("recall", "MADE", "recognised", "this run", "map, level ground"):
        assert words in said
    code, said, _ = call("evaluate", "run", run, clip, "--json", "-")
    found = json.loads(said)
    assert (code, found["frames"]) == (0, drawn_clip.FRAMES)
    assert found["map_only"]["level"]["points"] > 0 and found["pairs"]


def test_a_run_of_a_part_or_without_a_table_is_one_line(clip: Path, tmp_path: Path, call: Call) -> None:
    part = run_of(clip, tmp_path / "part", call, "--stop", "1")
    code, _, error = call("evaluate", "run", part, clip)
    assert (code, error.count("\n")) == (2, 1) and f"all {drawn_clip.FRAMES} frames" in error
    shutil.move(part / "hazards.jsonl", tmp_path)
    code, _, error = call("evaluate", "run", part, clip)
    assert (code, error.count("\n")) == (2, 1) and "hazards.jsonl" in error
