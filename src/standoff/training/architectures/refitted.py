"""Fit a cfg to other classes, another input size, other anchors and ground points, and leave the rest as it is."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

from standoff.core.errors import ModelError
from standoff.training.architectures.composer import Anchors
from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.layers import POINT_VALUES

_SECTION: Final = re.compile(r"^\s*\[(\w+)\]", re.MULTILINE)
_POINT: Final = re.compile(r"^\s*ground_point\s*=\s*1", re.MULTILINE)


def refitted_cfg(text: str, classes: int, size_px: tuple[int, int], anchors_px: Anchors) -> str:
    r"""Return the text with other classes, input size and anchors.

    Args:
        text: Of a Darknet cfg with YOLO heads.
        classes: Number of classes.
        size_px: (width, height) of the input.
        anchors_px: Of each head, in the order of the text.

    Raises:
        ModelError: There is another number of heads, or no convolution right before one.

    >>> text = "[net]\nwidth=8\n[convolutional]\nfilters=255\n[yolo]\nmask=0\nanchors=1,1\nclasses=80\n"
    >>> print(refitted_cfg(text, 2, (64, 32), [[(4, 8)]]))  # doctest: +NORMALIZE_WHITESPACE
    [net]
    width=64
    height=32
    [convolutional]
    filters=7
    [yolo]
    mask=0
    anchors=4,8
    classes=2
    num=1
    """
    sections, heads, follows_convolution = _split(text)
    if len(heads) != len(anchors_px) or not follows_convolution:
        raise ModelError(
            expected=f"{len(anchors_px)} heads, each right after a convolution",
            found=f"{len(heads)} [yolo] sections",
            fix="give a cfg with YOLOv3 heads",
        )
    sections[0] = _with_options(sections[0], {"width": size_px[0], "height": size_px[1]})
    joined = ", ".join(f"{width:g},{height:g}" for head in anchors_px for width, height in head)
    first = 0
    for index, own in zip(heads, anchors_px, strict=True):
        mask = ",".join(str(first + number) for number in range(len(own)))
        first += len(own)
        options = {"mask": mask, "anchors": joined, "classes": classes, "num": sum(map(len, anchors_px))}
        values = 5 + classes + (POINT_VALUES if _POINT.search(sections[index]) else 0)
        sections[index] = _with_options(sections[index], options)
        sections[index - 1] = _with_options(sections[index - 1], {"filters": len(own) * values})
    return "".join(sections)


def pointed_cfg(text: str) -> str:
    r"""Return the text with heads that give ground points.

    Args:
        text: Of a Darknet cfg with YOLO heads.

    Raises:
        ModelError: There is no convolution right before a head, or the text is no cfg.

    >>> text = "[net]\n[convolutional]\nfilters=7\n[yolo]\nanchors=4,8\nclasses=2\n"
    >>> print(pointed_cfg(text))  # doctest: +NORMALIZE_WHITESPACE
    [net]
    [convolutional]
    filters=11
    [yolo]
    anchors=4,8
    classes=2
    ground_point=1
    """
    sections, heads, follows_convolution = _split(text)
    if not follows_convolution:
        raise ModelError(
            expected="heads each right after a convolution", found="another layer", fix="give a cfg with YOLOv3 heads"
        )
    for index, head in zip(heads, parse_cfg(text).heads, strict=True):
        filters = len(head.anchors_px) * replace(head, has_point=True).values
        sections[index - 1] = _with_options(sections[index - 1], {"filters": filters})
        sections[index] = _with_options(sections[index], {"ground_point": 1})
    return "".join(sections)


def _split(text: str) -> tuple[list[str], list[int], bool]:
    """Return the sections, which of them are heads, and whether each head follows a convolution."""
    starts = [match.start() for match in _SECTION.finditer(text)]
    sections = [text[start:stop] for start, stop in zip(starts, [*starts[1:], len(text)], strict=True)]
    kinds = [match.group(1) for match in _SECTION.finditer(text)]
    heads = [index for index, kind in enumerate(kinds) if kind == "yolo"]
    return sections, heads, all(kinds[head - 1] == "convolutional" for head in heads)


def _with_options(section: str, options: dict[str, object]) -> str:
    """Set options where they stand, and add those that are missing at the end."""
    for name, value in options.items():
        line = f"{name}={value}"
        section, found = re.subn(rf"^[ \t]*{name}[ \t]*=.*$", line, section, count=1, flags=re.MULTILINE)
        if not found:
            section = f"{section.rstrip()}\n{line}\n"
    return section
