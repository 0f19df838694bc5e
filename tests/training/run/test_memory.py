from __future__ import annotations

import subprocess
import sys
import weakref

import pytest
import torch

from standoff.core.errors import ConfigError
from standoff.training.run.memory import saying_what_fits

_PROGRAM = """
import resource
import torch
from standoff.training.run.memory import keep_freed_memory

def faults():
    for _ in range(6):
        torch.ones(12_000_000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(16):
        torch.ones(12_000_000)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

returned = faults()
keep_freed_memory()
print(returned, faults())
"""
"""Blocks of 48 MB: glibc never keeps those of more than 32 MB by itself.

Sixteen are counted, because the heap may still grow for a few when something small was put where a large one had been.
"""


@pytest.mark.live
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="mallopt is glibc's")
def test_large_blocks_are_not_fetched_from_the_system_again_and_again() -> None:
    done = subprocess.run([sys.executable, "-c", _PROGRAM], check=True, capture_output=True, text=True)
    returned, kept = map(int, done.stdout.split())
    assert kept * 3 < returned


def test_what_a_failed_step_had_computed_is_let_go_before_smaller_ones_are_tried() -> None:
    computed: list[weakref.ref[torch.Tensor]] = []

    def fail() -> None:
        activations = torch.ones(8)
        computed.append(weakref.ref(activations))
        raise MemoryError

    def attempt(pictures: int) -> None:
        assert computed[0]() is None

    with pytest.raises(ConfigError, match="batch to 8"), saying_what_fits(16, 1, attempt):
        fail()
