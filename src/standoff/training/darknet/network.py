"""A Darknet network as a torch module, raw for training and decoded for inference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from standoff.training.darknet.cfg import DarknetCfg
from standoff.training.darknet.layers import (
    POINT_VALUES,
    Convolutional,
    Dropout,
    Layer,
    Maxpool,
    Route,
    Shortcut,
    Upsample,
    Yolo,
)
from standoff.training.darknet.sections import Activation
from standoff.training.darknet.shapes import Shape, layer_shapes

_LEAKY_SLOPE = 0.1
_BATCH_NORM_EPSILON = 1e-6
_WIDE = 5
LOG_SIGMA = (-5.0, 3.0)
"""Errors of a point that can be told: from 1/150 of its box's side, a tenth of a pixel, to 20 of them."""


def _activation(name: Activation) -> nn.Module:
    match name:
        case "linear":
            return nn.Identity()
        case "leaky":
            return nn.LeakyReLU(_LEAKY_SLOPE)
        case "logistic":
            return nn.Sigmoid()
        case "relu":
            return nn.ReLU()
        case "relu6":
            return nn.ReLU6()
        case "mish":
            return nn.Mish()
        case "swish":
            return nn.SiLU()


class ConvolutionBlock(nn.Module):
    """Convolution, normalisation or bias, activation.

    Args:
        layer: The section of the cfg.
        channels: Input channels.

    Attributes:
        convolution: Has a bias where there is no normalisation.
        normalization: None where there is a bias.
    """

    def __init__(self, layer: Convolutional, channels: int) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(
            channels,
            layer.filters,
            layer.size,
            layer.stride,
            layer.padding,
            groups=layer.groups,
            bias=not layer.batch_normalized,
        )
        self.normalization = nn.BatchNorm2d(layer.filters, eps=_BATCH_NORM_EPSILON) if layer.batch_normalized else None
        self.activation = _activation(layer.activation)
        self._is_wide_depthwise = layer.groups == channels > 1 and layer.size >= _WIDE

    def forward(self, features: Tensor) -> Tensor:
        """Map (B, C, H, W) to (B, filters, H', W')."""
        features = self._convolve(features)
        if self.normalization is not None:
            features = self.normalization(features)
        return cast(Tensor, self.activation(features))

    def _convolve(self, features: Tensor) -> Tensor:
        kind = features.device.type
        if self._is_wide_depthwise and kind == "cpu" and torch.is_autocast_enabled(kind):
            # The backward pass of these in bfloat16 takes three times as long as in float32 (oneDNN 3, AVX-512 BF16).
            with torch.autocast(kind, enabled=False):
                return cast(Tensor, self.convolution(features.float()))
        return cast(Tensor, self.convolution(features))


class _PaddedMaxPool(nn.Module):
    """Maximum over windows that may hang over the edge, where there is nothing: minus infinity, not zero.

    Only torch's own padding is used, which means just that. ONNX Runtime fuses a separate padding of
    zeros with the pooling and then computes something else.
    """

    def __init__(self, layer: Maxpool) -> None:
        super().__init__()
        self.layer = layer

    def forward(self, features: Tensor) -> Tensor:
        size, stride, before = self.layer.size, self.layer.stride, self.layer.padding // 2
        if self.layer.padding % 2 == 0:
            return functional.max_pool2d(features, size, stride, before)
        if stride == 1:
            return functional.max_pool2d(features, size, 1, before + 1)[..., 1:, 1:]
        return functional.max_pool2d(features, size, stride, before, ceil_mode=True)


def _block(layer: Layer, channels: int) -> nn.Module:
    match layer:
        case Convolutional():
            return ConvolutionBlock(layer, channels)
        case Shortcut(activation=activation):
            return _activation(activation)
        case Maxpool():
            return _PaddedMaxPool(layer)
        case Upsample(stride=stride):
            return nn.Upsample(scale_factor=stride, mode="nearest")
        case Dropout(probability=probability):
            return nn.Dropout(probability)
        case Route() | Yolo():
            return nn.Identity()


