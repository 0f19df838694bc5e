"""Find out what network a weights file belongs to, and which of its layers are those of another network.

A weights file does not say what it is; its length nearly always does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final, TypeAlias

import numpy as np

from standoff.training.architectures import yolo_fastest_xl_cfg, yolov3_cfg, yolov3_tiny_cfg
from standoff.training.darknet.cfg import DarknetCfg, parse_cfg
from standoff.training.darknet.layers import Convolutional, Yolo
from standoff.training.darknet.shapes import layer_shapes, layer_strides, weights_numbers

_Kind: TypeAlias = tuple[object, ...]

_PUBLISHED: Final[dict[str, Callable[[int], str]]] = {
    "yolov3": yolov3_cfg,
    "yolov3-tiny": yolov3_tiny_cfg,
    "yolo-fastest-xl": yolo_fastest_xl_cfg,
}
"""Those whose weights other people publish; with the anchors that these have."""


def cfg_by_length(cfg: DarknetCfg, numbers: int) -> DarknetCfg | None:
    """Return the cfg of the complete network that a weights file belongs to.

    Args:
        cfg: Of the network that is to start from it.
        numbers: How many the file holds.

    Returns:
        The same network with another number of classes, or a known architecture most of whose layers it has; None if
        the length fits none of them.
    """
    for name, compose in _PUBLISHED.items():
        known = parse_cfg(compose(1), name)
        classes = _classes_by_length(known, numbers)
        if classes is not None and len(matching_layers(cfg, known)) > len(_kinds(known)) // 2:
            return parse_cfg(compose(classes), name)
    classes = _classes_by_length(cfg, numbers)
    return None if classes is None else _with_classes(cfg, classes)


def _classes_by_length(cfg: DarknetCfg, numbers: int) -> int | None:
    one, two = (weights_numbers(_with_classes(cfg, classes)) for classes in (1, 2))
    if one == two:
        return None
    further, left_over = divmod(numbers - one, two - one)
    return further + 1 if further >= 0 and left_over == 0 else None


def _with_classes(cfg: DarknetCfg, classes: int) -> DarknetCfg:
    layers = list(cfg.layers)
    for index, layer in enumerate(cfg.layers):
        if isinstance(layer, Yolo):
            before = layers[index - 1]
            resized = replace(layer, classes=classes)
            if isinstance(before, Convolutional):
                layers[index - 1] = replace(before, filters=len(layer.anchors_px) * resized.values)
                layers[index] = resized
    return replace(cfg, layers=tuple(layers))


def _kinds(cfg: DarknetCfg) -> list[tuple[int, _Kind]]:
    """Return the convolutions with what must agree for one's weights to make sense in the other's place."""
    strides = layer_strides(cfg)
    channels = (cfg.channels, *(shape.channels for shape in layer_shapes(cfg)))
    kinds: list[tuple[int, _Kind]] = []
    for index, layer in enumerate(cfg.layers):
        if isinstance(layer, Convolutional):
            is_head = index + 1 < len(cfg.layers) and isinstance(cfg.layers[index + 1], Yolo)
            filters = "head" if is_head else layer.filters
            shape = (filters, channels[index], layer.size, layer.stride, layer.groups, layer.batch_normalized)
            kinds.append((index, (strides[index], *shape)))
    return kinds


def matching_layers(cfg: DarknetCfg, source: DarknetCfg) -> dict[int, int]:
    """Match as many convolutions of two networks as possible, in order (their longest common subsequence).

    Two match if they have the same shape, groups and pixels per cell; heads whatever their anchors and classes.

    Returns:
        Layer numbers in `cfg`, and those in `source` that match them.
    """
    own, others = _kinds(cfg), _kinds(source)
    longest = np.zeros((len(own) + 1, len(others) + 1), dtype=np.int64)
    for i in reversed(range(len(own))):
        for j in reversed(range(len(others))):
            if own[i][1] == others[j][1]:
                longest[i, j] = longest[i + 1, j + 1] + 1
            else:
                longest[i, j] = max(longest[i + 1, j], longest[i, j + 1])
    matches: dict[int, int] = {}
    i = j = 0
    while i < len(own) and j < len(others):
        if own[i][1] == others[j][1]:
            matches[own[i][0]] = others[j][0]
            i, j = i + 1, j + 1
        elif longest[i + 1, j] >= longest[i, j + 1]:
            i += 1
        else:
            j += 1
    return matches
