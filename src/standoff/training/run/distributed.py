"""One process alone, or several that torchrun started and that share each step's pictures."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Self

import torch
from torch import distributed, nn
from torch.nn.parallel import DistributedDataParallel


@dataclass(frozen=True, slots=True)
class Crew:
    """The processes of a run.

    Attributes:
        rank: Of this one.
        size: How many there are.
        device: Of this one.
    """

    rank: int
    size: int
    device: torch.device

    @classmethod
    def join(cls) -> Self:
        """Join the processes that torchrun started, if it did; take a GPU where there is one."""
        rank, size = int(os.environ.get("RANK", "0")), int(os.environ.get("WORLD_SIZE", "1"))
        has_gpu = torch.cuda.is_available()
        local = int(os.environ.get("LOCAL_RANK", "0"))
        device = torch.device("cuda", local) if has_gpu else torch.device("cpu")
        if size > 1 and not distributed.is_initialized():
            distributed.init_process_group("nccl" if has_gpu else "gloo")
        return cls(rank, size, device)

    @property
    def leads(self) -> bool:
        """Whether this one validates and writes."""
        return self.rank == 0

    def agree(self, is_true: bool) -> bool:
        """Return what the leader says, to everybody."""
        if self.size == 1:
            return is_true
        said = torch.tensor([int(is_true)], device=self.device)
        distributed.broadcast(said, src=0)
        return bool(said.item())

    def wrap(self, network: nn.Module) -> nn.Module:
        """Return the network, or one whose gradients are averaged over the processes."""
        if self.size == 1:
            return network
        return DistributedDataParallel(network, find_unused_parameters=True)
