"""Write a Darknet cfg layer by layer; every layer's number is known when a later one needs it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

from standoff.core.errors import ModelError
from standoff.training.darknet.sections import Activation

Anchors: TypeAlias = Sequence[Sequence[tuple[float, float]]]
"""(width, height) in network input pixels of each head's anchors; heads from fine to coarse."""


def _section(name: str, options: Mapping[str, object]) -> str:
    return "\n".join([f"[{name}]", *(f"{key}={value}" for key, value in options.items()), ""])


class CfgComposer:
    """A cfg in the making.

    Each method that adds a layer returns the layer's number, which `route` and `shortcut` take.

    Args:
        width_px: Width of the network's input.
        height_px: Height of the network's input.
        classes: Number of classes.
        strides: Of the heads, from fine to coarse.
        anchors_px: Anchors of each head, in the same order.

    Raises:
        ModelError: A head has no anchors, or there are anchors for more heads.
    """

    def __init__(
        self, width_px: int, height_px: int, classes: int, strides: tuple[int, ...], anchors_px: Anchors
    ) -> None:
        if len(anchors_px) != len(strides) or not all(anchors_px):
            raise ModelError(
                expected=f"anchors for each of the heads at strides {', '.join(map(str, strides))}",
                found=f"groups of {', '.join(str(len(group)) for group in anchors_px) or 'no'} anchors",
                fix="give as many groups of anchors as heads",
            )
        self._strides = strides
        self._sections = [_section("net", {"width": width_px, "height": height_px, "channels": 3})]
        self._classes = classes
        self._anchors_px = anchors_px

    @property
    def last(self) -> int:
        """Number of the layer that was added last."""
        return len(self._sections) - 2

    @property
    def text(self) -> str:
        """The cfg."""
        return "\n".join(self._sections)

    def convolution(
        self, filters: int, size: int, stride: int = 1, *, groups: int = 1, activation: Activation = "leaky"
    ) -> int:
        """Add a convolution with batch normalisation, padded to keep its size at stride 1."""
        options = {"batch_normalize": 1, "filters": filters, "size": size, "stride": stride, "pad": 1}
        if groups > 1:
            options["groups"] = groups
        return self._add("convolutional", {**options, "activation": activation})

    def maxpool(self, size: int, stride: int) -> int:
        """Add a maximum over windows."""
        return self._add("maxpool", {"size": size, "stride": stride})

    def dropout(self, probability: float) -> int:
        """Add a dropout."""
        return self._add("dropout", {"probability": probability})

    def shortcut(self, source: int) -> int:
        """Add layer `source` to the last one."""
        return self._add("shortcut", {"from": source - self.last - 1, "activation": "linear"})

    def route(self, *sources: int) -> int:
        """Put the channels of layers one after another."""
        return self._add("route", {"layers": ",".join(map(str, sources))})

    def beside_upsampled(self, earlier: int) -> int:
        """Double the size of the last layer and put layer `earlier` behind it."""
        upsampled = self._add("upsample", {"stride": 2})
        return self.route(upsampled, earlier)

    def head(self, stride: int) -> int:
        """Add the detection head at a stride: a last convolution and the layer that decodes it."""
        position = self._strides.index(stride)
        sides = [f"{width:g},{height:g}" for head in self._anchors_px for width, height in head]
        first = sum(len(head) for head in self._anchors_px[:position])
        mask = range(first, first + len(self._anchors_px[position]))
        last = {"filters": len(mask) * (5 + self._classes), "size": 1, "stride": 1, "pad": 1, "activation": "linear"}
        self._add("convolutional", last)
        yolo = {"mask": ",".join(map(str, mask)), "anchors": ", ".join(sides), "classes": self._classes}
        return self._add("yolo", {**yolo, "num": len(sides)})

    def _add(self, name: str, options: Mapping[str, object]) -> int:
        self._sections.append(_section(name, options))
        return self.last
