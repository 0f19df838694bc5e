from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import pytest
import torch
import yaml
from training.small_runs import CFG, write_data

from standoff.core.errors import ConfigError, DataError, ModelError, OutputError
from standoff.labels import LabelledData
from standoff.training.run.loop import Progress
from standoff.training.run.plan import Overrides, RunPlan
from standoff.training.run.train import Listener
from standoff.training.sweep.figure import draw_sweep
from standoff.training.sweep.results import Result, table_of
from standoff.training.sweep.scenarios import Sweep, read_sweep, words_of
from standoff.training.sweep.sweep import SweepListener, run_sweep

_TRAIN: dict[str, object] = {
    "steps": 4, "batch": 2, "size_px": [96, 64], "warmup_steps": 1, "bf16": False, "workers": 0, "validate_every": 4,
    "validate_pictures": 4, "checkpoint_every": 4, "augment": {"mosaic": 0.0, "haze": 0.3},
}  # fmt: skip
_SCENARIOS: dict[str, object] = {
    "as_shared": None,
    "slow": {"train": {"learning_rate": 1e-4}},
    "no_haze": {"train": {"augment": {"haze": 0.0}}},
}

WriteSweep = Callable[..., Path]


@pytest.fixture(autouse=True)
def plain_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw no curves: the test of the figure looks at them."""
    monkeypatch.setattr("standoff.training.sweep.sweep_folder.draw_sweep", lambda results, path: path.touch())


@pytest.fixture(scope="session")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_data(tmp_path_factory.mktemp("blocks"))


@pytest.fixture
def write_sweep(tmp_path: Path, blocks: Path) -> WriteSweep:
    """Write a sweep file; give its path."""
    (tmp_path / "small.cfg").write_text(CFG)

    def write(scenarios: object = _SCENARIOS, **other: object) -> Path:
        path = tmp_path / "sweep.yaml"
        shared = {"data": str(blocks), "arch": "small.cfg", "train": _TRAIN}
        path.write_text(yaml.safe_dump({**shared, "scenarios": scenarios, **other}, sort_keys=False))
        return path

    return write


class _Runs:
    """Stands for the training of a scenario: notes which, and leaves what a run leaves."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.called: list[tuple[str, bool]] = []
        self.messages: list[str] = []
        self.failing: dict[str, Exception | KeyboardInterrupt] = {}
        self.saves = True
        monkeypatch.setattr("standoff.training.sweep.sweep.train_on", self._train)
        # Anchors take half a second; the test of what does not fit the data finds them.
        monkeypatch.setattr("standoff.training.sweep.sweep.compose_start", lambda plan, data: None)
        # So does looking through all that torch has loaded; nothing here is large.
        monkeypatch.setattr("standoff.training.sweep.sweep.gc.collect", lambda: 0)

    def start(self, sweep: Sweep, out: Path, *, resumes: bool = False) -> tuple[Result, ...]:
        self.called.clear()
        run = Listener(self.messages.append, lambda *_: None, lambda _: None)
        return run_sweep(sweep, out, SweepListener(self.messages.append, lambda _: run), resumes=resumes)

    def _train(
        self, data: LabelledData, plan: RunPlan, out: Path, listener: Listener, *, resumes: bool = False
    ) -> Progress:
        assert data.splits["val"]
        assert resumes or not out.exists()
        self.called.append((out.name, resumes))
        (out / "checkpoints").mkdir(parents=True, exist_ok=True)
        row = {"step": plan.params.steps, "map": 0.5, "average_iou": 0.6, "ap_worker": 0.5, "ap_vehicle": None}
        (out / "history.json").write_text(json.dumps([row]))
        listener.on_row(row)
        if self.saves:
            (out / "checkpoints" / "step-0000004.pt").touch()
        if out.name in self.failing:
            raise self.failing[out.name]
        (out / "model.onnx").touch()
        return Progress()


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> _Runs:
    return _Runs(monkeypatch)


def test_a_scenario_changes_what_it_names_and_nothing_beside_it(write_sweep: WriteSweep) -> None:
    sweep = read_sweep(write_sweep(), Overrides())
    shared, own = sweep.shared.params, sweep.scenarios["no_haze"].params
    assert own == replace(shared, augment=replace(shared.augment, haze=0.0))
    assert sweep.scenarios["as_shared"] == sweep.shared
    assert sweep.differences("no_haze") == {"train": {"augment": {"haze": 0.0}}}


