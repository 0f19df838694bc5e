"""Compose the cfg text of YOLOv3 and YOLOv3-tiny for any number of classes and any input size.

Source:
    Redmon and Farhadi, YOLOv3: An Incremental Improvement, 2018: Table 1 (Darknet-53) and section 2.3
    (three scales, the anchors). The paper that standoff follows uses it with 9 classes at 416 x 416.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

_YOLOV3_ANCHORS_PX: Final = "10,13, 16,30, 33,23, 30,61, 62,45, 59,119, 116,90, 156,198, 373,326"
_TINY_ANCHORS_PX: Final = "10,14, 23,27, 37,58, 81,82, 135,169, 344,319"
_STAGES: Final = ((64, 1), (128, 2), (256, 8), (512, 8), (1024, 4))
"""Darknet-53: channels after each halving of the picture, and residual blocks that follow."""


def _section(name: str, options: Mapping[str, object]) -> str:
    return "\n".join([f"[{name}]", *(f"{key}={value}" for key, value in options.items()), ""])


def _net(width_px: int, height_px: int) -> str:
    return _section("net", {"width": width_px, "height": height_px, "channels": 3})


def _convolution(filters: int, size: int, stride: int = 1) -> str:
    options = {"batch_normalize": 1, "filters": filters, "size": size, "stride": stride, "pad": 1}
    return _section("convolutional", {**options, "activation": "leaky"})


def _head(classes: int, mask: tuple[int, ...], anchors_px: str) -> list[str]:
    filters = len(mask) * (5 + classes)
    last = {"filters": filters, "size": 1, "stride": 1, "pad": 1, "activation": "linear"}
    count = anchors_px.count(",") // 2 + 1
    yolo = {"mask": ",".join(map(str, mask)), "anchors": anchors_px, "classes": classes, "num": count}
    return [_section("convolutional", last), _section("yolo", yolo)]


def _merge(filters: int, earlier: int) -> list[str]:
    """From before the last head, at twice the size, beside an earlier layer."""
    return [
        _section("route", {"layers": -4}),
        _convolution(filters, 1),
        _section("upsample", {"stride": 2}),
        _section("route", {"layers": f"-1,{earlier}"}),
    ]


def _darknet53() -> list[str]:
    sections = [_convolution(32, 3)]
    for filters, blocks in _STAGES:
        sections.append(_convolution(filters, 3, stride=2))
        for _ in range(blocks):
            shortcut = _section("shortcut", {"from": -3, "activation": "linear"})
            sections += [_convolution(filters // 2, 1), _convolution(filters, 3), shortcut]
    return sections


def yolov3_cfg(classes: int, width_px: int = 416, height_px: int = 416) -> str:
    """Return the cfg text of YOLOv3: 107 layers, heads at layers 82, 94 and 106.

    Args:
        classes: Number of classes.
        width_px: Input width, a multiple of 32.
        height_px: Input height, likewise.

    >>> yolov3_cfg(9).count("[convolutional]")
    75
    """
    sections = [_net(width_px, height_px), *_darknet53()]
    for filters, mask, earlier in ((512, (6, 7, 8), None), (256, (3, 4, 5), 61), (128, (0, 1, 2), 36)):
        if earlier is not None:
            sections += _merge(filters, earlier)
        sections += 3 * [_convolution(filters, 1), _convolution(2 * filters, 3)]
        sections += _head(classes, mask, _YOLOV3_ANCHORS_PX)
    return "\n".join(sections)


def yolov3_tiny_cfg(classes: int, width_px: int = 416, height_px: int = 416) -> str:
    """Return the cfg text of YOLOv3-tiny: 24 layers, heads at layers 16 and 23.

    Args:
        classes: Number of classes.
        width_px: Input width, a multiple of 32.
        height_px: Input height, likewise.

    >>> yolov3_tiny_cfg(9).count("[maxpool]")
    6
    """
    sections = [_net(width_px, height_px)]
    for filters in (16, 32, 64, 128, 256):
        sections += [_convolution(filters, 3), _section("maxpool", {"size": 2, "stride": 2})]
    sections += [_convolution(512, 3), _section("maxpool", {"size": 2, "stride": 1}), _convolution(1024, 3)]
    sections += [_convolution(256, 1), _convolution(512, 3), *_head(classes, (3, 4, 5), _TINY_ANCHORS_PX)]
    sections += [*_merge(128, earlier=8), _convolution(256, 3), *_head(classes, (0, 1, 2), _TINY_ANCHORS_PX)]
    return "\n".join(sections)
