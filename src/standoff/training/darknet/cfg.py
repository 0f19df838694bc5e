"""Read a Darknet `.cfg` file into typed layers.

The text is a list of sections, `[net]` first and one section a layer after it, each followed by
`option=value` lines. An option that could change what the network computes and that is not
understood is an error: a network that is nearly the right one gives wrong boxes without a sound.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, TypeAlias, cast, get_args

from standoff.core.errors import ModelError
from standoff.files.plain_text import read_text

Activation = Literal["linear", "leaky", "logistic", "relu", "relu6"]
POINT_VALUES: Final = 4  # x and y, and the logarithms of their standard errors


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
    """Channels of the layers `sources`, one after another."""

    line: int
    sources: tuple[int, ...]


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
    """

    line: int
    anchors_px: tuple[tuple[float, float], ...]
    classes: int
    scale_xy: float
    has_point: bool = False

    @property
    def values(self) -> int:
        """Numbers an anchor and cell: box and objectness, classes, then the point if there is one."""
        return 5 + self.classes + (POINT_VALUES if self.has_point else 0)


Layer: TypeAlias = Convolutional | Shortcut | Route | Upsample | Maxpool | Dropout | Yolo


@dataclass(frozen=True, slots=True)
class DarknetCfg:
    """A network as its cfg describes it.

    Attributes:
        name: File name, for messages.
        width_px: Input width.
        height_px: Input height.
        channels: Input channels.
        layers: In order; sources of routes and shortcuts are positions in this tuple.
    """

    name: str
    width_px: int
    height_px: int
    channels: int
    layers: tuple[Layer, ...]

    @property
    def heads(self) -> tuple[Yolo, ...]:
        """The detection heads, in order."""
        return tuple(layer for layer in self.layers if isinstance(layer, Yolo))

    def section(self, index: int) -> str:
        r"""Name a layer for a message.

        >>> parse_cfg("[net]\n[upsample]\n[yolo]\nanchors=1,1\nmask=0\n", "a.cfg").section(0)
        'layer 0, [upsample] at line 2 of a.cfg'
        """
        layer = self.layers[index]
        return f"layer {index}, [{type(layer).__name__.lower()}] at line {layer.line} of {self.name}"


# They steer training or Darknet's own post-processing; the network computes the same without them.
_TRAINING_OPTIONS: Final = frozenset(
    {
        "beta_nms",
        "burnin_update",
        "cls_normalizer",
        "delta_normalizer",
        "focal_loss",
        "ignore_thresh",
        "iou_loss",
        "iou_normalizer",
        "iou_thresh",
        "iou_thresh_kind",
        "jitter",
        "label_smooth_eps",
        "learning_rate",
        "max",
        "max_delta",
        "nms_kind",
        "obj_normalizer",
        "objectness_smooth",
        "random",
        "resize",
        "stopbackward",
        "train_only_bn",
        "truth_thresh",
    }
)


@dataclass(slots=True)
class _Section:
    name: str
    line: int
    source: str
    options: dict[str, tuple[str, int]] = field(default_factory=dict)
    read: set[str] = field(default_factory=set)

    def error(self, expected: str, found: str, line: int | None = None) -> ModelError:
        where = f"in [{self.name}] at line {line or self.line} of {self.source}"
        return ModelError(expected=f"{expected} {where}", found=found, fix="correct the cfg file")

    def word(self, key: str, default: str) -> tuple[str, int]:
        self.read.add(key)
        return self.options.get(key, (default, self.line))

    def numbers(self, key: str, default: str = "") -> tuple[float, ...]:
        text, line = self.word(key, default)
        try:
            return tuple(float(part) for part in text.split(",") if part)
        except ValueError:
            raise self.error(f"numbers for '{key}'", f"'{text}'", line) from None

    def number(self, key: str, default: float) -> float:
        numbers = self.numbers(key, repr(default))
        if len(numbers) != 1:
            raise self.error(f"one number for '{key}'", f"{len(numbers)}", self.word(key, "")[1])
        return numbers[0]

    def integers(self, key: str) -> tuple[int, ...]:
        numbers = self.numbers(key)
        if not numbers or any(number != int(number) for number in numbers):
            text, line = self.word(key, "")
            raise self.error(f"whole numbers for '{key}'", f"'{text}'", line)
        return tuple(int(number) for number in numbers)

    def integer(self, key: str, default: int, *, at_least: int = 1) -> int:
        number = self.number(key, default)
        if number != int(number) or number < at_least:
            text, line = self.word(key, "")
            raise self.error(f"a whole number of at least {at_least} for '{key}'", f"'{text}'", line)
        return int(number)

    def activation(self, default: Activation) -> Activation:
        name, line = self.word("activation", default)
        if name not in get_args(Activation):
            raise self.error(f"an activation of {', '.join(get_args(Activation))}", f"'{name}'", line)
        return cast(Activation, name)

    def refuse_unread(self) -> None:
        for key in self.options.keys() - self.read - _TRAINING_OPTIONS:
            raise self.error("only options that standoff understands", f"'{key}'", self.options[key][1])


def _sections(text: str, source: str) -> Iterator[_Section]:
    section: _Section | None = None
    for line_number, raw in enumerate(text.splitlines(), start=1):
        line = "".join(raw.split("#")[0].split())
        if not line or line.startswith(";"):
            continue
        if line.startswith("["):
            if section is not None:
                yield section
            section = _Section(line.strip("[]"), line_number, source)
            continue
        key, equals, value = line.partition("=")
        if section is None or not equals:
            raise ModelError(
                expected=f"a [section] or option=value at line {line_number} of {source}",
                found=f"'{line[:40]}'",
                fix="give a Darknet cfg file",
            )
        if key in section.options:
            raise section.error(f"'{key}' once", "it twice", line_number)
        section.options[key] = (value, line_number)
    if section is not None:
        yield section


