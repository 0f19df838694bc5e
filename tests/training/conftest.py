from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
import torch
from torch import nn
from torch.nn import functional

from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.weights import save_weights

_RAW_SPREAD = 0.4
"""Of trained heads: most boxes are within a factor of two of their anchors."""


class DarknetFiles(NamedTuple):
    cfg: Path
    weights: Path
    names: Path


def _settle(network: DarknetNetwork) -> None:
    """Keep signals from dying or exploding in 107 layers, and raw heads where trained ones are.

    Every normalisation measures its own input; then the last convolutions are scaled.
    """
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d):
            module.momentum = None
            nn.init.uniform_(module.weight, 0.5, 1.5)
            nn.init.normal_(module.bias, std=0.3)
    cfg = network.cfg
    blotches = torch.rand(4, cfg.channels, 12, 16)
    pictures = functional.interpolate(blotches, (cfg.height_px, cfg.width_px), mode="bicubic").clamp(0, 1)
    last = [block for _, block in network.convolutions() if block.normalization is None]
    with torch.no_grad():
        network.train()(pictures)
        for block, head in zip(last, network.eval()(pictures), strict=True):
            block.convolution.weight *= _RAW_SPREAD / head.std()


@pytest.fixture
def make_darknet_files(tmp_path: Path) -> Callable[[str, int], DarknetFiles]:
    """Write a cfg, random but healthy weights for it, and names."""

    def make(cfg_text: str, seed: int) -> DarknetFiles:
        torch.manual_seed(seed)
        network = DarknetNetwork(parse_cfg(cfg_text))
        _settle(network)
        files = DarknetFiles(tmp_path / "net.cfg", tmp_path / "net.weights", tmp_path / "net.names")
        files.cfg.write_text(cfg_text)
        save_weights(network, files.weights)
        files.names.write_text("".join(f"class {number}\n" for number in range(network.cfg.heads[0].classes)))
        return files

    return make
