"""Whether a training computes in bfloat16: half the memory, and on processors that know it half the time."""

from __future__ import annotations

import torch


def knows_bf16(device: torch.device) -> bool:
    """Return whether a device has instructions for bfloat16.

    A processor without them converts each number there and back: a step of EfficientNet-lite0 on one core of an EPYC
    with AVX2 takes several times as long as in float32.
    """
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported())
    if device.type != "cpu":
        return False
    capabilities = torch.cpu.get_capabilities()
    return any(capabilities.get(name, False) for name in ("avx512_bf16", "amx_bf16", "bf16"))


def autocast(device: torch.device, *, bf16: bool) -> torch.autocast:
    """Return a context in which a network computes in bfloat16, where that is wanted and the device knows it."""
    return torch.autocast(device.type, torch.bfloat16, enabled=bf16 and knows_bf16(device))