def _source_index(section: _Section, key: str, value: int, index: int) -> int:
    """Turn a layer number of the cfg, absolute or relative if negative, into a position."""
    source = value if value >= 0 else index + value
    if not 0 <= source < index:
        raise section.error(f"an earlier layer for '{key}'", f"{value}", section.word(key, "")[1])
    return source


def _convolutional(section: _Section, _index: int) -> Convolutional:
    size = section.integer("size", 1)
    padding = section.integer("padding", 0, at_least=0)
    return Convolutional(
        line=section.line,
        filters=section.integer("filters", 1),
        size=size,
        stride=section.integer("stride", 1),
        padding=size // 2 if section.integer("pad", 0, at_least=0) else padding,
        groups=section.integer("groups", 1),
        batch_normalized=bool(section.integer("batch_normalize", 0, at_least=0)),
        activation=section.activation("logistic"),
    )


def _shortcut(section: _Section, index: int) -> Shortcut:
    sources = section.integers("from")
    if len(sources) != 1:
        raise section.error("one layer for 'from'", f"{len(sources)}", section.word("from", "")[1])
    return Shortcut(section.line, _source_index(section, "from", sources[0], index), section.activation("linear"))


def _route(section: _Section, index: int) -> Route:
    sources = (_source_index(section, "layers", value, index) for value in section.integers("layers"))
    return Route(section.line, tuple(sources))


def _upsample(section: _Section, _index: int) -> Upsample:
    return Upsample(section.line, section.integer("stride", 2))


def _maxpool(section: _Section, _index: int) -> Maxpool:
    stride = section.integer("stride", 1)
    size = section.integer("size", stride)
    padding = section.integer("padding", size - 1, at_least=0)
    if padding >= size or (padding % 2 and stride > 2):
        found = f"padding {padding}, size {size}, stride {stride}"
        raise section.error("a padding below the size, and even if the stride is over 2,", found)
    return Maxpool(section.line, size, stride, padding)


def _dropout(section: _Section, _index: int) -> Dropout:
    probability = section.number("probability", 0.5)
    if not 0 <= probability < 1:
        raise section.error("a probability of at least 0 and below 1", f"{probability:g}")
    return Dropout(section.line, probability)


def _yolo(section: _Section, _index: int) -> Yolo:
    sides = section.numbers("anchors")
    count = section.integer("num", len(sides) // 2 or 1)
    if not sides or len(sides) != 2 * count or min(sides) <= 0:
        line = section.word("anchors", "")[1]
        raise section.error(f"{2 * count} positive anchor sides (num={count})", f"{len(sides)} numbers", line)
    mask = section.integers("mask") if "mask" in section.options else tuple(range(count))
    if min(mask) < 0 or max(mask) >= count:
        line = section.word("mask", "")[1]
        raise section.error(f"mask numbers from 0 to {count - 1}", f"{list(mask)}", line)
    return Yolo(
        line=section.line,
        anchors_px=tuple((sides[2 * anchor], sides[2 * anchor + 1]) for anchor in mask),
        classes=section.integer("classes", 20),
        scale_xy=section.number("scale_x_y", 1.0),
        has_point=bool(section.integer("ground_point", 0, at_least=0)),
    )


_BUILDERS: Final[dict[str, Callable[[_Section, int], Layer]]] = {
    "convolutional": _convolutional,
    "shortcut": _shortcut,
    "route": _route,
    "upsample": _upsample,
    "maxpool": _maxpool,
    "dropout": _dropout,
    "yolo": _yolo,
}


def parse_cfg(text: str, name: str = "cfg") -> DarknetCfg:
    r"""Parse the text of a Darknet cfg.

    Args:
        text: The file's content.
        name: What messages call it.

    Raises:
        ModelError: Not a cfg, or a layer, activation or option that is not understood; says the
            section and the line.

    >>> cfg = parse_cfg("[net]\nwidth=32\nheight=32\n[yolo]\nanchors=4,8\nclasses=2")
    >>> cfg.heads[0].anchors_px
    ((4.0, 8.0),)
    """
    sections = list(_sections(text, name))
    if not sections or sections[0].name not in ("net", "network"):
        found = f"[{sections[0].name}]" if sections else "no section"
        raise ModelError(expected=f"[net] first in {name}", found=found, fix="give a Darknet cfg file")
    net, *rest = sections
    layers: list[Layer] = []
    for index, section in enumerate(rest):
        builder = _BUILDERS.get(section.name)
        if builder is None:
            raise section.error(f"a layer of {', '.join(_BUILDERS)}", f"[{section.name}]")
        layers.append(builder(section, index))
        section.refuse_unread()
    cfg = DarknetCfg(
        name, net.integer("width", 416), net.integer("height", 416), net.integer("channels", 3), tuple(layers)
    )
    if len({head.values for head in cfg.heads}) != 1:
        counts = ", ".join(f"{head.classes}{' with point' * head.has_point}" for head in cfg.heads) or "no [yolo] layer"
        expected = f"[yolo] layers with one number of classes, all with a ground point or none, in {name}"
        raise ModelError(expected=expected, found=counts, fix="correct the cfg file")
    return cfg


def read_cfg(path: Path) -> DarknetCfg:
    """Read a Darknet cfg file.

    Raises:
        ModelError: It cannot be read, or see `parse_cfg`.
    """
    return parse_cfg(read_text(path, "a Darknet cfg file", ModelError), path.name)
