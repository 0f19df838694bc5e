from __future__ import annotations

from collections import Counter

import pytest
import torch

from standoff.core.errors import ModelError
from standoff.training import yolov3_cfg, yolov3_tiny_cfg
from standoff.training.darknet_cfg import Yolo, parse_cfg
from standoff.training.darknet_network import DarknetNetwork
from standoff.training.darknet_shapes import Shape, largest_stride, layer_shapes


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
            r"6 filters before it \(1 anchors of 5 \+ 1\) in layer 1, \[yolo\] .*found 5",
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
