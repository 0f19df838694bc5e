"""The networks that can be asked for by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Final, TypeAlias

from standoff.training.architectures.composer import Anchors
from standoff.training.architectures.efficientnet_lite import efficientnet_lite0_cfg
from standoff.training.architectures.yolo_fastest import yolo_fastest_xl_cfg
from standoff.training.architectures.yolov3 import yolov3_cfg, yolov3_tiny_cfg

Composer: TypeAlias = Callable[[int, int, int, Anchors], str]
"""Classes, input width and height in px, anchors of each head: cfg text."""


@dataclass(frozen=True, slots=True)
class Architecture:
    """A network that can be composed for any classes, input size and anchors.

    Attributes:
        strides: Input pixels per cell of its heads, from fine to coarse.
        compose: Returns its cfg text.
    """

    strides: tuple[int, ...]
    compose: Composer


def _yolo_fastest(*strides: int) -> Architecture:
    return Architecture(strides, partial(yolo_fastest_xl_cfg, strides=strides))


ARCHITECTURES: Final[Mapping[str, Architecture]] = MappingProxyType(
    {
        "yolov3": Architecture((8, 16, 32), yolov3_cfg),
        "yolov3-tiny": Architecture((16, 32), yolov3_tiny_cfg),
        "yolo-fastest-xl": _yolo_fastest(16, 32),
        "yolo-fastest-xl-8-16": _yolo_fastest(8, 16),
        "yolo-fastest-xl-8-16-32": _yolo_fastest(8, 16, 32),
        "efficientnet-lite0": Architecture((8, 16, 32), efficientnet_lite0_cfg),
    }
)
"""By the name that `--arch` takes."""