def test_the_command_line_goes_before_the_file_in_every_scenario(write_sweep: WriteSweep) -> None:
    overrides = Overrides(arch="yolov3-tiny", settings=["augment.mosaic=0.5", "steps=9"])
    sweep = read_sweep(write_sweep(), overrides)
    for plan in (sweep.shared, *sweep.scenarios.values()):
        assert (plan.arch, plan.params.steps, plan.params.augment.mosaic) == ("yolov3-tiny", 9, 0.5)
    assert sweep.scenarios["no_haze"].params.augment.haze == 0.0


def test_what_a_sweep_writes_down_gives_the_same_plans(write_sweep: WriteSweep, tmp_path: Path) -> None:
    weights = {"weights": "../a/best.weights"}
    scratch = {"scratch": {"weights": None, "arch": "small.cfg"}, "other": {"weights": "b.weights"}}
    sweep = read_sweep(write_sweep({**_SCENARIOS, **scratch}, **weights), Overrides())
    assert sweep.scenarios["scratch"].weights is None
    assert sweep.scenarios["other"].weights == tmp_path / "b.weights"
    (tmp_path / "elsewhere").mkdir()
    again = tmp_path / "elsewhere" / "again.yaml"
    again.write_text(yaml.safe_dump(sweep.to_dict()))
    assert read_sweep(again, Overrides()).to_dict() == sweep.to_dict()


@pytest.mark.parametrize(
    ("scenarios", "telling"),
    [
        (None, "found none"),
        ([], "`scenarios`"),
        ({"a": 3}, "`a`, found 3"),
        ({"a": {"train": [1]}}, r"`a\.train`"),
        ({"a": {"data": "other"}}, "same for all scenarios"),
        ({"a": {"steps": 3}}, "scenario a of .*, found steps"),
        ({"a": None, "b": {"train": {"stepps": 3}}}, "scenario b of .*stepps"),
        ({"../a": None}, r"found '\.\./a'"),
        ({".a": None}, r"found '\.a'"),
        ({"sweep.md": None}, r"found 'sweep\.md'"),
        ({"a": None, "b": {"train": {"batch": 2}}}, "found a and b alike"),
    ],
)
def test_a_mistake_in_the_file_names_the_scenario(write_sweep: WriteSweep, scenarios: object, telling: str) -> None:
    with pytest.raises(ConfigError, match=telling) as raised:
        read_sweep(write_sweep(scenarios), Overrides())
    assert "\n" not in str(raised.value)


def test_differences_are_said_in_words() -> None:
    train = {"scales": [0.8, 1.0], "frozen_norm": True, "learning_rate": 2.5e-5}
    said = words_of({"weights": "/far/away/first/best.weights", "train": train})
    assert said == "weights first/best.weights, scales [0.8, 1], frozen_norm true, learning_rate 2.5e-05"
    assert words_of({"weights": None}) == "weights none"


@pytest.mark.parametrize(
    ("scenarios", "error", "telling"),
    [
        ({"right": None, "wrong": {"arch": "yolov9"}}, ConfigError, "'yolov9' in scenario wrong"),
        ({"wrong": {"weights": "nowhere.weights"}, "right": None}, ModelError, "in scenario wrong"),
        ({"wrong": {"train": {"size_px": [100, 64]}}, "right": None}, ModelError, "100x64 in scenario wrong"),
        ({"wrong": {"train": {"augment": {"any_rotation_sources": ["flights"]}}}}, ConfigError, "flights"),
    ],
)
def test_what_does_not_fit_the_data_is_told_before_the_first_scenario(
    write_sweep: WriteSweep, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, scenarios: object,
    error: type[Exception], telling: str,
) -> None:  # fmt: skip
    monkeypatch.delattr("standoff.training.sweep.sweep.train_on")
    sweep, heard = read_sweep(write_sweep(scenarios), Overrides()), SweepListener(print, lambda _: pytest.fail())
    with pytest.raises(error, match=telling):
        run_sweep(sweep, tmp_path / "out", heard)
    assert not (tmp_path / "out").exists()


