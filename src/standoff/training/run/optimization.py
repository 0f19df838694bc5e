"""How the weights move: which of them, how fast, and their running average."""

from __future__ import annotations

import math
from collections.abc import Iterator

import torch
from torch import Tensor, nn

from standoff.training.darknet.network import DarknetNetwork
from standoff.training.run.params import TrainParams


def learning_rate(step: int, params: TrainParams) -> float:
    """Return the rate of a step, from 0: a linear rise, then half a cosine down to the final share.

    >>> params = TrainParams(steps=100, warmup_steps=10, learning_rate=1.0, final_share=0.1)
    >>> [round(learning_rate(step, params), 3) for step in (0, 9, 10, 55, 100)]
    [0.1, 1.0, 1.0, 0.55, 0.1]
    """
    if step < params.warmup_steps:
        return params.learning_rate * (step + 1) / params.warmup_steps
    done = (step - params.warmup_steps) / max(1, params.steps - params.warmup_steps)
    share = params.final_share + (1.0 - params.final_share) * (1.0 + math.cos(math.pi * done)) / 2.0
    return params.learning_rate * share


def make_optimizer(network: DarknetNetwork, backbone_layers: int, params: TrainParams) -> torch.optim.Optimizer:
    """Group the parameters: backbone or not, decayed (kernels) or not; each group keeps its `rate_share`."""
    groups = []
    for is_backbone in (True, False):
        for is_kernel in (True, False):
            own = [
                parameter
                for index, parameter in _layer_parameters(network)
                if (index < backbone_layers) == is_backbone and (parameter.ndim > 1) == is_kernel
            ]
            if own:
                decay = params.weight_decay if is_kernel else 0.0
                rate_share = params.backbone_rate if is_backbone else 1.0
                groups.append({"params": own, "weight_decay": decay, "rate_share": rate_share})
    if params.optimizer == "sgd":
        return torch.optim.SGD(groups, lr=params.learning_rate, momentum=params.momentum, nesterov=params.momentum > 0)
    return torch.optim.AdamW(groups, lr=params.learning_rate, betas=(params.momentum, 0.999))


def set_learning_rate(optimizer: torch.optim.Optimizer, rate: float) -> None:
    """Set every group's rate to its share."""
    for group in optimizer.param_groups:
        group["lr"] = rate * group["rate_share"]


def _layer_parameters(network: DarknetNetwork) -> Iterator[tuple[int, nn.Parameter]]:
    for index, block in enumerate(network.blocks):
        for parameter in block.parameters():
            yield index, parameter


def set_trainable(network: DarknetNetwork, frozen: int, frozen_norm: int) -> None:
    """Put a network into training, less what is frozen.

    Args:
        network: Changed in place.
        frozen: So many layers from the first neither move nor update their statistics.
        frozen_norm: So many layers from the first do not update their statistics.
    """
    network.train()
    for index, parameter in _layer_parameters(network):
        parameter.requires_grad_(index >= frozen)
    for block in network.blocks[: max(frozen, frozen_norm)]:
        block.eval()


class AveragedWeights:
    """Exponential moving average of a network's parameters and statistics.

    Args:
        network: Started from.
        decay: Of the average; lower in the first steps, when the weights still run away from where they began.
    """

    def __init__(self, network: DarknetNetwork, decay: float) -> None:
        self.decay = decay
        self.updates = 0
        self.state = {name: value.detach().clone() for name, value in network.state_dict().items()}

    @torch.no_grad()
    def update(self, network: DarknetNetwork) -> None:
        """Take in the weights after a step."""
        self.updates += 1
        decay = self.decay * (1.0 - math.exp(-self.updates / 300.0))
        floats: list[Tensor] = []
        news: list[Tensor] = []
        for name, value in network.state_dict().items():
            if value.is_floating_point():
                floats.append(self.state[name])
                news.append(value)
            else:
                self.state[name].copy_(value)
        torch._foreach_lerp_(floats, news, 1.0 - decay)
