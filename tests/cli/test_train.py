from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from cli.calling import Call
from training.small_runs import CFG, write_data

_SETTINGS: dict[str, object] = {
    "steps": 4, "batch": 2, "size_px": [96, 64], "warmup_steps": 1, "bf16": False, "workers": 0, "validate_every": 4,
    "validate_pictures": 4, "checkpoint_every": 4, "augment": {"mosaic": 0.0},
}  # fmt: skip


@pytest.fixture(autouse=True)
def plain_curves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw no curves, which takes half of a short run: the tests of a run look at them."""
    monkeypatch.setattr("standoff.training.run.training_folder.draw_curves", lambda rows, classes, path: path.touch())


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
        (["--set", "size_px=[640,384"], "size_px=[640,384"),
        (["--set", "loss=x", "--set", "loss.box=squared"], "`loss`"),
        (["--set", "augment.any_rotation_sources=[flights]"], "flights"),
    ],
)
def test_a_mistake_is_one_line_and_writes_nothing(
    call: Call, plan: Path, tmp_path: Path, words: list[str], found: str
) -> None:
    code, _, err = call("train", "--config", plan, "--out", tmp_path / "run", *words)
    assert code == 2
    assert found in err and len(err.strip().splitlines()) == 1
    assert not (tmp_path / "run").exists()


def test_a_wrong_train_setting_is_not_answered_with_the_settings_of_the_monitor(
    call: Call, plan: Path, tmp_path: Path
) -> None:
    err = call("train", "--config", plan, "--out", tmp_path / "run", "--set", "stepps=3")[2]
    assert "--show-settings" in err and "config show" not in err


@pytest.mark.parametrize("section", ["", "[1]", "x"])
def test_a_section_without_settings_is_no_section_and_another_value_is_refused(
    call: Call, plan: Path, tmp_path: Path, section: str
) -> None:
    plan.write_text(f"data: blocks\narch: small.cfg\ntrain: {section}\n")
    words = ("train", "--config", plan, "--out", tmp_path / "run", "--show-settings")
    for more in ((), ("--set", "steps=700")):
        code, out, err = call(*words, *more)
        if section:
            assert code == 2 and "`train`" in err and err.count("\n") == 1
        else:
            assert code == 0 and yaml.safe_load(out)["train"]["steps"] == (700 if more else 20_000)


def test_a_run_is_repeated_from_its_record_in_any_folder(
    call: Call, plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    settings = [word for name, value in _SETTINGS.items() if name != "augment" for word in ("--set", f"{name}={value}")]
    assert call("train", "blocks", "--arch", "small.cfg", "--out", "runs/first", *settings)[0] == 0
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    code, _, err = call("train", "--config", "../runs/first/run.yaml", "--out", "../runs/second")
    assert code == 0, err
    weights = [(tmp_path / "runs" / run / "best.weights").read_bytes() for run in ("first", "second")]
    assert weights[0] == weights[1]
    assert call("train", "--resume", "--out", "../runs/second", "--set", "steps=6")[0] == 0


def test_variables_and_the_home_folder_are_filled_in_for_a_cfg_too(
    call: Call, plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NETS", str(tmp_path))
    plan.write_text(plan.read_text().replace("arch: small.cfg", "arch: $NETS/small.cfg"))
    out = call("train", "--config", plan, "--out", tmp_path / "run", "--show-settings")[1]
    assert yaml.safe_load(out)["arch"] == str(tmp_path / "small.cfg")


def test_a_record_with_the_people_of_an_older_version_is_still_read(call: Call, plan: Path, tmp_path: Path) -> None:
    plan.write_text(plan.read_text().replace("mosaic: 0.0", "mosaic: 0.0\n    person_classes:\n    - 0"))
    out = call("train", "--config", plan, "--out", tmp_path / "run", "--show-settings")[1]
    assert yaml.safe_load(out)["train"]["augment"]["person_classes"] == [0]


def test_a_resumed_run_takes_no_other_plan(call: Call, plan: Path, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "run.yaml").write_text(plan.read_text())
    for words in (("--config", plan), ("--arch", "yolov3"), ("--weights", "a.weights")):
        code, _, err = call("train", "--resume", "--out", tmp_path / "run", *words)
        assert code == 2 and words[0] in err and len(err.strip().splitlines()) == 1


@pytest.mark.parametrize("content", ["data: [", "- 1", ""])
def test_a_damaged_record_is_one_line(call: Call, tmp_path: Path, content: str) -> None:
    (tmp_path / "run.yaml").write_text(content)
    code, _, err = call("train", "--resume", "--out", tmp_path)
    assert code == 2 and len(err.strip().splitlines()) == 1


@pytest.mark.live
def test_several_processes_start_as_documented_and_one_of_them_speaks(plan: Path, tmp_path: Path) -> None:
    launch = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2", "-m", "standoff"]
    done = subprocess.run(
        [*launch, "train", "--config", str(plan), "--out", str(tmp_path / "run")],
        check=True, env={**os.environ, "OMP_NUM_THREADS": "1"}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.stdout.count("best mAP") == 1
    assert done.stderr.count("convolutions from") == 1


def test_a_misspelt_section_of_the_file_is_refused(call: Call, plan: Path, tmp_path: Path) -> None:
    plan.write_text(plan.read_text().replace("train:", "training:"))
    code, _, err = call("train", "--config", plan, "--out", tmp_path / "run")
    assert code == 2 and "training" in err


def test_without_data_it_says_so(call: Call, tmp_path: Path) -> None:
    code, _, err = call("train", "--out", tmp_path / "run")
    assert code == 2 and "labelled pictures" in err


@pytest.mark.parametrize("in_file", [True, False])
def test_the_shipped_detector_is_a_start_by_its_name(call: Call, plan: Path, tmp_path: Path, in_file: bool) -> None:
    if in_file:
        plan.write_text(plan.read_text() + "weights: site\n")
    words = () if in_file else ("--weights", "site")
    code, out, _ = call("train", "--config", plan, "--out", tmp_path / "run", "--show-settings", *words)
    weights = Path(yaml.safe_load(out)["weights"])
    assert code == 0 and weights.name == "site.onnx" and weights.is_file()


def test_a_preset_is_shown_changed_and_used_alone(call: Call, plan: Path, tmp_path: Path) -> None:
    words = ("train", tmp_path / "blocks", "--preset", "my-site", "--out", tmp_path / "run")
    code, out, _ = call(*words, "--set", "steps=77", "--show-settings")
    shown = yaml.safe_load(out)
    assert (code, shown["arch"], shown["train"]["steps"], shown["train"]["batch"]) == (0, "efficientnet-lite0", 77, 8)
    assert shown["weights"].endswith("site.onnx")
    code, _, err = call(*words, "--config", plan)
    assert code == 2 and "--config and --preset" in err and err.count("\n") == 1
    code, _, err = call(*words[:2], *words[2:], "--set", "learning_rat=1")
    assert code == 2 and "preset my-site" in err and err.count("\n") == 1
    assert not (tmp_path / "run").exists()
