from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from training.small_runs import small_network, small_params, write_data

from standoff.core.errors import ConfigError, DataError, OutputError
from standoff.labels import LabelledData, Problem, read_data
from standoff.training.run.checkpoint import load_checkpoint, save_checkpoint
from standoff.training.run.loop import Progress, Trainer, Watcher
from standoff.training.run.memory import saying_what_fits
from standoff.training.run.optimization import AveragedWeights, learning_rate, set_trainable
from standoff.training.run.params import TrainParams


def _watcher(
    losses: list[float] | None = None, bad: list[Problem] | None = None, stop: Callable[[int], None] | None = None
) -> Watcher:
    def on_step(step: int, loss: float) -> None:
        if losses is not None:
            losses.append(loss)
        if stop is not None:
            stop(step)

    def on_bad_picture(problem: Problem) -> None:
        if bad is not None:
            bad.append(problem)

    return Watcher(on_step, lambda *_: None, on_bad_picture)


def _run(data: LabelledData, folder: Path, params: TrainParams, losses: list[float]) -> Progress:
    return Trainer(small_network(), data, params, folder, 0).run(_watcher(losses))


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> LabelledData:
    return read_data(write_data(tmp_path_factory.mktemp("blocks")))


class _Killed(Exception):
    pass


@pytest.mark.parametrize(("killed_after", "accumulate"), [(5, 1), (7, 1), (9, 2)])
def test_a_resumed_run_gives_the_curve_of_an_uninterrupted_one(
    data: LabelledData, tmp_path: Path, killed_after: int, accumulate: int
) -> None:
    params = small_params(freeze_steps=3, accumulate=accumulate, scales=(1.0, 0.5), optimizer="adamw")
    whole: list[float] = []
    uninterrupted = _run(data, tmp_path / "whole", params, whole)

    def kill(step: int) -> None:
        if step == killed_after:
            raise _Killed

    parts: list[float] = []
    trainer = Trainer(small_network(), data, params, tmp_path / "parts", 0)
    with pytest.raises(_Killed):
        trainer.run(_watcher(parts, stop=kill))
    again = Trainer(small_network(seed=9), data, params, tmp_path / "parts", 0)
    assert again.resume() == ()
    first = again.progress.step
    resumed = again.run(_watcher(parts := parts[:first]))
    assert parts == whole
    without_time = [
        [{k: v for k, v in row.items() if k != "validation_s"} for row in run.rows] for run in (uninterrupted, resumed)
    ]
    assert without_time[0] == without_time[1]


