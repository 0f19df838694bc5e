"""The layers of a Darknet network, as its cfg describes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, TypeAlias

from standoff.training.darknet.sections import Activation

POINT_VALUES: Final = 4
"""Of an anchor with a ground point: x and y, and the logarithms of their standard errors."""


@dataclass(frozen=True, slots=True)
class Convolutional:
    """Convolution, then batch normalisation or a bias, then the activation.

    Attributes:
        line: Line of the section's head in the cfg.
        filters: Output channels.
        size: Side of the square kernel.
        stride: Step in both directions.
        padding: Zeros added on each side.
        groups: Channel groups.
        batch_normalized: Normalisation in place of a bias.
        activation: Applied last.
    """

    line: int
    filters: int
    size: int
    stride: int
    padding: int
    groups: int
    batch_normalized: bool
    activation: Activation


@dataclass(frozen=True, slots=True)
class Shortcut:
    """Sum of the previous layer and layer `source`, then the activation."""

    line: int
    source: int
    activation: Activation


@dataclass(frozen=True, slots=True)
class Route:
    """Channels of the layers `sources`, one after another: of each the part `group_id` of `groups` equal ones."""

    line: int
    sources: tuple[int, ...]
    groups: int = 1
    group_id: int = 0


@dataclass(frozen=True, slots=True)
class Upsample:
    """Each pixel repeated `stride` times in both directions."""

    line: int
    stride: int


@dataclass(frozen=True, slots=True)
class Maxpool:
    """Maximum over a window; `padding` is the sum of both sides, the smaller half left and top."""

    line: int
    size: int
    stride: int
    padding: int


@dataclass(frozen=True, slots=True)
class Dropout:
    """Does something while training only."""

    line: int
    probability: float


@dataclass(frozen=True, slots=True)
class Yolo:
    """Detection head: turns the previous layer into boxes.

    Attributes:
        line: Line of the section's head in the cfg.
        anchors_px: (width, height) of this head's own anchors, in network input pixels.
        classes: Number of classes.
        scale_xy: Stretches the box centre's sigmoid about its middle (`scale_x_y`).
        has_point: Each anchor also gives a ground point and its error (`ground_point`; Darknet itself has none).
        new_coords: The convolution before it has the sigmoid, and a side is the anchor's times 4 raw^2, not exp(raw).
    """

    line: int
    anchors_px: tuple[tuple[float, float], ...]
    classes: int
    scale_xy: float
    has_point: bool = False
    new_coords: bool = False

    @property
    def values(self) -> int:
        """Numbers an anchor and cell: box and objectness, classes, then the point if there is one."""
        return 5 + self.classes + (POINT_VALUES if self.has_point else 0)


Layer: TypeAlias = Convolutional | Shortcut | Route | Upsample | Maxpool | Dropout | Yolo
