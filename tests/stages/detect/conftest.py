from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
import torch

from standoff.training import export_darknet
from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.weights import save_weights

MakeModel = Callable[[tuple[str, ...], tuple[int, int]], Path]

CELL_PX = 8
"""The model's cells and anchors: one box exactly around each cell that holds a bright pixel."""

_CFG = f"""[net]
width={{width}}
height={{height}}
[maxpool]
size={CELL_PX}
stride={CELL_PX}
padding=0
[convolutional]
filters={{filters}}
activation=linear
[yolo]
anchors={CELL_PX},{CELL_PX}
classes={{classes}}
"""


def _colour_network(classes: int, size_px: tuple[int, int]) -> DarknetNetwork:
    """An object is where there is red; it is of the first class where there is green, of the second where blue."""
    text = _CFG.format(width=size_px[0], height=size_px[1], filters=5 + classes, classes=classes)
    network = DarknetNetwork(parse_cfg(text))
    ((_, block),) = network.convolutions()
    weight, bias = block.convolution.weight, block.convolution.bias
    assert bias is not None
    with torch.no_grad():
        weight.zero_()
        bias.zero_()
        weight[4, 0], bias[4] = 40.0, -30.0
        bias[5:] = -10.0
        weight[5, 1] = 20.0
        if classes > 1:
            weight[6, 2] = 20.0
    return network


@pytest.fixture(scope="session")
def make_model(tmp_path_factory: pytest.TempPathFactory) -> MakeModel:
    """Export a detector of coloured cells with the given labels and input size."""

    @cache
    def make(labels: tuple[str, ...], size_px: tuple[int, int]) -> Path:
        folder = tmp_path_factory.mktemp("model")
        network = _colour_network(len(labels), size_px)
        text = _CFG.format(width=size_px[0], height=size_px[1], filters=5 + len(labels), classes=len(labels))
        (folder / "a.cfg").write_text(text)
        (folder / "a.names").write_text("\n".join(labels))
        save_weights(network, folder / "a.weights")
        export_darknet(folder / "a.cfg", folder / "a.weights", folder / "a.names", None, folder / "model.onnx")
        return folder / "model.onnx"

    return make
