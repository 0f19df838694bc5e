"""examples/detector/pack_training.py: a training goes to another machine and is trained there."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest
import yaml
from training.small_runs import CFG, write_data

import standoff
from standoff.labels import read_data

sys.path.insert(0, str(Path(__file__).parents[1] / "examples" / "detector"))
import pack_training

_SETTINGS: dict[str, object] = {
    "steps": 400, "batch": 2, "size_px": [96, 64], "warmup_steps": 50, "bf16": False, "workers": 0,
    "validate_pictures": 4, "augment": {"mosaic": 0.0, "any_rotation_sources": ["drawn"]},
}  # fmt: skip


@pytest.fixture
def plan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A plan whose mixture names a set of links elsewhere, by a variable, and regions in which nothing is known."""
    monkeypatch.setenv("ELSEWHERE", str(tmp_path / "elsewhere"))
    real = write_data(tmp_path / "disk")
    here = tmp_path / "elsewhere" / "blocks"
    for path in sorted(real.rglob("*.*")):
        link = here / path.relative_to(real)
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(path)
    folder = tmp_path / "plan"
    folder.mkdir()
    (folder / "small.cfg").write_text(CFG)
    (folder / "parked.yaml").write_text(yaml.safe_dump({"scene1_0": [[0, 0, 20, 20]]}))
    source = {"path": "$ELSEWHERE/blocks", "name": "drawn", "weight": 2.0, "ignore_regions": "parked.yaml"}
    write_mixture(folder, source)
    path = folder / "plan.yaml"
    path.write_text(yaml.safe_dump({"data": "mixture.yaml", "arch": "small.cfg", "train": _SETTINGS}))
    return path


def write_mixture(folder: Path, *sources: object) -> None:
    (folder / "mixture.yaml").write_text(yaml.safe_dump({"sources": list(sources)}))


@pytest.fixture
def wheel(tmp_path: Path) -> Path:
    """Stand in for a wheel, which takes a network and seconds to build."""
    path = tmp_path / "standoff-0.1.0-py3-none-any.whl"
    path.write_bytes(b"wheel")
    return path


def pack(*words: object) -> int:
    return pack_training.main([str(word) for word in words])


def unpack(archive: Path, folder: Path) -> Path:
    with tarfile.open(archive) as opened:
        opened.extractall(folder, filter="data")
    return folder / archive.stem


