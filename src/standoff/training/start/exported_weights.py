"""Take a network's weights out of the ONNX file that it was exported to: the shipped detector, above all.

An export folds batch normalisations into kernels and biases. Here they become normalisations that change nothing but
add the bias, so that the network computes the same; it has no statistics to go on with, and must not gather new ones:
those of the folded layers would be others, and the network would be another with the first step.
"""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
import onnx
import torch
from torch import nn

from standoff.core.errors import ModelError
from standoff.stages.detect import POINTS_OUTPUT, ModelCard
from standoff.training.darknet.cfg import DarknetCfg
from standoff.training.darknet.layers import Convolutional, Yolo
from standoff.training.darknet.network import ConvolutionBlock, DarknetNetwork
from standoff.training.quantization.onnx_file import is_quantized, read_own_model

EXPORTED_SUFFIX: Final = ".onnx"
_PART: Final = re.compile(r"^part\d+_")
_Kernel = tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]


def gives_points(path: Path) -> bool:
    """Tell whether an exported detector gives ground points."""
    model, _ = read_own_model(path)
    return any(output.name == POINTS_OUTPUT for output in model.graph.output)


def read_exported(cfg: DarknetCfg, path: Path) -> tuple[DarknetNetwork, tuple[str, ...]]:
    """Read a network of the same layers as a cfg's; anchors, classes and points may be others.

    Args:
        cfg: Of the network that is to start from it.
        path: Made by `standoff export`, or by `standoff join`: then the first part of it that has these layers.

    Returns:
        The network as it was exported, for evaluation the same to rounding, and the names of its classes.

    Raises:
        ModelError: It is no such file, in eight bits, or none of its parts has these layers.
    """
    model, card = read_own_model(path)
    if is_quantized(model):
        raise ModelError(
            expected=f"weights in floating point in {path.name}",
            found="eight bits",
            fix="give the file it was made from",
        )
    anchors = list(card.anchors_px)
    for kernels in _parts(model):
        source = _source_cfg(cfg, card, anchors[: len(cfg.heads)], len(kernels[-1][1]))
        network = DarknetNetwork(source)
        if _fits(network, kernels):
            for (_, block), kernel in zip(network.convolutions(), kernels, strict=True):
                _fill(block, *kernel)
            return network, card.classes
        # Each part has its heads' anchors in the card, one part after another.
        anchors = anchors[_heads_of(kernels, card) :]
    raise ModelError(
        expected=f"a network with the layers of {cfg.name}",
        found=f"another one in {path.name}",
        fix="train with the architecture that the detector was made with",
    )


def is_folded(network: DarknetNetwork) -> bool:
    """Tell whether a network has normalisations that came without statistics, from an export."""
    norms = [block.normalization for _, block in network.convolutions() if block.normalization is not None]
    return any(bool((norm.running_var == _unit_variance(norm)).all()) for norm in norms if norm.running_var is not None)


def _unit_variance(norm: nn.BatchNorm2d) -> float:
    """Return the variance with which a normalisation divides by 1: a shade under the 1 of a fresh one."""
    return float(np.float32(1.0 - norm.eps))


def _parts(model: onnx.ModelProto) -> list[list[_Kernel]]:
    """Return kernel and bias of every convolution, in order, of each network in a file."""
    tensors = {tensor.name: onnx.numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    for node in model.graph.node:
        # Half precision: the weights are stored in 16 bits and cast on loading.
        if node.op_type == "Cast" and node.input[0] in tensors:
            tensors[node.output[0]] = tensors[node.input[0]]
    parts: dict[str, list[_Kernel]] = defaultdict(list)
    for node in model.graph.node:
        if node.op_type == "Conv":
            kernel, bias = (tensors[name].astype(np.float32) for name in node.input[1:3])
            part = _PART.match(node.output[0]) or _PART.match(node.input[1])
            parts[part.group() if part else ""].append((kernel, bias))
    return list(parts.values())


def _heads_of(kernels: list[_Kernel], card: ModelCard) -> int:
    """Return how many convolutions of a part are its heads': only they have a multiple of the values as filters."""
    least = 5 + len(card.classes)
    sizes = {len(anchors) * least for anchors in card.anchors_px}
    return sum(kernel.shape[2:] == (1, 1) and len(bias) in sizes for kernel, bias in kernels)


def _source_cfg(
    cfg: DarknetCfg, card: ModelCard, anchors_px: list[tuple[tuple[float, float], ...]], filters: int
) -> DarknetCfg:
    """Return the cfg of what was exported: the other's layers, with its own anchors, classes and points."""
    layers = list(cfg.layers)
    heads = [index for index, layer in enumerate(layers) if isinstance(layer, Yolo)]
    for index, own_px in zip(heads, anchors_px, strict=False):
        head, before = layers[index], layers[index - 1]
        assert isinstance(head, Yolo) and isinstance(before, Convolutional)
        plain = replace(head, anchors_px=own_px, classes=len(card.classes), has_point=False)
        head = replace(plain, has_point=filters != len(own_px) * plain.values)
        layers[index], layers[index - 1] = head, replace(before, filters=len(own_px) * head.values)
    return replace(cfg, layers=tuple(layers))


def _fits(network: DarknetNetwork, kernels: list[_Kernel]) -> bool:
    blocks = [block for _, block in network.convolutions()]
    return len(blocks) == len(kernels) and all(
        tuple(block.convolution.weight.shape) == kernel.shape
        for block, (kernel, _) in zip(blocks, kernels, strict=True)
    )


def _fill(block: ConvolutionBlock, kernel: npt.NDArray[np.float32], bias: npt.NDArray[np.float32]) -> None:
    norm = block.normalization
    with torch.no_grad():
        block.convolution.weight.copy_(torch.from_numpy(kernel))
        if norm is None:
            assert block.convolution.bias is not None
            block.convolution.bias.copy_(torch.from_numpy(bias))
            return
        assert norm.running_mean is not None and norm.running_var is not None
        norm.running_mean.zero_()
        norm.running_var.fill_(_unit_variance(norm))
        norm.weight.fill_(1.0)
        norm.bias.copy_(torch.from_numpy(bias))
