"""What a network's layers hold before they learn.

Source:
    Darknet's convolutional_layer.c (kernels uniform within sqrt(2 / inputs), after He et al., 2015), and Lin et al.,
    Focal Loss for Dense Object Detection, 2017, section 4.1 (a bias that says "object" with a probability of 0.01,
    so that the many empty cells do not drown the first steps).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import Final

import torch
from torch import nn

from standoff.training.darknet.layers import POINT_VALUES, Convolutional, Yolo
from standoff.training.darknet.network import ConvolutionBlock, DarknetNetwork

_OBJECT_PRIOR: Final = 0.01
_POINT_PRIOR: Final = (0.0, 0.25, -1.1, -1.1)
"""Across and down from the box's middle in its sides, and the logarithms of their errors."""


def head_convolutions(network: DarknetNetwork) -> dict[int, Yolo]:
    """Return the convolutions before the heads: their layer numbers, and the heads."""
    layers = network.cfg.layers
    pairs = enumerate(pairwise(layers))
    return {n: head for n, (last, head) in pairs if isinstance(last, Convolutional) and isinstance(head, Yolo)}


def initialize_layers(network: DarknetNetwork, layers: Iterable[int], generator: torch.Generator | None = None) -> None:
    """Give convolutions fresh parameters.

    Args:
        network: Changed in place.
        layers: Layer numbers of the convolutions.
        generator: For the kernels; None: torch's own.
    """
    heads = head_convolutions(network)
    blocks = dict(network.convolutions())
    for index in layers:
        _initialize(blocks[index], generator)
        if index in heads:
            _set_prior(blocks[index], heads[index])


def _initialize(block: ConvolutionBlock, generator: torch.Generator | None) -> None:
    kernels = block.convolution.weight
    bound = math.sqrt(2.0 / kernels[0].numel())
    nn.init.uniform_(kernels, -bound, bound, generator=generator)
    if block.convolution.bias is not None:
        nn.init.zeros_(block.convolution.bias)
    if block.normalization is not None:
        block.normalization.reset_parameters()


def _set_prior(block: ConvolutionBlock, head: Yolo) -> None:
    set_point_prior(block, head)
    bias = block.convolution.bias
    assert bias is not None
    with torch.no_grad():
        rows = bias.view(len(head.anchors_px), head.values)
        rows[:, 4] = -math.log((1.0 - _OBJECT_PRIOR) / _OBJECT_PRIOR)


def set_point_prior(block: ConvolutionBlock, head: Yolo) -> None:
    """Let a head say that points lie in the lower middle of their boxes, give or take a third: before it has learnt.

    Args:
        block: The convolution before the head; changed in place.
        head: Without points nothing happens.
    """
    if not head.has_point:
        return
    bias = block.convolution.bias
    assert bias is not None
    with torch.no_grad():
        block.convolution.weight.view(len(head.anchors_px), head.values, -1)[:, -POINT_VALUES:] = 0.0
        bias.view(len(head.anchors_px), head.values)[:, -POINT_VALUES:] = torch.tensor(_POINT_PRIOR)
