"""Compose the cfg text of YOLO-Fastest-1.1-XL, with a stride-8 head beside its own if wanted.

Source:
    github.com/dog-qiuqiu/Yolo-Fastest, yolo-fastest-1.1-xl.cfg; its blocks are the inverted residuals of Sandler et
    al., MobileNetV2, 2018, section 3.3, and its pooling pyramid is that of YOLOv3-SPP.
"""

from __future__ import annotations

from typing import Final

from standoff.core.errors import ModelError
from standoff.training.architectures.composer import Anchors, CfgComposer

YOLO_FASTEST_ANCHORS_PX: Final = (((12, 18), (37, 49), (52, 132)), ((115, 73), (119, 199), (242, 238)))
"""Of COCO at 320 px, at strides 16 and 32."""

_DROPOUT: Final = 0.2
_STAGES: Final = (
    (2, ((16, 8, 1),)),
    (4, ((48, 16, 0), (64, 16, 2))),
    (8, ((64, 16, 0), (96, 16, 2), (96, 32, 0), (192, 32, 4))),
    (16, ((192, 48, 0), (272, 48, 4))),
    (32, ((272, 96, 0), (448, 96, 5))),
)
"""Stride, and its groups of blocks: channels within, channels without, residual blocks; 0: one block, no residual."""

_HEADS: Final = ((8, 16), (16, 32), (8, 16, 32))


def _block(cfg: CfgComposer, inner: int, outer: int, stride: int = 1) -> int:
    cfg.convolution(inner, 1)
    cfg.convolution(inner, 3, stride, groups=inner)
    return cfg.convolution(outer, 1, activation="linear")


def _backbone(cfg: CfgComposer) -> dict[int, int]:
    """Return the last layer at each stride."""
    cfg.convolution(16, 3, stride=2)
    end = _block(cfg, 16, 8)
    ends: dict[int, int] = {}
    for stride, groups in _STAGES:
        for number, (inner, outer, residuals) in enumerate(groups):
            if residuals == 0:
                end = _block(cfg, inner, outer, stride=2 if number == 0 else 1)
            for _ in range(residuals):
                _block(cfg, inner, outer)
                cfg.dropout(_DROPOUT)
                end = cfg.shortcut(end)
        ends[stride] = end
    return ends


def _pooled_pyramid(cfg: CfgComposer) -> int:
    source = cfg.last
    pooled = []
    for size in (3, 5):
        pooled.append(cfg.maxpool(size, 1))
        cfg.route(source)
    pooled.append(cfg.maxpool(9, 1))
    cfg.route(*reversed(pooled), source)
    return cfg.convolution(96, 1)


def _wide_blocks(cfg: CfgComposer, channels: int) -> int:
    for _ in range(2):
        cfg.convolution(channels, 5, groups=channels)
        cfg.convolution(channels, 1, activation="linear")
    return cfg.last


def yolo_fastest_xl_cfg(
    classes: int,
    width_px: int = 320,
    height_px: int = 320,
    anchors_px: Anchors = YOLO_FASTEST_ANCHORS_PX,
    strides: tuple[int, ...] = (16, 32),
) -> str:
    """Return the cfg text of YOLO-Fastest-1.1-XL.

    The stride-8 head is not in the original. It is built in the same manner: the stride-16 branch, narrowed and
    at twice the size, beside the last layer at stride 8, then two wide depthwise blocks. Without the stride-32 head the
    layers that lead to the stride-16 head stay.

    Args:
        classes: Number of classes.
        width_px: Input width, a multiple of 32.
        height_px: Input height, likewise.
        anchors_px: Anchors of the head at each stride.
        strides: Of the heads: (16, 32), (8, 16) or (8, 16, 32).

    Raises:
        ModelError: Other strides, or not a group of anchors for each.

    >>> yolo_fastest_xl_cfg(80).count("[yolo]")
    2
    """
    if strides not in _HEADS:
        raise ModelError(
            expected=f"heads at strides {' or '.join(map(str, _HEADS))}", found=f"{strides}", fix="give other strides"
        )
    cfg = CfgComposer(width_px, height_px, classes, strides, anchors_px)
    ends = _backbone(cfg)
    neck = _pooled_pyramid(cfg)
    if 32 in strides:
        _wide_blocks(cfg, 96)
        cfg.head(32)
        cfg.route(neck)
    cfg.beside_upsampled(ends[16])
    neck = _wide_blocks(cfg, 144)
    cfg.head(16)
    if 8 in strides:
        cfg.route(neck)
        cfg.convolution(64, 1)
        cfg.beside_upsampled(ends[8])
        _wide_blocks(cfg, 96)
        cfg.head(8)
    return cfg.text
