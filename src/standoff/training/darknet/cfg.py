"""Read a Darknet `.cfg` file into typed layers.

The text is a list of sections, `[net]` first and one section a layer after it, each followed by
`option=value` lines (`standoff.training.darknet.sections`). An option that could change what the network computes and
that is not understood is an error: a network that is nearly the right one gives wrong boxes without a sound.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from standoff.core.errors import ModelError
from standoff.training.darknet.layers import Convolutional, Dropout, Layer, Maxpool, Route, Shortcut, Upsample, Yolo
from standoff.training.darknet.sections import Section, read_cfg_text, read_sections

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class DarknetCfg:
    """A network as its cfg describes it.

    Attributes:
        name: File name, for messages.
        width_px: Input width.
        height_px: Input height.
        channels: Input channels.
        layers: In order; sources of routes and shortcuts are positions in this tuple.
        warnings: What the text says twice and differently.
    """

    name: str
    width_px: int
    height_px: int
    channels: int
    layers: tuple[Layer, ...]
    warnings: tuple[str, ...] = ()

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


def _source_index(section: Section, key: str, value: int, index: int) -> int:
    """Turn a layer number of the cfg, absolute or relative if negative, into a position."""
    source = value if value >= 0 else index + value
    if not 0 <= source < index:
        raise section.error(f"an earlier layer for '{key}'", f"{value}", section.word(key, "")[1])
    return source


def _convolutional(section: Section, _index: int) -> Convolutional:
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


def _shortcut(section: Section, index: int) -> Shortcut:
    sources = section.integers("from")
    if len(sources) != 1:
        raise section.error("one layer for 'from'", f"{len(sources)}", section.word("from", "")[1])
    return Shortcut(section.line, _source_index(section, "from", sources[0], index), section.activation("linear"))


def _route(section: Section, index: int) -> Route:
    sources = (_source_index(section, "layers", value, index) for value in section.integers("layers"))
    groups, group_id = section.integer("groups", 1), section.integer("group_id", 0, at_least=0)
    if group_id >= groups:
        line = section.word("group_id", "")[1]
        raise section.error(f"a group_id from 0 to {groups - 1} (groups={groups})", f"{group_id}", line)
    return Route(section.line, tuple(sources), groups, group_id)


def _upsample(section: Section, _index: int) -> Upsample:
    return Upsample(section.line, section.integer("stride", 2))


def _maxpool(section: Section, _index: int) -> Maxpool:
    stride = section.integer("stride", 1)
    size = section.integer("size", stride)
    padding = section.integer("padding", size - 1, at_least=0)
    if padding >= size or (padding % 2 and stride > 2):
        found = f"padding {padding}, size {size}, stride {stride}"
        raise section.error("a padding below the size, and even if the stride is over 2,", found)
    return Maxpool(section.line, size, stride, padding)


def _dropout(section: Section, _index: int) -> Dropout:
    probability = section.number("probability", 0.5)
    if not 0 <= probability < 1:
        raise section.error("a probability of at least 0 and below 1", f"{probability:g}")
    return Dropout(section.line, probability)


def _yolo(section: Section, _index: int) -> Yolo:
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
        new_coords=bool(section.integer("new_coords", 0, at_least=0)),
    )


_BUILDERS: Final[dict[str, Callable[[Section, int], Layer]]] = {
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
    sections = list(read_sections(text, name))
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
        name,
        net.integer("width", 416),
        net.integer("height", 416),
        net.integer("channels", 3),
        tuple(layers),
        tuple(warning for section in sections for warning in section.warnings),
    )
    if len({head.values for head in cfg.heads}) != 1:
        counts = ", ".join(f"{head.classes}{' with point' * head.has_point}" for head in cfg.heads) or "no [yolo] layer"
        expected = f"[yolo] layers with one number of classes, all with a ground point or none, in {name}"
        raise ModelError(expected=expected, found=counts, fix="correct the cfg file")
    _check_new_coords(cfg)
    return cfg


def _check_new_coords(cfg: DarknetCfg) -> None:
    """Refuse heads whose sigmoid is nowhere: early Darknets had it in the head, today's in the convolution before."""
    for index, head in enumerate(cfg.layers):
        before = cfg.layers[index - 1] if index else None
        if not isinstance(head, Yolo) or not head.new_coords:
            continue
        if not isinstance(before, Convolutional) or before.activation != "logistic":
            raise ModelError(
                expected=f"a convolution with activation=logistic before new_coords=1, for {cfg.section(index)}",
                found="none" if not isinstance(before, Convolutional) else f"activation={before.activation}",
                fix="take the cfg file of a later Darknet",
            )


def read_cfg(path: Path) -> DarknetCfg:
    """Read a Darknet cfg file; warn of what it says twice and differently.

    Raises:
        ModelError: It cannot be read, or see `parse_cfg`.
    """
    cfg = parse_cfg(read_cfg_text(path), path.name)
    for warning in cfg.warnings:
        _LOG.warning("%s", warning)
    return cfg
