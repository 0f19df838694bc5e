"""The same training step on the CPU and on a GPU: do loss and gradient agree, and how long does each take?"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Final

import numpy as np
import torch
from torch import nn

from standoff.evaluation.timing import Spread
from standoff.labels import LabelledData, read_data
from standoff.labels.splits import require_splits
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.pictures.batches import Batch, open_batches
from standoff.training.run.loss import yolo_loss
from standoff.training.run.optimization import set_trainable
from standoff.training.run.params import TrainParams
from standoff.training.run.plan import RunPlan
from standoff.training.run.precision import autocast
from standoff.training.run.train import compose_start
from standoff.training.start.starting_point import backbone_of

TOLERANCE: Final = 1e-3
"""What loss and norm of the gradient may differ by, relative to the CPU's."""
DEVICES: Final = ("cpu", "cuda")
_REPEATS: Final = 3


@dataclass(frozen=True, slots=True)
class Gradients:
    """What one step computes before the weights move.

    Attributes:
        loss: Total of the batch.
        norm: Length of the gradient of everything that learns.
    """

    loss: float
    norm: float

    def difference(self, reference: Gradients) -> float:
        """Return the larger of the two relative differences from a reference; NaN where there is one."""
        pairs = ((self.loss, reference.loss), (self.norm, reference.norm))
        # Python's own max lets go of a NaN that comes second.
        return float(np.max([abs(own - other) / max(abs(other), 1e-12) for own, other in pairs]))


@dataclass(frozen=True, slots=True)
class DeviceTrial:
    """What became of one device.

    Attributes:
        device: As torch calls it.
        gradients: In float32; None where the device is absent.
        difference: From the CPU's, relative; likewise.
        step_ms: Times of a step forth and back as the plan computes it, in bfloat16 where it says so; likewise.
    """

    device: str
    gradients: Gradients | None = None
    difference: float | None = None
    step_ms: Spread | None = None

    @property
    def is_good(self) -> bool:
        """Whether it is absent, or agrees with the CPU."""
        return self.difference is None or self.difference <= TOLERANCE

    @property
    def verdict(self) -> str:
        """What to tell people, in a word."""
        if self.difference is None:
            return "absent"
        return "OK" if self.is_good else "DIFFERS"

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "device": self.device,
            "verdict": self.verdict,
            "loss": None if self.gradients is None else self.gradients.loss,
            "gradient_norm": None if self.gradients is None else self.gradients.norm,
            "largest_relative_difference": self.difference,
            "step_ms": None if self.step_ms is None else self.step_ms.to_dict(),
        }


def compare_devices(plan: RunPlan, devices: Sequence[str] = DEVICES) -> tuple[DeviceTrial, ...]:
    """Compute the first batch of a plan on each device, from the same weights.

    In float32, and on a GPU without TensorFloat-32, whose eleven bits would be all of the difference; without dropout,
    which draws on each device for itself. The CPU is compared with a second time of its own.

    Raises:
        DataError, ConfigError, ModelError: The plan cannot be begun; see the parts.
    """
    data = read_data(plan.data)
    require_splits(data, ("train",))
    params = plan.params
    network = _start(plan, data)
    batch = _first_batch(data, params)
    with _exact():
        reference = gradients_of(copy.deepcopy(network), batch, params, bf16=False)
    trials = []
    for name in devices:
        device = torch.device(name)
        if device.type == "cuda" and not torch.cuda.is_available():
            trials.append(DeviceTrial(name))
            continue
        moved, there = copy.deepcopy(network).to(device), batch.to(device)
        with _exact():
            found = gradients_of(moved, there, params, bf16=False)
        times = Spread.of(_step_ms(moved, there, params))
        trials.append(DeviceTrial(name, found, found.difference(reference), times))
    return tuple(trials)


def gradients_of(network: DarknetNetwork, batch: Batch, params: TrainParams, *, bf16: bool) -> Gradients:
    """Go forth and back with a batch.

    Args:
        network: On the batch's device; what learns of it has its gradient afterwards.
        batch: Pictures and truth.
        params: Gives the loss.
        bf16: Compute in bfloat16 where the device knows it.
    """
    network.zero_grad(set_to_none=True)
    pixels = batch.pictures.to(memory_format=torch.channels_last).float() / 255.0
    with autocast(pixels.device, bf16=bf16):
        heads = network(pixels)
    loss = yolo_loss(heads, network.cfg.heads, batch, params.loss).total
    torch.autograd.backward(loss)
    grads = [parameter.grad for parameter in network.parameters() if parameter.grad is not None]
    return Gradients(float(loss.detach()), float(torch.nn.utils.get_total_norm(grads)))


def _start(plan: RunPlan, data: LabelledData) -> DarknetNetwork:
    params = plan.params
    _, network, transferred = compose_start(plan, data)
    backbone = params.backbone_layers or backbone_of(network, transferred)
    own_norm = len(network.blocks) if transferred.folded else 0
    set_trainable(network, params.frozen_layers, max(own_norm, backbone if params.frozen_norm else 0))
    for block in network.modules():
        if isinstance(block, nn.Dropout):
            block.eval()
    return network


def _first_batch(data: LabelledData, params: TrainParams) -> Batch:
    batches = open_batches(
        data.splits["train"], params=params.augment.for_classes(data.classes), batch=params.batch,
        sizes_px=lambda _: params.size_px, seed=params.seed, first_step=0, last_step=0, workers=params.workers,
    )  # fmt: skip
    with batches as stream:
        return next(stream)


def _exact() -> AbstractContextManager[None]:
    """Let convolutions on a GPU compute in float32 proper."""
    exact: AbstractContextManager[None] = torch.backends.cudnn.flags(enabled=True, allow_tf32=False)
    return exact


def _step_ms(network: DarknetNetwork, batch: Batch, params: TrainParams) -> list[float]:
    """Time steps; the first, in which a GPU chooses its algorithms, is left out."""
    device, times_ms = batch.pictures.device, []
    for _ in range(_REPEATS + 1):
        start_s = perf_counter()
        gradients_of(network, batch, params, bf16=params.bf16)
        if device.type == "cuda":
            torch.cuda.synchronize(device)
        times_ms.append((perf_counter() - start_s) * 1e3)
    return times_ms[1:]
