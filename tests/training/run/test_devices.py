from __future__ import annotations

import pytest
import torch
from training.small_runs import CFG, small_params, write_data

from standoff.training.run.devices import TOLERANCE, DeviceTrial, Gradients, compare_devices
from standoff.training.run.train import RunPlan


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> RunPlan:
    folder = tmp_path_factory.mktemp("plan")
    (folder / "small.cfg").write_text(CFG)
    return RunPlan(write_data(folder / "blocks"), str(folder / "small.cfg"), None, small_params())


@pytest.fixture(scope="module")
def trials(plan: RunPlan) -> tuple[DeviceTrial, ...]:
    torch.manual_seed(1)
    return compare_devices(plan)


def test_a_step_on_the_cpu_is_exactly_itself(trials: tuple[DeviceTrial, ...]) -> None:
    cpu, cuda = trials
    assert cpu.gradients is not None and cpu.step_ms is not None
    assert (cpu.verdict, cpu.difference) == ("OK", 0.0)
    assert cpu.gradients.loss > 0 and cpu.gradients.norm > 0 and cpu.step_ms.median_ms > 0
    if not torch.cuda.is_available():
        assert (cuda.verdict, cuda.is_good, cuda.gradients) == ("absent", True, None)


def test_dropout_has_no_say(plan: RunPlan, trials: tuple[DeviceTrial, ...]) -> None:
    torch.manual_seed(2)
    assert compare_devices(plan, ["cpu"])[0].gradients == trials[0].gradients


@pytest.mark.parametrize(
    ("loss", "norm", "verdict"), [(10.005, 2.0, "OK"), (10.0, 1.99, "DIFFERS"), (10.0, float("nan"), "DIFFERS")]
)
def test_a_device_that_is_off_by_more_than_a_per_mille_differs(loss: float, norm: float, verdict: str) -> None:
    found = Gradients(loss, norm)
    assert DeviceTrial("cuda", found, found.difference(Gradients(10.0, 2.0))).verdict == verdict
    assert TOLERANCE == 1e-3