def _group(features: Tensor, route: Route) -> Tensor:
    """Return the part of (B, C, H, W) that a route takes."""
    count = features.shape[1] // route.groups
    return features[:, route.group_id * count : (route.group_id + 1) * count]


class DarknetNetwork(nn.Module):
    """The layers of a cfg, in order.

    Args:
        cfg: The network.

    Attributes:
        cfg: The network as described.
        blocks: One module a layer.

    Raises:
        ModelError: A layer does not fit those before it.
    """

    def __init__(self, cfg: DarknetCfg) -> None:
        super().__init__()
        self.cfg = cfg
        channels = (cfg.channels, *(shape.channels for shape in layer_shapes(cfg)))
        self.blocks = nn.ModuleList(_block(layer, channels[index]) for index, layer in enumerate(cfg.layers))
        self._kept = {layer.source for layer in cfg.layers if isinstance(layer, Shortcut)}
        self._kept.update(source for layer in cfg.layers if isinstance(layer, Route) for source in layer.sources)
        self._heads = [index for index, layer in enumerate(cfg.layers) if isinstance(layer, Yolo)]

    def forward(self, pictures: Tensor) -> tuple[Tensor, ...]:
        """Run the network.

        Args:
            pictures: (B, channels, H, W), 0 to 1.

        Returns:
            The raw map of each head, (B, anchors * values, h, w): what the last convolution says.
        """
        return self.maps(pictures, self._heads)

    def maps(self, pictures: Tensor, wanted: Sequence[int]) -> tuple[Tensor, ...]:
        """Run the network as far as is needed for the maps of some layers.

        Args:
            pictures: (B, channels, H, W), 0 to 1.
            wanted: Layers by their places in the cfg, rising.

        Returns:
            Of each, (B, its channels, h, w).
        """
        kept: dict[int, Tensor] = {}
        features = pictures
        for index, (layer, block) in enumerate(zip(self.cfg.layers, self.blocks, strict=True)):
            if isinstance(layer, Route):
                features = torch.cat([_group(kept[source], layer) for source in layer.sources], dim=1)
            elif isinstance(layer, Shortcut):
                features = features + kept[layer.source]
            features = block(features)
            if index in self._kept or index in wanted:
                kept[index] = features
            if index == wanted[-1]:
                break
        return tuple(kept[index] for index in wanted)

    def convolutions(self) -> tuple[tuple[int, ConvolutionBlock], ...]:
        """Return the convolutional blocks with their layer numbers, in the order of a weights file."""
        return tuple((index, block) for index, block in enumerate(self.blocks) if isinstance(block, ConvolutionBlock))


class DecodedNetwork(nn.Module):
    """A network whose output is boxes, for pictures of the size that its cfg says.

    Args:
        network: The network.
    """

    def __init__(self, network: DarknetNetwork) -> None:
        super().__init__()
        self.network = network
        cfg = network.cfg
        self.decoders = nn.ModuleList(
            _HeadDecoder(layer, shape, cfg.width_px / shape.width, cfg.height_px / shape.height)
            for layer, shape in zip(cfg.layers, layer_shapes(cfg), strict=True)
            if isinstance(layer, Yolo)
        )

    def forward(self, pictures: Tensor) -> Tensor:
        """Detect.

        Args:
            pictures: (B, channels, H, W), 0 to 1, of the cfg's size.

        Returns:
            The boxes of `decode`.
        """
        return self.decode(self.network(pictures))[0]

    def decode(self, heads: tuple[Tensor, ...]) -> tuple[Tensor, Tensor]:
        """Turn raw heads into boxes and points.

        Returns:
            (B, N, 5 + classes): box centre x, y, width, height in input pixels (0 is the left or top
            edge of the first pixel), objectness, and the probability of each class given an object.
            Rows run over heads, then cell rows, cell columns and anchors. And (B, N, 4): the ground point of each box,
            x and y, and the standard errors of both, in input pixels; (B, N, 0) where the heads have none.
        """
        decoded = [decode(head) for decode, head in zip(self.decoders, heads, strict=True)]
        return torch.cat([boxes for boxes, _ in decoded], dim=1), torch.cat([points for _, points in decoded], dim=1)


