"""Blend networks of one architecture: a weighted mean of their parameters.

A fine-tuned network forgets some of what its starting point knew: trained on rendered people, it finds fewer real ones.
In between, on the straight line from start to end, are networks that keep much of both.

Source:
    Wortsman et al., Robust Fine-Tuning of Zero-Shot Models, 2022, section 3 (between start and end); Wortsman et al.,
    Model Soups, 2022 (between several ends).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import torch

from standoff.core.errors import ConfigError
from standoff.training.darknet.cfg import read_cfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.weights import WeightsHeader, load_weights, save_weights

_SUM_TOLERANCE = 1e-6


def blend_weights(cfg: Path, parts: Sequence[tuple[Path, float]], out: Path, first_layers: int | None = None) -> None:
    """Write the weighted mean of Darknet weights.

    Args:
        cfg: That all of them belong to.
        parts: Each file, and its share; the shares add up to 1.
        out: Weights file to write; its `seen` is the largest of the parts'.
        first_layers: Write those of the first so many layers only; None: all.

    Raises:
        ConfigError: There is no part, a share is negative, the shares do not add up to 1, or the network has no
            more layers than `first_layers`.
        ModelError: A file does not belong to the cfg.
        OutputError: The file cannot be written.
    """
    shares = [share for _, share in parts]
    if not shares or min(shares) < 0 or not math.isclose(sum(shares), 1.0, abs_tol=_SUM_TOLERANCE):
        raise ConfigError(
            expected="shares of 0 to 1 that add up to 1",
            found=" + ".join(f"{share:g}" for share in shares) or "none",
            fix="write for example start.weights=0.3 best.weights=0.7",
        )
    description = read_cfg(cfg)
    if first_layers is not None and first_layers >= len(description.layers):
        raise ConfigError(
            expected=f"fewer layers than the {len(description.layers)} of {cfg.name}",
            found=str(first_layers),
            fix="leave --layers out to write all of them",
        )
    blended, network = DarknetNetwork(description), DarknetNetwork(description)
    mean = {name: torch.zeros_like(value, dtype=torch.float64) for name, value in blended.state_dict().items()}
    seen = 0
    for path, share in parts:
        seen = max(seen, load_weights(network, path).seen)
        for name, value in network.state_dict().items():
            mean[name] += share * value.double()
    blended.load_state_dict({name: value.to(blended.state_dict()[name].dtype) for name, value in mean.items()})
    # Layers are numbered from 0: 74 of them end with number 73, where Darknet's own `partial` stops.
    cut = None if first_layers is None else first_layers - 1
    save_weights(blended, out, WeightsHeader(seen=seen), cut_after_layer=cut)