def test_what_is_packed_is_read_the_same_anywhere(
    plan: Path, wheel: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = read_data(plan.parent / "mixture.yaml")
    assert pack("--config", plan, "--out", tmp_path / "small.tar", "--wheel", wheel) == 0
    assert "small/run.sh" in capsys.readouterr().out
    there = unpack(tmp_path / "small.tar", tmp_path / "there")
    for gone in ("elsewhere", "disk", "plan"):
        shutil.rmtree(tmp_path / gone)
    after = read_data(there / "mixture.yaml")
    assert {split: len(pictures) for split, pictures in after.splits.items()} == {"train": 16, "val": 8, "test": 0}
    for split in ("train", "val"):
        for one, two in zip(before.splits[split], after.splits[split], strict=True):
            assert (one.path.name, one.group, one.weight) == (two.path.name, two.group, two.weight)
            assert one.xyxy_px.tolist() == two.xyxy_px.tolist() and one.ignored.tolist() == two.ignored.tolist()
            assert two.path.is_relative_to(there) and not two.path.is_symlink()
    written = {name: (there / name).read_text() for name in ("plan.yaml", "mixture.yaml", "packed.json")}
    assert not [name for name, text in written.items() if str(tmp_path) in text]
    packed = yaml.safe_load(written["plan.yaml"])
    assert (packed["data"], packed["arch"], packed["train"]["steps"]) == ("mixture.yaml", "arch/small.cfg", 400)
    assert (there / packed["arch"]).read_text() == CFG
    assert json.loads(written["packed.json"])["pictures"]["train"] == 16
    needed = (there / "requirements.txt").read_text().split("\n")
    assert f"./{wheel.name}" in needed and not [one for one in needed if one.startswith("torch")]
    assert os.access(there / "run.sh", os.X_OK) and (there / "requirements.lock").is_file()


def test_a_shipped_detector_stays_a_name_and_weights_bring_what_they_know(
    plan: Path, wheel: Path, tmp_path: Path
) -> None:
    given = yaml.safe_load(plan.read_text())
    plan.write_text(yaml.safe_dump(given | {"weights": "site"}))
    assert pack("--config", plan, "--out", tmp_path / "one.tar", "--wheel", wheel) == 0
    assert yaml.safe_load((unpack(tmp_path / "one.tar", tmp_path) / "plan.yaml").read_text())["weights"] == "site"
    run = tmp_path / "run"
    run.mkdir()
    for name in ("best.weights", "network.cfg", "classes.names"):
        (run / name).write_text(name)
    plan.write_text(yaml.safe_dump(given | {"weights": "../run/best.weights"}))
    assert pack("--config", plan, "--out", tmp_path / "two.tar", "--wheel", wheel) == 0
    there = unpack(tmp_path / "two.tar", tmp_path)
    assert yaml.safe_load((there / "plan.yaml").read_text())["weights"] == "weights/best.weights"
    assert sorted(path.name for path in (there / "weights").iterdir()) == [
        "best.weights",
        "classes.names",
        "network.cfg",
    ]


def test_a_recipe_is_packed_in_place_of_the_pictures(plan: Path, wheel: Path, tmp_path: Path) -> None:
    write_mixture(plan.parent, {"path": "$DATA/sim-0", "name": "drawn"}, {"path": "${DATA}/streets", "split": "train"})
    simulator = wheel.with_name("standoff_sim-0.1.0-py3-none-any.whl")
    simulator.write_bytes(b"wheel")
    words = ("--wheel", wheel, "--recipe", "--simulator-wheel", simulator)
    assert pack("--config", plan, "--out", tmp_path / "recipe.tar", *words) == 0
    there = unpack(tmp_path / "recipe.tar", tmp_path)
    sources = yaml.safe_load((there / "mixture.yaml").read_text())["sources"]
    assert [source["path"] for source in sources] == ["data/sim-0", "data/streets"]
    assert {"make_data.sh", "people.yaml", "label_people.py"} <= {path.name for path in (there / "recipe").iterdir()}
    assert f"./{simulator.name}" in (there / "requirements.txt").read_text() and (there / simulator.name).is_file()
    environment = {name: value for name, value in os.environ.items() if name != "SHARED"} | {"PYTHON": sys.executable}
    done = subprocess.run([there / "run.sh"], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "set SHARED" in done.stderr


@pytest.mark.parametrize(
    ("changes", "words", "found"),
    [
        ({"weights": "nowhere.weights"}, (), "nowhere.weights"),
        ({"arch": "yolov9"}, (), "yolov9"),
        ({"arch": "nowhere.cfg"}, (), "nowhere.cfg"),
        ({"data": "nowhere"}, (), "nowhere"),
        ({"train": {"stepps": 3}}, (), "stepps"),
        ({}, ("--recipe",), "$ELSEWHERE/blocks"),
        ({}, ("--torch",), "no --wheels"),
        ({}, ("--wheel", "nowhere.whl"), "nowhere.whl"),
    ],
)
def test_what_is_missing_is_refused_in_one_line(
    plan: Path,
    wheel: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    changes: dict[str, object],
    words: tuple[str, ...],
    found: str,
) -> None:
    plan.write_text(yaml.safe_dump(yaml.safe_load(plan.read_text()) | changes))
    out = tmp_path / "out" / "small.tar"
    out.parent.mkdir()
    assert pack("--config", plan, "--out", out, "--wheel", wheel, *words) == 2
    said = capsys.readouterr().err
    assert said.startswith("pack_training: expected") and said.count("\n") == 1 and found in said
    assert not list(out.parent.iterdir())


@pytest.mark.parametrize("out", ["small.zip", "nowhere/small.tar"])
def test_the_archive_needs_a_place(plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], out: str) -> None:
    assert pack("--config", plan, "--out", tmp_path / out) == 2
    assert "NAME.tar" in capsys.readouterr().err


def test_pictures_outside_their_set_are_refused(
    plan: Path, wheel: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    listing = tmp_path / "elsewhere" / "lists"
    listing.mkdir()
    content = yaml.safe_load((tmp_path / "disk" / "data.yaml").read_text())
    content |= {"path": str(tmp_path / "disk")}
    (listing / "data.yaml").write_text(yaml.safe_dump(content))
    write_mixture(plan.parent, {"path": "$ELSEWHERE/lists", "name": "drawn"})
    assert pack("--config", plan, "--out", tmp_path / "small.tar", "--wheel", wheel) == 2
    said = capsys.readouterr().err
    assert "pictures inside the data sets" in said and str(tmp_path / "disk") in said


def test_a_link_to_nothing_is_named(
    plan: Path, wheel: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "elsewhere" / "blocks" / "notes.txt").symlink_to(tmp_path / "gone")
    assert pack("--config", plan, "--out", tmp_path / "small.tar", "--wheel", wheel) == 2
    said = capsys.readouterr().err
    assert "notes.txt" in said and "a link to nothing" in said


@pytest.mark.live
def test_a_packed_training_is_unpacked_and_trained_for_ten_steps(plan: Path, tmp_path: Path) -> None:
    assert pack("--config", plan, "--out", tmp_path / "small.tar") == 0
    there = unpack(tmp_path / "small.tar", tmp_path / "there")
    assert list(there.glob("standoff-*.whl"))
    shutil.rmtree(tmp_path / "elsewhere")
    # The standoff of this test, wherever it is started from.
    source = str(Path(standoff.__file__).parents[1])
    environment = {**os.environ, "PYTHON": sys.executable, "PYTHONPATH": source, "STEPS": "10"}
    done = subprocess.run([there / "run.sh"], cwd="/", env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "DIFFERS" not in done.stdout and (there / "compared.json").is_file()
    assert [row["step"] for row in json.loads((there / "run" / "history.json").read_text())] == [10]
    assert (there / "run" / "model.onnx").is_file()
    environment["STEPS"] = "12"
    done = subprocess.run([there / "run.sh"], cwd="/", env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "absent" not in done.stdout, done.stderr