class DecodedPoints(nn.Module):
    """A network whose outputs are boxes and ground points, as they are exported.

    Args:
        decoded: The network; its heads have points.
    """

    def __init__(self, decoded: DecodedNetwork) -> None:
        super().__init__()
        self.decoded = decoded

    def forward(self, pictures: Tensor) -> tuple[Tensor, Tensor]:
        """Return what `DecodedNetwork.decode` does."""
        return self.decoded.decode(self.decoded.network(pictures))


class _HeadDecoder(nn.Module):
    """Decode one head of known size; its grid is a constant, so that export needs no shapes at run time.

    Source:
        Redmon and Farhadi, YOLOv3: An Incremental Improvement, section 2.1; scale_x_y is Bochkovskiy
        et al., YOLOv4, section 3.3 ("eliminate grid sensitivity"); new_coords is Wang et al., Scaled-YOLOv4, 2021, as
        Darknet computes it.
    """

    cell: Tensor
    cell_px: Tensor
    anchors_px: Tensor

    def __init__(self, head: Yolo, shape: Shape, stride_x_px: float, stride_y_px: float) -> None:
        super().__init__()
        self.head = head
        self.shape = shape
        rows, columns = torch.meshgrid(torch.arange(shape.height), torch.arange(shape.width), indexing="ij")
        corner = torch.stack([columns, rows], dim=-1).float() - (head.scale_xy - 1.0) / 2.0
        self.register_buffer("cell", corner[None, :, :, None, :])
        self.register_buffer("cell_px", torch.tensor([stride_x_px, stride_y_px]))
        self.register_buffer("anchors_px", torch.tensor(head.anchors_px))

    def forward(self, raw: Tensor) -> tuple[Tensor, Tensor]:
        anchors, values, boxes = len(self.head.anchors_px), self.head.values, 5 + self.head.classes
        height, width = self.shape.height, self.shape.width
        raw = raw.reshape(-1, anchors, values, height, width).permute(0, 3, 4, 1, 2)
        if self.head.new_coords:
            shares, factors, probability = raw[..., 0:2], 4.0 * raw[..., 2:4].square(), raw[..., 4:boxes]
        else:
            shares, factors = torch.sigmoid(raw[..., 0:2]), torch.exp(raw[..., 2:4])
            probability = torch.sigmoid(raw[..., 4:boxes])
        centre_px = (shares * self.head.scale_xy + self.cell) * self.cell_px
        size_px = factors * self.anchors_px
        decoded = torch.cat([centre_px, size_px, probability], dim=-1)
        decoded = decoded.reshape(-1, height * width * anchors, boxes)
        if not self.head.has_point:
            return decoded, decoded[..., :0]
        foot_px, log_sigma = points_of(raw[..., boxes:], centre_px, size_px)
        points = torch.cat([foot_px, log_sigma.exp()], dim=-1)
        return decoded, points.reshape(-1, height * width * anchors, POINT_VALUES)


def points_of(raw: Tensor, centre_px: Tensor, size_px: Tensor) -> tuple[Tensor, Tensor]:
    """Decode ground points.

    A point is told from the middle of its own box, in the box's sides: so one pose of a machine has one answer,
    however far away it stands and wherever in its cell.

    Args:
        raw: (..., 4) what the last convolution says.
        centre_px: (..., 2) middle of the boxes.
        size_px: (..., 2) width and height of the boxes.

    Returns:
        (..., 2) points, and (..., 2) logarithms of their standard errors; input pixels.
    """
    log_sigma = raw[..., 2:4].clamp(*LOG_SIGMA) + size_px.log()
    return centre_px + raw[..., 0:2] * size_px, log_sigma
