"""Compose the cfg text of EfficientNet-lite0 under a light head with YOLOv3's three scales.

Source:
    Tan and Le, EfficientNet, 2019, Table 1, without squeeze-and-excitation and with relu6, as its authors' "lite"
    variants have it; Redmon and Farhadi, YOLOv3, section 2.3, with depthwise-separable convolutions in the head.
"""

from __future__ import annotations

from typing import Final

from standoff.training.architectures.composer import Anchors, CfgComposer
from standoff.training.architectures.yolov3 import YOLOV3_ANCHORS_PX

_STAGES: Final = (
    (1, 3, 1, 1, 16),
    (2, 3, 2, 6, 24),
    (2, 5, 2, 6, 40),
    (3, 3, 2, 6, 80),
    (3, 5, 1, 6, 112),
    (4, 5, 2, 6, 192),
    (1, 3, 1, 6, 320),
)
"""Blocks, kernel size, stride of the first, expansion, channels."""

BACKBONE_CONVOLUTIONS: Final = 1 + sum(blocks * (3 if expansion > 1 else 2) for blocks, _, _, expansion, _ in _STAGES)
"""Those of the head follow."""

_STEM_CHANNELS: Final = 32


def _backbone(cfg: CfgComposer) -> list[int]:
    """Return the last layer of each stage."""
    end = cfg.convolution(_STEM_CHANNELS, 3, stride=2, activation="relu6")
    channels = _STEM_CHANNELS
    ends = []
    for blocks, size, first_stride, expansion, filters in _STAGES:
        for number in range(blocks):
            inner = expansion * channels
            if expansion > 1:
                cfg.convolution(inner, 1, activation="relu6")
            cfg.convolution(inner, size, 1 if number else first_stride, groups=inner, activation="relu6")
            narrow = cfg.convolution(filters, 1, activation="linear")
            end = cfg.shortcut(end) if number else narrow
            channels = filters
        ends.append(end)
    return ends


def stage_layers() -> tuple[int, ...]:
    """Return the last layer of each stage, by its place in the cfg.

    >>> stage_layers()
    (2, 9, 16, 27, 38, 53, 56)
    """
    return tuple(_backbone(CfgComposer(416, 416, 1, (8, 16, 32), YOLOV3_ANCHORS_PX)))


def efficientnet_lite0_cfg(
    classes: int, width_px: int = 416, height_px: int = 416, anchors_px: Anchors = YOLOV3_ANCHORS_PX
) -> str:
    """Return the cfg text of EfficientNet-lite0 with heads at strides 8, 16 and 32.

    Convolutions of stride 2 are padded on both sides alike, as everywhere in Darknet; the original pads right and
    bottom more. Inside the picture that only shifts it by 1 px of each such layer's input: at stride 32 a cell is
    centred on its left top pixel, not on its right bottom one, 31 px away.

    Args:
        classes: Number of classes.
        width_px: Input width, a multiple of 32.
        height_px: Input height, likewise.
        anchors_px: Anchors of the heads at strides 8, 16 and 32.

    >>> efficientnet_lite0_cfg(7).count("[yolo]")
    3
    """
    cfg = CfgComposer(width_px, height_px, classes, (8, 16, 32), anchors_px)
    ends = _backbone(cfg)
    neck = 0
    for stride, channels, earlier in ((32, 128, None), (16, 128, ends[4]), (8, 96, ends[2])):
        if earlier is not None:
            cfg.route(neck)
            cfg.convolution(channels // 2, 1)
            cfg.beside_upsampled(earlier)
        cfg.convolution(channels, 1)
        for _ in range(2):
            cfg.convolution(channels, 5, groups=channels)
            neck = cfg.convolution(channels, 1)
        cfg.head(stride)
    return cfg.text
