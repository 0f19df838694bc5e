"""Compose the cfg text of YOLOv3 and YOLOv3-tiny for any number of classes, input size and anchors.

Source:
    Redmon and Farhadi, YOLOv3: An Incremental Improvement, 2018: Table 1 (Darknet-53) and section 2.3
    (three scales, the anchors). The paper that standoff follows uses it with 9 classes at 416 x 416.
"""

from __future__ import annotations

from typing import Final

from standoff.training.architectures.composer import Anchors, CfgComposer

YOLOV3_ANCHORS_PX: Final = (
    ((10, 13), (16, 30), (33, 23)),
    ((30, 61), (62, 45), (59, 119)),
    ((116, 90), (156, 198), (373, 326)),
)
"""Of COCO at 416 px, at strides 8, 16 and 32."""

TINY_ANCHORS_PX: Final = (((10, 14), (23, 27), (37, 58)), ((81, 82), (135, 169), (344, 319)))
"""Of COCO at 416 px, at strides 16 and 32."""

_STAGES: Final = ((64, 1), (128, 2), (256, 8), (512, 8), (1024, 4))
"""Darknet-53: channels after each halving of the picture, and residual blocks that follow."""


def _darknet53(cfg: CfgComposer) -> list[int]:
    """Return the last layer of each stage."""
    cfg.convolution(32, 3)
    ends = []
    for filters, blocks in _STAGES:
        end = cfg.convolution(filters, 3, stride=2)
        for _ in range(blocks):
            cfg.convolution(filters // 2, 1)
            cfg.convolution(filters, 3)
            end = cfg.shortcut(end)
        ends.append(end)
    return ends


def yolov3_cfg(classes: int, width_px: int = 416, height_px: int = 416, anchors_px: Anchors = YOLOV3_ANCHORS_PX) -> str:
    """Return the cfg text of YOLOv3: 107 layers, heads at layers 82, 94 and 106.

    Args:
        classes: Number of classes.
        width_px: Input width, a multiple of 32.
        height_px: Input height, likewise.
        anchors_px: Anchors of the heads at strides 8, 16 and 32.

    >>> yolov3_cfg(9).count("[convolutional]")
    75
    """
    cfg = CfgComposer(width_px, height_px, classes, (8, 16, 32), anchors_px)
    *_, end_8, end_16, _ = _darknet53(cfg)
    neck = 0
    for stride, filters, earlier in ((32, 512, None), (16, 256, end_16), (8, 128, end_8)):
        if earlier is not None:
            cfg.route(neck)
            cfg.convolution(filters, 1)
            cfg.beside_upsampled(earlier)
        for _ in range(3):
            neck = cfg.convolution(filters, 1)
            cfg.convolution(2 * filters, 3)
        cfg.head(stride)
    return cfg.text


def yolov3_tiny_cfg(
    classes: int, width_px: int = 416, height_px: int = 416, anchors_px: Anchors = TINY_ANCHORS_PX
) -> str:
    """Return the cfg text of YOLOv3-tiny: 24 layers, heads at layers 16 and 23.

    Args:
        classes: Number of classes.
        width_px: Input width, a multiple of 32.
        height_px: Input height, likewise.
        anchors_px: Anchors of the heads at strides 16 and 32.

    >>> yolov3_tiny_cfg(9).count("[maxpool]")
    6
    """
    cfg = CfgComposer(width_px, height_px, classes, (16, 32), anchors_px)
    for filters in (16, 32, 64, 128):
        cfg.convolution(filters, 3)
        cfg.maxpool(2, 2)
    end_16 = cfg.convolution(256, 3)
    cfg.maxpool(2, 2)
    cfg.convolution(512, 3)
    cfg.maxpool(2, 1)
    cfg.convolution(1024, 3)
    neck = cfg.convolution(256, 1)
    cfg.convolution(512, 3)
    cfg.head(32)
    cfg.route(neck)
    cfg.convolution(128, 1)
    cfg.beside_upsampled(end_16)
    cfg.convolution(256, 3)
    cfg.head(16)
    return cfg.text
