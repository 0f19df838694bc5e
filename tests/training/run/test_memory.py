from __future__ import annotations

import subprocess
import sys
import weakref

import pytest
import torch

from standoff.core.errors import ConfigError
from standoff.training.run.memory import saying_what_fits

_PROGRAM = """
import resource, sys
import torch
from standoff.training.run.memory import keep_freed_memory
if sys.argv[1] == "kept":
    keep_freed_memory()
for _ in range(10):
    torch.ones(40_000_000)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    torch.ones(40_000_000)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="mallopt is glibc's")
def test_large_blocks_are_not_fetched_from_the_system_again_and_again() -> None:
    faults = {
        how: int(
            subprocess.run([sys.executable, "-c", _PROGRAM, how], check=True, capture_output=True, text=True).stdout
        )
        for how in ("kept", "returned")
    }
    assert faults["kept"] * 3 < faults["returned"]


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
