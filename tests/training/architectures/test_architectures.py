from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from laws import few

from standoff.core.errors import ModelError
from standoff.training import efficientnet_lite0_cfg, yolo_fastest_xl_cfg, yolov3_cfg, yolov3_tiny_cfg
from standoff.training.architectures import ARCHITECTURES
from standoff.training.architectures.efficientnet_lite import BACKBONE_CONVOLUTIONS
from standoff.training.darknet.cfg import parse_cfg, read_cfg
from standoff.training.darknet.layers import Convolutional, Layer, Yolo
from standoff.training.darknet.network import DarknetNetwork, DecodedNetwork
from standoff.training.darknet.shapes import Shape, largest_stride, layer_shapes, layer_strides, weights_numbers
from standoff.training.darknet.weights import load_weights

ANCHORS_PX = (((4.0, 8.5), (7.0, 14.0)), ((12.0, 18.0),), ((37.0, 49.0), (60.0, 30.0), (90.5, 90.5)))


def _without_lines(layers: tuple[Layer, ...]) -> list[Layer]:
    return [replace(layer, line=0) for layer in layers]


@pytest.mark.shared
def test_yolo_fastest_is_the_published_network_layer_by_layer_and_number_by_number(shared_data: Path) -> None:
    folder = shared_data / "weights" / "yolo-fastest-1.1-xl"
    published = read_cfg(folder / "yolo-fastest-1.1-xl.cfg")
    composed = parse_cfg(yolo_fastest_xl_cfg(80))
    assert _without_lines(composed.layers) == _without_lines(published.layers)
    picture = torch.rand(1, 3, composed.height_px, composed.width_px, generator=torch.Generator().manual_seed(0))
    rows = []
    for cfg in (composed, published):
        network = DarknetNetwork(cfg)
        load_weights(network, folder / "yolo-fastest-1.1-xl.weights")
        with torch.no_grad():
            rows.append(DecodedNetwork(network).eval()(picture))
    assert torch.equal(*rows)


