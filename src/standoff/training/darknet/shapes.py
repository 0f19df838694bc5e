"""Follow a picture's size through a Darknet network, and refuse networks whose layers do not fit."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from standoff.core.errors import ModelError
from standoff.training.darknet.cfg import DarknetCfg
from standoff.training.darknet.layers import Convolutional, Layer, Maxpool, Route, Shortcut, Upsample, Yolo

_LARGEST_INPUT_PX = 8192
"""Twice the width of 4K: no network was trained for more, and a misprint should not fill the memory."""


@dataclass(frozen=True, slots=True)
class Shape:
    """Size of one layer's output.

    Attributes:
        channels: Number of channels.
        height: Rows.
        width: Columns.
    """

    channels: int
    height: int
    width: int


def _misfit(cfg: DarknetCfg, index: int, expected: str, found: str) -> ModelError:
    return ModelError(expected=f"{expected} in {cfg.section(index)}", found=found, fix="correct the cfg file")


def _windowed(before: Shape, channels: int, size: int, stride: int, padding: int) -> Shape:
    return Shape(
        channels, (before.height + padding - size) // stride + 1, (before.width + padding - size) // stride + 1
    )


def _routed(cfg: DarknetCfg, index: int, groups: int, sources: list[Shape]) -> Shape:
    sizes = sorted({(source.width, source.height) for source in sources})
    if len(sizes) != 1:
        found = " and ".join(f"{width}x{height}" for width, height in sizes)
        raise _misfit(cfg, index, "layers of one size", found)
    channels = [source.channels for source in sources]
    if any(count % groups for count in channels):
        found = " and ".join(map(str, channels))
        raise _misfit(cfg, index, f"channels that {groups} groups divide", found)
    return Shape(sum(channels) // groups, sources[0].height, sources[0].width)


def _convolved(cfg: DarknetCfg, index: int, layer: Convolutional, before: Shape) -> Shape:
    if before.channels % layer.groups or layer.filters % layer.groups:
        found = f"{before.channels} channels and {layer.filters} filters for {layer.groups} groups"
        raise _misfit(cfg, index, "channels and filters that the groups divide", found)
    return _windowed(before, layer.filters, layer.size, layer.stride, 2 * layer.padding)


def _checked_head(cfg: DarknetCfg, index: int, head: Yolo, before: Shape) -> Shape:
    channels = len(head.anchors_px) * head.values
    if before.channels != channels:
        expected = f"{channels} filters before it ({len(head.anchors_px)} anchors of {head.values})"
        raise _misfit(cfg, index, expected, f"{before.channels}")
    return before


def _next_shape(cfg: DarknetCfg, index: int, before: Shape, shapes: list[Shape]) -> Shape:
    match cfg.layers[index]:
        case Convolutional() as layer:
            return _convolved(cfg, index, layer, before)
        case Maxpool(size=size, stride=stride, padding=padding):
            return _windowed(before, before.channels, size, stride, padding)
        case Upsample(stride=stride):
            return Shape(before.channels, before.height * stride, before.width * stride)
        case Route(sources=sources, groups=groups):
            return _routed(cfg, index, groups, [shapes[source] for source in sources])
        case Shortcut(source=source) if shapes[source] != before:
            raise _misfit(cfg, index, f"a layer of {before}", f"{shapes[source]}")
        case Yolo() as head:
            return _checked_head(cfg, index, head, before)
        case _:
            return before


def layer_shapes(cfg: DarknetCfg) -> tuple[Shape, ...]:
    """Return the output shape of every layer for pictures of the cfg's size.

    Raises:
        ModelError: A layer does not fit those before it; says which.
    """
    before = Shape(cfg.channels, cfg.height_px, cfg.width_px)
    shapes: list[Shape] = []
    for index in range(len(cfg.layers)):
        before = _next_shape(cfg, index, before, shapes)
        if min(before.height, before.width) < 1:
            raise _misfit(cfg, index, "a picture of at least one pixel", f"{before}")
        shapes.append(before)
    return tuple(shapes)


def _step(layer: Layer, before: Fraction, strides: list[Fraction]) -> Fraction:
    match layer:
        case Convolutional(stride=stride) | Maxpool(stride=stride):
            return before * stride
        case Upsample(stride=stride):
            return before / stride
        case Route(sources=sources):
            return strides[sources[0]]
        case _:
            return before


def layer_strides(cfg: DarknetCfg) -> tuple[Fraction, ...]:
    """Return the input pixels per cell of every layer's output."""
    strides: list[Fraction] = []
    for layer in cfg.layers:
        strides.append(_step(layer, strides[-1] if strides else Fraction(1), strides))
    return tuple(strides)


def largest_stride(cfg: DarknetCfg) -> int:
    """Return the input pixels per cell of the coarsest layer; input sides must be multiples of it."""
    return int(max(layer_strides(cfg)))


def numbers_by_layer(cfg: DarknetCfg) -> dict[int, int]:
    r"""Return how many numbers of a weights file belong to each layer that has any, in the file's order.

    >>> from standoff.training.darknet.cfg import parse_cfg
    >>> numbers_by_layer(parse_cfg("[net]\n[convolutional]\nfilters=7\n[yolo]\nanchors=1,1\nclasses=2"))
    {0: 28}
    """
    shapes = layer_shapes(cfg)
    before = (cfg.channels, *(shape.channels for shape in shapes))
    return {
        index: layer.filters * (layer.size**2 * channels // layer.groups + (4 if layer.batch_normalized else 1))
        for index, (layer, channels) in enumerate(zip(cfg.layers, before, strict=False))
        if isinstance(layer, Convolutional)
    }


def weights_numbers(cfg: DarknetCfg) -> int:
    """Return how many numbers a weights file of all layers holds."""
    return sum(numbers_by_layer(cfg).values())


def check_input(network: DarknetCfg) -> None:
    """Refuse networks that are not for colour pictures, and input sizes that their strides do not divide.

    Raises:
        ModelError: It is one.
    """
    if network.channels != 3:
        raise ModelError(
            expected=f"3 input channels, red, green and blue, in {network.name}",
            found=f"{network.channels}",
            fix="give a cfg for colour pictures",
        )
    stride = largest_stride(network)
    size_px = network.width_px, network.height_px
    if max(size_px) > _LARGEST_INPUT_PX:
        raise ModelError(
            expected=f"an input of at most {_LARGEST_INPUT_PX} px a side",
            found=f"{size_px[0]}x{size_px[1]}",
            fix="take a smaller one, and slice the picture (detect.slices)",
        )
    if min(size_px) < stride or size_px[0] % stride or size_px[1] % stride:
        width_px, height_px = (max(stride, round(side / stride) * stride) for side in size_px)
        raise ModelError(
            expected=f"an input width and height that are multiples of {stride} px",
            found=f"{size_px[0]}x{size_px[1]}",
            fix=f"take {width_px}x{height_px}",
        )