def test_a_checkpoint_that_was_cut_short_is_passed_over_for_the_last_good_one(
    data: LabelledData, tmp_path: Path
) -> None:
    params = small_params()
    _run(data, tmp_path, params, [])
    newest = max(tmp_path.glob("step-*.pt"))
    content = newest.read_bytes()
    for length in (0, 100, len(content) // 2, len(content) - 1):
        newest.write_bytes(content[:length])
        state, damaged = load_checkpoint(tmp_path)
        assert damaged == (newest.name,) and state["progress"]["step"] == 8


def test_without_a_whole_checkpoint_nothing_is_resumed(tmp_path: Path) -> None:
    (tmp_path / "step-0000004.pt").write_bytes(b"half")
    with pytest.raises(DataError, match=r"only damaged ones \(step-0000004.pt\)"):
        load_checkpoint(tmp_path)
    with pytest.raises(DataError, match=r"found none\. Delete the folder of the run, or choose another --out"):
        load_checkpoint(tmp_path / "none")


def test_a_checkpoint_that_cannot_be_written_leaves_the_older_ones(tmp_path: Path) -> None:
    save_checkpoint(tmp_path, 1, {"step": 1})
    (tmp_path / ".step-0000002.pt.partial").mkdir()
    with pytest.raises(OutputError, match="Make room or give write permission, and go on with --resume"):
        save_checkpoint(tmp_path, 2, {"step": 2})
    assert load_checkpoint(tmp_path) == ({"step": 1}, ())


def test_two_checkpoints_are_kept(tmp_path: Path) -> None:
    for step in (1, 2, 3):
        save_checkpoint(tmp_path, step, {"step": step})
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["step-0000002.pt", "step-0000003.pt"]


@pytest.mark.parametrize(
    ("optimizer", "bf16"),
    [
        ("adamw", False),
        pytest.param("sgd", False, marks=pytest.mark.live),
        pytest.param("adamw", True, marks=pytest.mark.live),
    ],
)
def test_training_finds_coloured_blocks(data: LabelledData, tmp_path: Path, optimizer: str, bf16: bool) -> None:
    params = small_params(
        steps=160, validate_every=160, checkpoint_every=160, optimizer=optimizer, bf16=bf16, ema=0.9, batch=8,
        learning_rate=0.01 if optimizer == "adamw" else 0.002,
    )  # fmt: skip
    progress = _run(data, tmp_path, params, [])
    assert progress.best_map > 0.8


def test_the_run_stops_when_patience_is_used_up(data: LabelledData, tmp_path: Path) -> None:
    params = small_params(steps=40, validate_every=2, patience=3, learning_rate=1e-9)
    progress = _run(data, tmp_path, params, [])
    assert progress.step == progress.best_step + 6 < 40
    assert (tmp_path / f"step-{progress.step:07d}.pt").is_file()


def test_frozen_layers_do_not_move_and_the_others_do(data: LabelledData, tmp_path: Path) -> None:
    network, before = small_network(), small_network()
    Trainer(network, data, small_params(frozen_layers=2), tmp_path, 0).run(_watcher())
    for index, ((name, now), then) in enumerate(
        zip(network.state_dict().items(), before.state_dict().values(), strict=True)
    ):
        layer = int(name.split(".")[1])
        same = torch.equal(now, then)
        assert same == (layer < 2), (index, name)


def test_frozen_statistics_stay_while_the_kernels_move(data: LabelledData, tmp_path: Path) -> None:
    network, before = small_network(), small_network()
    Trainer(network, data, small_params(frozen_norm=True), tmp_path, 2).run(_watcher())
    now, then = network.state_dict(), before.state_dict()
    assert torch.equal(now["blocks.1.normalization.running_mean"], then["blocks.1.normalization.running_mean"])
    assert not torch.equal(now["blocks.2.normalization.running_mean"], then["blocks.2.normalization.running_mean"])
    assert not torch.equal(now["blocks.1.convolution.weight"], then["blocks.1.convolution.weight"])


def test_the_backbone_waits_for_the_freeze_to_end() -> None:
    network = small_network()
    set_trainable(network, frozen=2, frozen_norm=0)
    trainable = {
        index for index, block in enumerate(network.blocks) if any(p.requires_grad for p in block.parameters())
    }
    assert trainable == {2, 4}
    set_trainable(network, frozen=0, frozen_norm=0)
    assert all(parameter.requires_grad for parameter in network.parameters())


def test_a_picture_that_breaks_after_reading_is_named_and_replaced(tmp_path: Path) -> None:
    data = read_data(write_data(tmp_path / "blocks"))
    broken = data.splits["train"][3].path
    broken.write_bytes(broken.read_bytes()[:60])
    bad: list[Problem] = []
    progress = Trainer(small_network(), data, small_params(steps=20), tmp_path / "run", 0).run(_watcher(bad=bad))
    assert progress.step == 20
    assert {problem.path for problem in bad} == {broken}


def test_a_loss_that_explodes_ends_the_run_with_advice(data: LabelledData, tmp_path: Path) -> None:
    network = small_network()
    with torch.no_grad():
        network.convolutions()[0][1].convolution.weight.fill_(math.inf)
    with pytest.raises(DataError, match="expected a finite loss, found nan at step 1"):
        Trainer(network, data, small_params(), tmp_path, 0).run(_watcher())


@pytest.mark.parametrize(
    ("fits", "accumulate", "advice"),
    [
        (5, 1, "Set batch to 4, which fits, and accumulate to 4"),
        (5, 3, "Set batch to 4, which fits, and accumulate to 12"),
        (0, 1, "not even one picture"),
    ],
)
@pytest.mark.parametrize("kind", [MemoryError, torch.OutOfMemoryError, "can't allocate memory: you tried"])
def test_out_of_memory_says_which_batch_fits(fits: int, accumulate: int, advice: str, kind: Any) -> None:
    failure = RuntimeError(kind) if isinstance(kind, str) else kind()

    def attempt(pictures: int) -> None:
        if pictures > fits:
            raise failure

    with pytest.raises(ConfigError, match=advice), saying_what_fits(16, accumulate, attempt):
        raise failure


def test_other_errors_are_not_taken_for_a_lack_of_memory() -> None:
    with pytest.raises(RuntimeError, match="shapes"), saying_what_fits(16, 1, lambda _: None):
        raise RuntimeError("shapes differ")


def test_the_learning_rate_rises_and_then_only_falls() -> None:
    params = small_params(steps=200, warmup_steps=20)
    rates = [learning_rate(step, params) for step in range(201)]
    assert max(rates) == pytest.approx(params.learning_rate)
    assert rates[:20] == sorted(rates[:20]) and rates[20:] == sorted(rates[20:], reverse=True)
    assert rates[-1] == pytest.approx(params.learning_rate * params.final_share)


def test_averaged_weights_end_where_the_weights_rest() -> None:
    network = small_network()
    average = AveragedWeights(network, 0.9)
    with torch.no_grad():
        network.convolutions()[0][1].convolution.weight.fill_(2.0)
    for _ in range(3000):
        average.update(network)
    torch.testing.assert_close(
        average.state["blocks.0.convolution.weight"], network.state_dict()["blocks.0.convolution.weight"]
    )