def test_scenarios_run_in_their_order_and_leave_one_table(write_sweep: WriteSweep, runs: _Runs, tmp_path: Path) -> None:
    sweep, out = read_sweep(write_sweep(), Overrides()), tmp_path / "out"
    results = runs.start(sweep, out)
    assert runs.called == [(name, False) for name in _SCENARIOS]
    assert [result.state for result in results] == ["finished"] * 3
    assert read_sweep(out / "sweep.yaml", Overrides()).to_dict() == sweep.to_dict()
    assert (out / "sweep.md").read_text() == table_of(results).to_markdown()
    recorded = json.loads((out / "sweep.json").read_text())["scenarios"]
    assert [(one["scenario"], one["best_step"], one["map"]) for one in recorded] == [
        (name, 4, 0.5) for name in _SCENARIOS
    ]
    assert recorded[1]["differences"] == {"train": {"learning_rate": 1e-4}}
    assert recorded[1]["ap"] == {"worker": 0.5, "vehicle": None}
    assert (out / "sweep.png").is_file()


@pytest.mark.parametrize(
    ("failure", "reason"),
    [
        (ConfigError(expected="memory", found="too little", fix="set batch to 1"), "expected memory, found too little"),
        (DataError(expected="a finite loss", found="nan", fix="lower the rate"), "expected a finite loss, found nan"),
        (ValueError("Detections must be finite"), "Detections must be finite"),
        (MemoryError(), "MemoryError"),
        (torch.OutOfMemoryError("CUDA\nout of memory"), "CUDA out of memory"),
        (RuntimeError("a loader was killed"), "a loader was killed"),
    ],
)
def test_a_scenario_that_fails_is_in_the_table_and_the_others_run(
    write_sweep: WriteSweep, runs: _Runs, tmp_path: Path, failure: Exception, reason: str
) -> None:
    runs.failing["slow"] = failure
    results = runs.start(read_sweep(write_sweep(), Overrides()), tmp_path / "out")
    assert [result.state for result in results] == ["finished", "failed", "finished"]
    (line,) = [line for line in (tmp_path / "out" / "sweep.md").read_text().splitlines() if line.startswith("| slow")]
    assert f"failed: {reason}" in line
    assert any(message.startswith("failed: ") and reason in message for message in runs.messages)


def test_a_sweep_goes_on_with_what_is_left(write_sweep: WriteSweep, runs: _Runs, tmp_path: Path) -> None:
    sweep, out = read_sweep(write_sweep(), Overrides()), tmp_path / "out"
    runs.failing["slow"] = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        runs.start(sweep, out)
    table = (out / "sweep.md").read_text().splitlines()
    assert [line.split("|")[-2].strip() for line in table[2:]] == ["finished", "not finished"]
    runs.failing.clear()
    first_minutes = json.loads((out / "sweep.json").read_text())["scenarios"][1]["minutes"]
    results = runs.start(sweep, out, resumes=True)
    assert runs.called == [("slow", True), ("no_haze", False)]
    assert [result.state for result in results] == ["finished"] * 3
    assert results[1].minutes > first_minutes > 0.0
    runs.start(sweep, out, resumes=True)
    assert runs.called == []


def test_a_scenario_without_a_checkpoint_begins_anew(write_sweep: WriteSweep, runs: _Runs, tmp_path: Path) -> None:
    sweep, out = read_sweep(write_sweep(), Overrides()), tmp_path / "out"
    runs.failing["slow"], runs.saves = MemoryError(), False
    runs.start(sweep, out)
    runs.failing.clear()
    results = runs.start(sweep, out, resumes=True)
    assert runs.called == [("slow", False)]
    assert [result.state for result in results] == ["finished"] * 3


