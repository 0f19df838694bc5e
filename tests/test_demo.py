"""The film that comes with standoff, and `standoff demo` on films of the tests' own."""

from __future__ import annotations

import json
from importlib.resources import files
from itertools import islice
from pathlib import Path

import av
import numpy as np
import pytest
from cli.calling import Call
from evaluation.paper import drawn_clip
from tolerances import CODED_FRAME_LEVELS, SCENE_DISTANCE_M

from standoff.core.classes import CLASSES
from standoff.core.errors import ModelError
from standoff.evaluation.paper import Clip, load_clip
from standoff.evaluation.paper.truth_detector import TrueBoxes
from standoff.stages.detect import find_model

FILM = Path(str(files("standoff"))) / "demo"
BUFFER_M = 1.0


@pytest.fixture(scope="module")
def film() -> Clip:
    return load_clip(FILM)


def least_gaps_m(clip: Clip) -> list[float]:
    reach_m = [CLASSES[class_id].action_radius_m for class_id in clip.class_id]
    pairs = clip.pairs.tolist()
    return sorted(
        float(np.nanmin(distance_m)) - reach_m[one] - reach_m[other]
        for (one, other), distance_m in zip(pairs, clip.distance_m.T, strict=True)
    )


def test_the_film_shows_one_breach_and_one_near_miss_and_nothing_else_is_close(film: Clip) -> None:
    breach_m, near_miss_m, *others_m = least_gaps_m(film)
    assert breach_m < -1.0
    assert 0.3 < near_miss_m < BUFFER_M - 0.3
    assert len(others_m) == 4 and min(others_m) > BUFFER_M + 1.0


def test_the_film_is_small_and_shows_everybody_all_the_time(film: Clip) -> None:
    assert (FILM / "video.mp4").stat().st_size < 8_000_000
    assert [CLASSES[class_id].name for class_id in film.class_id].count("worker") == 3
    assert np.isfinite(film.box_px).all()
    heights_px = (film.box_px[..., 3] - film.box_px[..., 1])[:, film.class_id == 0]
    assert heights_px.min() > 30 and np.median(heights_px) < 65
    assert film.reference is not None
    assert film.reference.visible_share.min() > 0.99
    assert ((film.reference.corners_px > 0) & (film.reference.corners_px < (1920, 1080))).all()
    with av.open(str(FILM / "video.mp4")) as container:
        stream = container.streams.video[0]
        assert (stream.width, stream.height) == (1920, 1080)
        assert sum(1 for _ in container.decode(stream)) == film.frame_count == 250
        assert float(stream.average_rate or 0) == pytest.approx(25.0)


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("frame", [3, 200])
def test_the_film_can_be_rendered_again(film: Clip, frame: int) -> None:
    from standoff.simulation.presets import plan_clip
    from standoff.simulation.record import open_shooter

    plan = plan_clip("demo", seed=film.seed)
    with open_shooter(plan) as shoot:
        shot = shoot((frame, frame / plan.preset.fps))
    with av.open(str(FILM / "video.mp4")) as container:
        coded = next(islice(container.decode(video=0), frame, None)).to_ndarray(format="bgr24")
    assert np.abs(shot.image.astype(np.float64) - coded).mean() < CODED_FRAME_LEVELS
    places_m = {row["entity_id"]: (row["x_m"], row["y_m"]) for row in shot.entities}
    for entity_id, xy_m in zip(film.entity_id.tolist(), film.xy_m[frame], strict=True):
        assert places_m[entity_id] == pytest.approx(xy_m, abs=SCENE_DISTANCE_M)


@pytest.fixture
def drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Clip:
    """A quick film in place of the shipped one, and a detector that knows it."""
    clip = load_clip(drawn_clip.write_clip(tmp_path / "standoff" / "demo"))
    monkeypatch.setattr("standoff.cli.demo.files", lambda package: tmp_path / package)
    monkeypatch.setattr("standoff.config.build.find_model", lambda model: model)
    monkeypatch.setattr("standoff.config.build.OnnxDetector", lambda path, params: TrueBoxes(clip))
    return clip


def test_the_demo_writes_all_outputs_and_prints_how_far_off_it_is(drawn: Clip, tmp_path: Path, call: Call) -> None:
    out = tmp_path / "out"
    code, said, _ = call("demo", "--out", out, "--json", tmp_path / "found.json")
    assert code == 0
    made = {path.name for path in out.iterdir()}
    assert made >= {"report.html", "annotated.mp4", "run.json", "tracks.parquet", "proximity.parquet", "hazards.jsonl"}
    for words in (
        "complete",
        "recall",
        "MADE",
        "what really happened",
        "False warnings",
        "report.html",
        "annotated.mp4",
    ):
        assert words in " ".join(said.split())
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["frames"] == drawn.frame_count
    assert {one["kind"] for one in found["encounters"]} == {"breach"}


def test_machines_get_only_json(drawn: Clip, tmp_path: Path, call: Call) -> None:
    code, said, _ = call("demo", "--out", tmp_path / "out", "--json", "-")
    assert code == 0
    assert json.loads(said)["frames"] == drawn.frame_count


def test_an_earlier_run_is_kept_unless_it_may_be_replaced(drawn: Clip, tmp_path: Path, call: Call) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "run.json").write_text("{}")
    code, _, error = call("demo", "--out", out)
    assert (code, error.count("\n")) == (2, 1)
    assert "run.json" in error and "--overwrite" in error
    assert call("demo", "--out", out, "--overwrite")[0] == 0


@pytest.mark.parametrize("lost", ["video.mp4", "truth.parquet", "reference.yaml"])
def test_a_broken_installation_is_one_line(drawn: Clip, tmp_path: Path, call: Call, lost: str) -> None:
    (drawn.folder / lost).unlink()
    code, _, error = call("demo", "--out", tmp_path / "out")
    assert (code, error.count("\n")) == (2, 1)
    assert lost in error and "nstall standoff again" in error
    assert not (tmp_path / "out").exists()


def test_the_shipped_detector_sees_the_breach_and_the_near_miss(tmp_path: Path, call: Call) -> None:
    try:
        find_model("site")
    except ModelError as absent:
        pytest.skip(str(absent))
    assert call("demo", "--out", tmp_path / "out", "--json", tmp_path / "found.json")[0] == 0
    found = json.loads((tmp_path / "found.json").read_text())
    assert all(one["recognised"] for one in found["encounters"])
    assert found["false_hazards"] == []
