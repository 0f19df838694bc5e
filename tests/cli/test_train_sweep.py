from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from cli.calling import Call
from training.small_runs import CFG, write_data

_TRAIN: dict[str, object] = {
    "steps": 4, "batch": 2, "size_px": [96, 64], "warmup_steps": 1, "bf16": False, "workers": 0, "validate_every": 4,
    "validate_pictures": 4, "checkpoint_every": 4, "augment": {"mosaic": 0.0},
}  # fmt: skip
_TOO_MUCH = {"optimizer": "sgd", "learning_rate": 1e30, "clip_norm": 1e30}


@pytest.fixture(autouse=True)
def plain_curves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw no curves, which takes half of a short run."""
    monkeypatch.setattr("standoff.training.run.training_folder.draw_curves", lambda rows, classes, path: path.touch())
    monkeypatch.setattr("standoff.training.sweep.sweep_folder.draw_sweep", lambda results, path: path.touch())


@pytest.fixture
def sweep(tmp_path: Path) -> Path:
    write_data(tmp_path / "blocks")
    (tmp_path / "small.cfg").write_text(CFG)
    path = tmp_path / "sweep.yaml"
    scenarios = {"too_much": {"train": _TOO_MUCH}, "slow": {"train": {"learning_rate": 1e-4}}}
    plan = {"data": "blocks", "arch": "small.cfg", "train": _TRAIN, "scenarios": scenarios}
    path.write_text(yaml.safe_dump(plan, sort_keys=False))
    return path


@pytest.mark.live
def test_a_sweep_ends_with_a_table_and_each_scenario_is_a_run_that_can_be_repeated(
    call: Call, sweep: Path, tmp_path: Path
) -> None:
    code, out, err = call("train", "--sweep", sweep, "--out", tmp_path / "out", "--quiet")
    assert code == 1, err
    assert "slow (2 of 2): step 4: loss" in err
    assert "learning_rate 0.0001" in out and "expected a finite loss" in " ".join(out.split())
    states = [one["state"] for one in json.loads((tmp_path / "out" / "sweep.json").read_text())["scenarios"]]
    assert states == ["failed", "finished"]
    run = tmp_path / "out" / "slow"
    assert call("train", "--config", run / "run.yaml", "--out", tmp_path / "again", "--quiet")[0] == 0
    assert (tmp_path / "again" / "best.weights").read_bytes() == (run / "best.weights").read_bytes()


def test_the_plans_of_a_sweep_can_be_shown(call: Call, sweep: Path, tmp_path: Path) -> None:
    code, out, _ = call(
        "train", "--sweep", sweep, "--out", tmp_path / "out", "--show-settings", "--set", "augment.haze=0.5"
    )
    shown = yaml.safe_load(out)
    assert code == 0
    assert (shown["train"]["steps"], shown["train"]["augment"]["haze"]) == (4, 0.5)
    assert shown["scenarios"]["slow"] == {"train": {"learning_rate": 1e-4}}
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["--set", "stepps=3"], "stepps"),
        (["--arch", "yolov9"], "yolov9"),
        (["--config", "plan.yaml"], "--config"),
        (["--resume"], "no sweep.yaml"),
    ],
)
def test_a_mistake_is_one_line_and_writes_nothing(
    call: Call, sweep: Path, tmp_path: Path, words: list[str], found: str
) -> None:
    code, _, err = call("train", "--sweep", sweep, "--out", tmp_path / "out", *words)
    assert code == 2
    assert found in err and len(err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_misspelt_setting_of_the_last_scenario_is_told_at_once(call: Call, sweep: Path, tmp_path: Path) -> None:
    sweep.write_text(sweep.read_text() + "  last: {train: {augment: {fog: 1}}}\n")
    code, _, err = call("train", "--sweep", sweep, "--out", tmp_path / "out")
    assert code == 2 and "fog" in err and "scenario last" in err and err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.live
def test_several_processes_agree_on_what_is_left_of_a_sweep(sweep: Path, tmp_path: Path) -> None:
    plan = yaml.safe_load(sweep.read_text())
    plan["scenarios"] = {"as_shared": None, "slow": {"train": {"learning_rate": 1e-4}}}
    sweep.write_text(yaml.safe_dump(plan, sort_keys=False))
    launch = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2", "-m", "standoff"]
    words = [*launch, "train", "--sweep", str(sweep), "--out", str(tmp_path / "out")]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    subprocess.run(words, check=True, env=environment, capture_output=True)
    (tmp_path / "out" / "slow" / "model.onnx").unlink()
    done = subprocess.run([*words, "--resume"], check=True, env=environment, capture_output=True, text=True)
    assert done.stderr.count("as_shared is finished") == 1
    assert done.stdout.count("On validation pictures") == 1
    assert (tmp_path / "out" / "slow" / "model.onnx").is_file()
