from __future__ import annotations

import json
import shutil
from pathlib import Path

import drawn_clip
import pytest
from cli.calling import Call
from evaluation.paper.test_paper_recorded import record_truth

from standoff.clips import Clip, load_clip
from standoff.evaluation.paper.truth_detector import TrueBoxes

pytestmark = pytest.mark.live  # each goes through a whole film


@pytest.fixture(scope="module")
def drawn_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return drawn_clip.write_clip(tmp_path_factory.mktemp("clips") / "drawn")


@pytest.fixture
def drawn(drawn_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Clip:
    """A quick film in place of the shipped one, and a detector that knows it."""
    clip = load_clip(shutil.copytree(drawn_folder, tmp_path / "standoff" / "demo"))
    monkeypatch.setattr("standoff.cli.demo.files", lambda package: tmp_path / package)
    monkeypatch.setattr("standoff.config.build.find_model", lambda model: model)
    monkeypatch.setattr("standoff.config.build.OnnxDetector", lambda path, params: TrueBoxes(clip))
    return clip


@pytest.fixture(autouse=True)
def nobody_watches_the_scale(monkeypatch: pytest.MonkeyPatch) -> None:
    """The drawn clip's people and machines have no height: the watch over the scale would refuse its metres."""
    monkeypatch.setattr("standoff.config.build.ScaleWatch", lambda inner, _camera: inner)


def test_the_demo_writes_all_outputs_and_prints_how_far_off_it_is(drawn: Clip, tmp_path: Path, call: Call) -> None:
    """It runs the defaults and the paper's method on the same boxes; an earlier run is kept unless it may go."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "run.json").write_text("{}")
    code, _, error = call("demo", "--out", out)
    assert (code, error.count("\n")) == (2, 1)
    assert "run.json" in error and "--overwrite" in error
    code, said, _ = call("demo", "--out", out, "--overwrite", "--json", tmp_path / "found.json")
    assert code == 0
    made = {path.name for path in out.iterdir()}
    assert made >= {"report.html", "annotated.mp4", "run.json", "tracks.parquet", "proximity.parquet", "hazards.jsonl"}
    for words in ("complete", "recall", "MADE", " of 2 recognised", "False warnings", "report.html", "annotated.mp4"):
        assert words in said
    assert "the paper's method" in said and "frames with a map" in said and "inside 68, 95 %" in said
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "How true the stated errors are" in page and "not checked on your site" not in page
    found, record = json.loads((tmp_path / "found.json").read_text()), json.loads((out / "run.json").read_text())
    assert found["frames"] == drawn.frame_count
    assert {one["kind"] for one in found["encounters"]} == {"breach"}
    assert record["settings"]["ground"]["reference"]["params"]["method"] == "fused"
    assert record["settings"]["locate"]["anchor"] == "ground_point"
    # What lies on the square for a moment hides it from the paper's method, not from one that follows the picture.
    assert found["frames_with_map"] == drawn.frame_count
    assert found["paper"]["frames_with_map"] == drawn.frame_count - len(drawn_clip.HIDDEN)
    assert found["map_only"]["level"]["p95_m"] < found["paper"]["map_only"]["level"]["p95_m"]


def test_an_earlier_demo_can_be_replayed_and_machines_get_only_json(
    drawn: Clip, tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = record_truth(drawn.folder, tmp_path / "first")
    monkeypatch.setattr("standoff.config.build.OnnxDetector", None)
    words = ("demo", "--out", tmp_path / "again", "--detections", first, "--json", "-")
    code, said, _ = call(*words)
    assert (code, json.loads(said)["frames"]) == (0, drawn.frame_count)
    assert call(*words, "--model", "site")[0] == 2


@pytest.mark.parametrize("lost", ["video.mp4", "truth.parquet", "reference.yaml"])
def test_a_broken_installation_is_one_line(drawn: Clip, tmp_path: Path, call: Call, lost: str) -> None:
    (drawn.folder / lost).unlink()
    code, _, error = call("demo", "--out", tmp_path / "out")
    assert (code, error.count("\n")) == (2, 1)
    assert lost in error and "nstall standoff again" in error
    assert not (tmp_path / "out").exists()


def test_the_shipped_detector_sees_the_breach_and_the_near_miss(tmp_path: Path, call: Call) -> None:
    assert call("demo", "--out", tmp_path / "out", "--json", tmp_path / "found.json")[0] == 0
    found = json.loads((tmp_path / "found.json").read_text())
    assert all(one["recognised"] for one in found["encounters"])
    assert found["false_hazards"] == []
