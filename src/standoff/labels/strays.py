"""Marks that are not where a layout has them: a picture that has such ones is not a picture without things."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

_BOXES: Final = frozenset(
    {
        *("bbox", "bboxes", "bndbox", "bndboxes", "boundingbox", "boundingboxes", "box", "boxes", "cuboid", "ellipse"),
        *("geometry", "keypoints", "mask", "obb", "object", "objects", "polygon", "polygons", "polyline"),
        *("rectangle", "rectanglelabels", "robndbox", "segmentation", "segmentations"),
    }
)
_COORDINATES: Final = frozenset(
    {
        *("xmin", "ymin", "xmax", "ymax", "x", "y", "w", "h", "width", "height", "cx", "cy", "xc", "yc"),
        *("left", "top", "right", "bottom", "xcenter", "ycenter", "xcentre", "ycentre", "centerx", "centery"),
        *("minx", "miny", "maxx", "maxy", "xtl", "ytl", "xbr", "ybr", "tlx", "tly", "brx", "bry"),
        *("x0", "y0", "x1", "y1", "x2", "y2", "x3", "y3", "x4", "y4"),
    }
)
_FEWEST: Final = 3
"""Coordinates: two may be a size or a place on the earth."""
_NUMBER: Final = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_FOUR_NUMBERS: Final = re.compile(rf"[\s\[({{]*{_NUMBER}(?:[\s,;]+{_NUMBER}){{3,}}[\s\])}}]*")


def plain(name: str) -> str:
    """Return a name without what programs write differently.

    >>> plain("Bounding_Box"), plain("{http://x}xMin")
    ('boundingbox', 'xmin')
    """
    return re.sub(r"[^0-9a-z]", "", name.rpartition("}")[2].lower())


def mark_among(names: Iterable[str]) -> str | None:
    """Return which of the names of a thing's parts shows that it is a mark in a picture; None: none of them.

    >>> mark_among(["label", "BBox"]), mark_among(["x1", "y1", "x2"]), mark_among(["width", "height"])
    ('BBox', 'x1', None)
    """
    names = list(names)
    for name in names:
        if plain(name) in _BOXES:
            return name
    coordinates = {plain(name): name for name in names if plain(name) in _COORDINATES}
    return next(iter(coordinates.values())) if len(coordinates) >= _FEWEST else None


def is_four_numbers(text: str | None) -> bool:
    """Tell whether a text is four numbers or more and nothing else.

    >>> is_four_numbers("12, 13, 40, 50"), is_four_numbers("2026-11-28 12:30")
    (True, False)
    """
    return text is not None and _FOUR_NUMBERS.fullmatch(text) is not None


def mark_within(value: object) -> str | None:
    """Return the name that shows a mark somewhere in a value of a JSON file; None where there is no mark."""
    for entry in _mappings(value):
        # A text of such a name is a file, a number a count.
        names = [
            key for key, one in entry.items() if plain(key) not in _BOXES or (one and isinstance(one, list | dict))
        ]
        if (name := mark_among(names)) is not None:
            return name
    return None


def _mappings(value: object) -> Iterator[Mapping[str, object]]:
    waiting = [value]
    while waiting:
        one = waiting.pop()
        if isinstance(one, Mapping):
            yield one
            waiting += one.values()
        elif isinstance(one, list):
            waiting += one
