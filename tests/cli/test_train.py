from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from cli.calling import Call
from training.small_runs import CFG, write_data

_SETTINGS: dict[str, object] = {
    "steps": 4, "batch": 2, "size_px": [96, 64], "warmup_steps": 1, "bf16": False, "workers": 0, "validate_every": 4,
    "validate_pictures": 4, "checkpoint_every": 4, "augment": {"mosaic": 0.0},
}  # fmt: skip


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    write_data(tmp_path / "blocks")
    (tmp_path / "small.cfg").write_text(CFG)
    path = tmp_path / "plan.yaml"
    path.write_text(yaml.safe_dump({"data": "blocks", "arch": "small.cfg", "train": _SETTINGS}))
    return path


def test_a_plan_becomes_a_detector(call: Call, plan: Path, tmp_path: Path) -> None:
    code, out, err = call("train", "--config", plan, "--out", tmp_path / "run", "--quiet")
    assert code == 0, err
    assert "model-card.md" in out
    assert (tmp_path / "run" / "model.onnx").is_file()
    code, _, err = call("train", "--config", plan, "--out", tmp_path / "run")
    assert code == 2 and "--resume" in err
    assert call("train", "--resume", "--out", tmp_path / "run", "--set", "steps=8")[0] == 0
    table = (tmp_path / "run" / "table.md").read_text().splitlines()
    assert [line.split("|")[1].strip() for line in table[2:]] == ["4", "8"]


def test_the_command_line_goes_before_the_file(call: Call, plan: Path, tmp_path: Path) -> None:
    code, out, _ = call(
        "train", "--config", plan, "--out", tmp_path / "run", "--show-settings", "--arch", "yolov3-tiny",
        "--set", "steps=77", "--set", "augment.haze=0.5", "--set", "scales=[1.0, 1.5]",
    )  # fmt: skip
    shown = yaml.safe_load(out)
    assert code == 0
    assert (shown["arch"], shown["train"]["steps"], shown["train"]["batch"]) == ("yolov3-tiny", 77, 2)
    assert (shown["train"]["augment"]["haze"], shown["train"]["augment"]["mosaic"]) == (0.5, 0.0)
    assert shown["train"]["scales"] == [1.0, 1.5]
    assert not (tmp_path / "run").exists()


def test_what_a_run_writes_down_can_be_given_back(call: Call, plan: Path, tmp_path: Path) -> None:
    first = call("train", "--config", plan, "--out", tmp_path / "run", "--show-settings")[1]
    written = tmp_path / "written.yaml"
    written.write_text(first)
    second = call("train", "--config", written, "--out", tmp_path / "run", "--show-settings")[1]
    assert yaml.safe_load(second) == yaml.safe_load(first)


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["--set", "steps=-3"], "steps"),
        (["--set", "stepps=3"], "stepps"),
        (["--set", "augment.fog=1"], "fog"),
        (["--set", "augment.mosaic=1.5"], "mosaic"),
        (["--set", "loss.box=giou"], "giou"),
        (["--set", "steps"], "NAME=VALUE"),
        (["--arch", "yolov9"], "yolov9"),
        (["--weights", "nowhere.weights"], "nowhere.weights"),
        (["--set", "size_px=[100, 64]"], "96x64"),
        (["--set", "warmup_steps=99"], "warmup_steps"),
    ],
)
def test_a_mistake_is_one_line_and_writes_nothing(
    call: Call, plan: Path, tmp_path: Path, words: list[str], found: str
) -> None:
    code, _, err = call("train", "--config", plan, "--out", tmp_path / "run", *words)
    assert code == 2
    assert found in err and len(err.strip().splitlines()) == 1
    assert not (tmp_path / "run").exists()


def test_a_misspelt_section_of_the_file_is_refused(call: Call, plan: Path, tmp_path: Path) -> None:
    plan.write_text(plan.read_text().replace("train:", "training:"))
    code, _, err = call("train", "--config", plan, "--out", tmp_path / "run")
    assert code == 2 and "training" in err


def test_without_data_it_says_so(call: Call, tmp_path: Path) -> None:
    code, _, err = call("train", "--out", tmp_path / "run")
    assert code == 2 and "labelled pictures" in err