@pytest.mark.parametrize("name", ARCHITECTURES)
def test_every_network_has_the_heads_anchors_classes_and_size_that_were_asked_for(name: str) -> None:
    architecture = ARCHITECTURES[name]
    anchors_px = ANCHORS_PX[-len(architecture.strides) :]
    cfg = parse_cfg(architecture.compose(7, 160, 96, anchors_px))
    assert (cfg.width_px, cfg.height_px) == (160, 96)
    strides, shapes = layer_strides(cfg), layer_shapes(cfg)
    heads = {int(strides[n]): (layer, shapes[n]) for n, layer in enumerate(cfg.layers) if isinstance(layer, Yolo)}
    assert tuple(sorted(heads)) == architecture.strides
    for stride, own_px in zip(architecture.strides, anchors_px, strict=True):
        head, shape = heads[stride]
        assert (head.anchors_px, head.classes) == (own_px, 7)
        assert shape == Shape(12 * len(own_px), 96 // stride, 160 // stride)


@pytest.mark.parametrize("name", few([*ARCHITECTURES][::-1], quick=3))
def test_every_layer_of_a_network_is_used(name: str) -> None:
    architecture = ARCHITECTURES[name]
    size_px = 160
    cfg = parse_cfg(architecture.compose(2, size_px, size_px, ANCHORS_PX[-len(architecture.strides) :]))
    network = DarknetNetwork(cfg).train()
    heads = network(torch.rand(2, 3, size_px, size_px, generator=torch.Generator().manual_seed(0)))
    loss = torch.stack([head.square().mean() for head in heads]).sum()
    gradients = torch.autograd.grad(loss, list(network.parameters()))
    assert all(gradient.abs().sum() > 0 for gradient in gradients)


def test_efficientnet_lite0_has_the_backbone_of_the_paper_and_fits_into_8_mb_of_fp16() -> None:
    cfg = parse_cfg(efficientnet_lite0_cfg(7, 224, 224))
    shapes, strides = layer_shapes(cfg), layer_strides(cfg)
    convolutions = [index for index, layer in enumerate(cfg.layers) if isinstance(layer, Convolutional)]
    end = convolutions[BACKBONE_CONVOLUTIONS - 1]
    assert (shapes[end], int(strides[end])) == (Shape(320, 7, 7), 32)
    backbone = {n: cfg.layers[n] for n in convolutions[:BACKBONE_CONVOLUTIONS]}
    blocks = {(shapes[n].channels, int(strides[n])) for n, layer in backbone.items() if _is_linear(layer)}
    assert blocks == {(16, 2), (24, 4), (40, 8), (80, 16), (112, 16), (192, 32), (320, 32)}
    # 4 652 008 as published, less the classifier's 1 281 000 and the last 1x1 convolution's 412 160; and two running
    # statistics for each normalised channel.
    statistics = 2 * sum(shapes[n].channels for n in backbone)
    assert weights_numbers(replace(cfg, layers=cfg.layers[: end + 1])) == 4_652_008 - 1_281_000 - 412_160 + statistics
    assert 2 * weights_numbers(cfg) < 8_000_000


def _is_linear(layer: Layer) -> bool:
    return isinstance(layer, Convolutional) and layer.activation == "linear"


def test_heads_and_groups_of_anchors_that_do_not_match_are_refused() -> None:
    with pytest.raises(ModelError, match=r"anchors for each of the heads at strides 8, 16, 32, found groups of 3, 3"):
        yolo_fastest_xl_cfg(7, strides=(8, 16, 32))
    with pytest.raises(ModelError, match=r"strides 16, 32, found groups of 2, 0 anchors"):
        yolov3_tiny_cfg(7, anchors_px=(ANCHORS_PX[0], ()))
    with pytest.raises(ModelError, match=r"\(8, 16\) or \(16, 32\) or \(8, 16, 32\), found \(4, 8\)"):
        yolo_fastest_xl_cfg(7, strides=(4, 8))


@pytest.mark.parametrize(("activation", "expected"), [("relu", [0.0, 3.0, 9.0]), ("relu6", [0.0, 3.0, 6.0])])
def test_rectified_activations_cut_off_where_their_names_say(activation: str, expected: list[float]) -> None:
    layers = f"[convolutional]\nfilters=6\nactivation={activation}\n{HEAD}"
    network = DarknetNetwork(parse_cfg(f"[net]\nwidth=3\nheight=1\nchannels=1\n{layers}"))
    ((_, block),) = network.convolutions()
    assert block.convolution.bias is not None
    torch.nn.init.ones_(block.convolution.weight)
    torch.nn.init.zeros_(block.convolution.bias)
    (head,) = network(torch.tensor([[[[-2.0, 3.0, 9.0]]]]))
    assert head[0, :, 0].tolist() == 6 * [expected]


def test_yolov3_has_the_layers_and_shapes_that_the_paper_gives() -> None:
    cfg = parse_cfg(yolov3_cfg(9))
    kinds = Counter(type(layer).__name__ for layer in cfg.layers)
    assert len(cfg.layers) == 107
    assert kinds == {"Convolutional": 75, "Shortcut": 23, "Route": 4, "Upsample": 2, "Yolo": 3}
    backbone = Counter(type(layer).__name__ for layer in cfg.layers[:75])
    assert backbone == {"Convolutional": 52, "Shortcut": 23}
    shapes = layer_shapes(cfg)
    assert shapes[74] == Shape(1024, 13, 13)
    heads = {index: shapes[index] for index, layer in enumerate(cfg.layers) if isinstance(layer, Yolo)}
    assert heads == {82: Shape(42, 13, 13), 94: Shape(42, 26, 26), 106: Shape(42, 52, 52)}
    assert largest_stride(cfg) == 32


def test_yolov3_tiny_has_its_layers_and_two_heads() -> None:
    cfg = parse_cfg(yolov3_tiny_cfg(9))
    shapes = layer_shapes(cfg)
    assert len(cfg.layers) == 24
    assert (shapes[11], shapes[16], shapes[23]) == (Shape(512, 13, 13), Shape(42, 13, 13), Shape(42, 26, 26))


@pytest.mark.parametrize("size_px", [(64, 64), (96, 32)])
def test_torch_computes_the_shapes_that_are_foretold(size_px: tuple[int, int]) -> None:
    cfg = parse_cfg(yolov3_tiny_cfg(2, *size_px))
    foretold = [shape for layer, shape in zip(cfg.layers, layer_shapes(cfg), strict=True) if isinstance(layer, Yolo)]
    with torch.no_grad():
        heads = DarknetNetwork(cfg).eval()(torch.zeros(1, 3, size_px[1], size_px[0]))
    assert [tuple(head.shape[1:]) for head in heads] == [(s.channels, s.height, s.width) for s in foretold]


@pytest.mark.parametrize("size", [2, 3, 5, 8])
@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("side", [6, 7])
def test_maxpool_takes_the_maximum_of_what_its_window_covers(size: int, stride: int, side: int) -> None:
    head = "[yolo]\nanchors=1,1\nclasses=1\n"
    cfg = parse_cfg(f"[net]\nchannels=6\nwidth={side}\nheight={side}\n[maxpool]\nsize={size}\nstride={stride}\n{head}")
    # All negative, so that padding with zeros would win.
    picture = -1.0 - torch.rand(1, 6, side, side, generator=torch.Generator().manual_seed(size))
    (pooled,) = DarknetNetwork(cfg).eval()(picture)
    starts = range(-((size - 1) // 2), side - (size - 1) // 2, stride)
    expected = [[_window_maximum(picture, top, left, size) for left in starts] for top in starts]
    assert pooled.shape[2:] == (len(starts), len(starts))
    assert torch.equal(pooled, torch.stack([torch.stack(row, dim=-1) for row in expected], dim=-2))


def _window_maximum(picture: torch.Tensor, top: int, left: int, size: int) -> torch.Tensor:
    return picture[:, :, max(top, 0) : top + size, max(left, 0) : left + size].amax(dim=(2, 3))


HEAD = "[yolo]\nanchors=1,1\nclasses=1\n"


@pytest.mark.parametrize(
    ("layers", "message"),
    [
        (
            f"[convolutional]\nfilters=5\n{HEAD}",
            r"6 filters before it \(1 anchors of 6\) in layer 1, \[yolo\] .*found 5",
        ),
        (f"[convolutional]\nfilters=4\ngroups=2\n{HEAD}", r"groups divide in layer 0, \[convolutional\] .*3 channels"),
        (
            f"[dropout]\n[upsample]\n[route]\nlayers=0,1\n{HEAD}",
            r"layers of one size in layer 2, \[route\].*32x32 and 64x64",
        ),
        (f"[dropout]\n[upsample]\n[shortcut]\nfrom=0\n{HEAD}", r"in layer 2, \[shortcut\] at line 6"),
        (f"[convolutional]\nsize=40\n{HEAD}", r"at least one pixel in layer 0"),
    ],
)
def test_layers_that_do_not_fit_are_refused_by_name(layers: str, message: str) -> None:
    cfg = parse_cfg(f"[net]\nwidth=32\nheight=32\n{layers}")
    with pytest.raises(ModelError, match=message):
        DarknetNetwork(cfg)
