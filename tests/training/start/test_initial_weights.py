from __future__ import annotations

import math
from collections.abc import Callable

import pytest
import torch

from standoff.training import efficientnet_lite0_cfg, yolo_fastest_xl_cfg
from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.layers import Convolutional
from standoff.training.darknet.network import DarknetNetwork, DecodedNetwork
from standoff.training.start.initial_weights import head_convolutions, initialize_layers


def _initialized(text: str, seed: int) -> DarknetNetwork:
    network = DarknetNetwork(parse_cfg(text))
    generator = torch.Generator().manual_seed(seed)
    initialize_layers(network, [index for index, _ in network.convolutions()], generator)
    return network


@pytest.mark.parametrize("compose", [yolo_fastest_xl_cfg, efficientnet_lite0_cfg])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_fresh_network_says_that_about_one_cell_in_a_hundred_has_an_object(
    compose: Callable[..., str], seed: int
) -> None:
    network = _initialized(compose(7, 96, 96), seed)
    pictures = torch.rand(4, 3, 96, 96, generator=torch.Generator().manual_seed(seed))
    with torch.no_grad():
        rows = DecodedNetwork(network.train())(pictures)
    assert 0.005 < rows[..., 4].median() < 0.02


def test_kernels_are_uniform_within_darknets_bound() -> None:
    network = _initialized(yolo_fastest_xl_cfg(7, 96, 96), 0)
    for index, block in network.convolutions():
        layer = network.cfg.layers[index]
        assert isinstance(layer, Convolutional)
        kernels = block.convolution.weight
        bound = math.sqrt(2 / (layer.size**2 * kernels.shape[1]))
        assert kernels.abs().max() <= bound
        if kernels.numel() > 10_000:
            assert kernels.std().item() == pytest.approx(bound / math.sqrt(3), rel=0.05)


def test_only_the_layers_that_are_named_change_and_a_seed_repeats_them() -> None:
    network = _initialized(yolo_fastest_xl_cfg(7, 96, 96), 0)
    before = {name: value.clone() for name, value in network.state_dict().items()}
    (*_, last) = head_convolutions(network)
    initialize_layers(network, [last], torch.Generator().manual_seed(5))
    changed = {name for name, value in network.state_dict().items() if not torch.equal(value, before[name])}
    assert changed == {f"blocks.{last}.convolution.weight"}
    once = network.state_dict()[f"blocks.{last}.convolution.weight"].clone()
    initialize_layers(network, [last], torch.Generator().manual_seed(5))
    assert torch.equal(network.state_dict()[f"blocks.{last}.convolution.weight"], once)
