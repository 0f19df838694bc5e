"""Fit somebody's cfg to other classes, another input size and other anchors, and leave the rest as it is."""

from __future__ import annotations

import re
from typing import Final

from standoff.core.errors import ModelError
from standoff.training.architectures.composer import Anchors

_SECTION: Final = re.compile(r"^\s*\[(\w+)\]", re.MULTILINE)


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
    starts = [match.start() for match in _SECTION.finditer(text)]
    sections = [text[start:stop] for start, stop in zip(starts, [*starts[1:], len(text)], strict=True)]
    kinds = [match.group(1) for match in _SECTION.finditer(text)]
    heads = [index for index, kind in enumerate(kinds) if kind == "yolo"]
    if len(heads) != len(anchors_px) or any(kinds[head - 1] != "convolutional" for head in heads):
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
        sections[index] = _with_options(sections[index], options)
        sections[index - 1] = _with_options(sections[index - 1], {"filters": len(own) * (5 + classes)})
    return "".join(sections)


def _with_options(section: str, options: dict[str, object]) -> str:
    """Set options where they stand, and add those that are missing at the end."""
    for name, value in options.items():
        line = f"{name}={value}"
        section, found = re.subn(rf"^[ \t]*{name}[ \t]*=.*$", line, section, count=1, flags=re.MULTILINE)
        if not found:
            section = f"{section.rstrip()}\n{line}\n"
    return section
