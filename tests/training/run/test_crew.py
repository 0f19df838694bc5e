"""Two processes that train as one; started once, because each takes seconds to load torch."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
import torch
from training.small_runs import CFG, run_side_by_side, write_data

_SCRIPT = """
import os, sys, torch
from pathlib import Path
from training.small_runs import small_network, small_params
from standoff.labels import read_data
from standoff.training.run.loop import Trainer, Watcher
from standoff.training.run.train import Listener, RunPlan, train_detector

torch.set_num_threads(1)
data, cfg, out = map(Path, sys.argv[1:])
params = small_params(steps=4, validate_every=4)
network, losses = small_network(), []
trainer = Trainer(network, read_data(data), params, out, 0)
trainer.run(Watcher(lambda _, loss: losses.append(loss), lambda *_: None, lambda _: None))
result = {"state": network.state_dict(), "losses": losses, "rows": len(trainer.progress.rows)}
torch.save(result, out / f"rank{os.environ['RANK']}")
train_detector(RunPlan(data, str(cfg), None, params), out / "run", Listener(print, lambda *_: None, lambda _: None))
"""


@pytest.fixture(scope="session")  # of one worker, wherever its turn to run the tests of this file comes
def worked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder in which both have trained a network, and then made a whole run."""
    folder = tmp_path_factory.mktemp("crew")
    (folder / "crew.py").write_text(_SCRIPT)
    (folder / "small.cfg").write_text(CFG)
    data = write_data(folder / "blocks")
    tests = Path(__file__).parents[2]
    path = f"{tests}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    words = [folder / "crew.py", data, folder / "small.cfg", folder]
    run_side_by_side([str(word) for word in words], {**os.environ, "PYTHONPATH": path})
    return folder


@pytest.mark.live
def test_two_processes_end_with_the_same_weights_from_different_pictures(worked: Path) -> None:
    results: list[dict[str, Any]] = [torch.load(worked / f"rank{rank}", weights_only=True) for rank in (0, 1)]
    first, second = results
    assert first["losses"] != second["losses"]
    assert (first["rows"], second["rows"]) == (1, 0)
    for name, value in first["state"].items():
        if "running" not in name and "num_batches" not in name:
            torch.testing.assert_close(value, second["state"][name])


@pytest.mark.live
def test_one_of_several_processes_writes_the_folder(worked: Path) -> None:
    assert (worked / "run" / "model.onnx").is_file()