def test_another_sweep_is_not_mixed_with_that_of_the_folder(
    write_sweep: WriteSweep, runs: _Runs, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    with pytest.raises(ConfigError, match=r"no sweep\.yaml"):
        runs.start(read_sweep(write_sweep(), Overrides()), out, resumes=True)
    runs.start(read_sweep(write_sweep(), Overrides()), out)
    before = (out / "sweep.yaml").read_bytes()
    changed = {**_SCENARIOS, "slow": {"train": {"learning_rate": 1e-5}}}
    with pytest.raises(ConfigError, match=r"scenario slow as .*, found learning_rate 1e-05"):
        runs.start(read_sweep(write_sweep(changed), Overrides()), out, resumes=True)
    fewer = {name: changes for name, changes in _SCENARIOS.items() if name != "slow"}
    with pytest.raises(ConfigError, match=r"scenario slow as .*, found none"):
        runs.start(read_sweep(write_sweep(fewer), Overrides()), out, resumes=True)
    with pytest.raises(OutputError, match="new or empty"):
        runs.start(read_sweep(write_sweep(), Overrides()), out)
    assert runs.called == [] and (out / "sweep.yaml").read_bytes() == before


def test_scenarios_may_be_added_and_one_that_failed_may_be_changed(
    write_sweep: WriteSweep, runs: _Runs, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    runs.failing["slow"] = MemoryError()
    runs.start(read_sweep(write_sweep(), Overrides()), out)
    runs.failing.clear()
    changed = {**_SCENARIOS, "slow": {"train": {"batch": 1}}, "sgd": {"train": {"optimizer": "sgd"}}}
    results = runs.start(read_sweep(write_sweep(changed), Overrides()), out, resumes=True)
    assert runs.called == [("slow", True), ("sgd", False)]
    assert [words_of(result.differences) for result in results][1] == "batch 1"
    assert yaml.safe_load((out / "sweep.yaml").read_text())["scenarios"]["slow"] == {"train": {"batch": 1}}


def test_files_of_somebody_else_under_the_name_of_a_scenario_are_left_alone(
    write_sweep: WriteSweep, runs: _Runs, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    runs.start(read_sweep(write_sweep(), Overrides()), out)
    (out / "sgd").mkdir()
    (out / "sgd" / "mine.txt").touch()
    more = {**_SCENARIOS, "sgd": {"train": {"optimizer": "sgd"}}}
    with pytest.raises(OutputError, match="sgd"):
        runs.start(read_sweep(write_sweep(more), Overrides()), out, resumes=True)
    assert (out / "sgd" / "mine.txt").is_file()


def _row(step: int, worker: float | None, mean: float | None) -> dict[str, Any]:
    return {"step": step, "ap_worker": worker, "map": mean, "average_iou": 0.7, "loss_total": 2.0}


def test_the_table_shows_each_scenario_at_its_best_step_and_the_best_of_each_figure_bold() -> None:
    results = [
        Result("one", {}, "finished", 1.0, "", [_row(10, 0.5, 0.6), _row(20, 0.9, 0.4)]),
        Result("two", {"arch": "a|b"}, "failed", 2.0, "no memory", [_row(10, 0.7, 0.3)]),
        Result("three", {}, "unfinished"),
        Result("four", {}, "finished", 3.0, "", [_row(10, None, None)]),
    ]
    assert table_of(results).to_markdown().splitlines() == [
        "| scenario | differs in | best step | worker AP | mAP | average IoU | minutes | outcome |",
        "|---|---|---|---|---|---|---|---|",
        "| one | nothing | 10 | 50.00 | **60.00** | **70.00** | 1.0 | finished |",
        "| two | arch a\\|b | 10 | **70.00** | 30.00 | **70.00** | 2.0 | failed: no memory |",
        "| three | nothing | - | - | - | - | 0.0 | not finished |",
        "| four | nothing | - | - | - | - | 3.0 | finished |",
    ]
    assert "outcome" not in table_of(results[:1]).columns
    figures = table_of(results).only(("scenario", "mAP"))
    assert figures.columns == ("scenario", "mAP") and figures.rows[0][1].is_best


def test_the_figure_has_a_line_for_each_scenario_that_was_validated(tmp_path: Path) -> None:
    results = [Result(f"s{n}", {}, history=[_row(10, 0.5, 0.1), _row(20, 0.5, 0.1 * n)]) for n in range(9)]
    draw_sweep([*results, Result("none", {}), Result("nan", {}, history=[_row(10, None, None)])], tmp_path / "a.png")
    picture = cv2.imread(str(tmp_path / "a.png"))
    assert picture is not None and picture.std() > 10
