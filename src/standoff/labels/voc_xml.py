"""XML of Pascal VOC: find the objects, also where a program has them elsewhere, and whatever else may be one."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path
from typing import Final

from standoff.labels.source import UNPLACEABLE, BadPicture
from standoff.labels.strays import is_four_numbers, mark_among, plain

UNREADABLE: Final = "unreadable labels"
"""Kind of problem of a file that is not what it should be."""
_ROOT, _OBJECT, _BOX = "annotation", "object", "bndbox"
_AROUND: Final = frozenset({"objects", "annotations", _ROOT})
"""Elements that may be around objects, or around the whole, and say no more of them."""
_OF_THE_PICTURE: Final = frozenset({"folder", "filename", "path", "source", "owner", "size", "segmented"})


class _NoDoctype(ET.TreeBuilder):
    """Refuse document types: labels need none, and entities defined in them can grow without bounds."""

    def doctype(self, name: str, pubid: str, system: str) -> None:
        raise ET.ParseError(f"a document type ({name})")


def parse(file: Path) -> ET.Element:
    """Return the element that describes the picture; names in it are in small letters, without namespaces.

    Raises:
        BadPicture: It is not XML, or not of one picture.
    """
    try:
        root = ET.fromstring(file.read_bytes(), parser=ET.XMLParser(target=_NoDoctype()))
    except (OSError, ET.ParseError, ValueError, LookupError) as error:  # the last for encodings
        raise BadPicture(file, f"not XML of labels ({error})", UNREADABLE) from error
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2].lower()
    pictures = [root] if root.tag == _ROOT or root.find(_OBJECT) is not None else root.findall(_ROOT)
    if len(pictures) != 1:
        found = f"<{root.tag}> with {len(pictures)} times <{_ROOT}>, where one should be"
        raise BadPicture(file, found, UNREADABLE)
    return pictures[0]


def objects_of(picture: ET.Element, file: Path) -> list[ET.Element]:
    """Return the objects of a picture, each with one box.

    Raises:
        BadPicture: Something else may be an object as well, or an object is damaged.
    """
    objects: list[ET.Element] = []
    _collect(picture, objects, file)
    for one in objects:
        counts = Counter(child.tag for child in one)
        twice = next((tag for tag in ("name", _BOX) if counts[tag] > 1), None)
        if twice is not None:
            raise BadPicture(file, f"an object with {counts[twice]} times <{twice}>", UNREADABLE)
        if not counts[_BOX]:
            other = mark_among(counts)
            raise BadPicture(file, f"an object without <{_BOX}>" + (f", with <{other}>" if other else ""), UNREADABLE)
        if one.find(f".//{_OBJECT}") is not None:
            raise BadPicture(file, "an object within an object", UNREADABLE)
    return objects


def _collect(parent: ET.Element, objects: list[ET.Element], file: Path) -> None:
    for child in parent:
        if child.tag == _OBJECT:
            objects.append(child)
        elif child.tag in _AROUND:
            _refuse_mark(child.tag, [*child.attrib], file)
            _collect(child, objects, file)
        elif child.tag not in _OF_THE_PICTURE:
            _refuse_stray(child, file)


def _refuse_stray(element: ET.Element, file: Path) -> None:
    """Refuse an element that is not known and has a box in it: a thing that another program calls otherwise."""
    for one in element.iter():
        _refuse_mark(element.tag, [one.tag, *one.attrib, *(child.tag for child in one)], file)
        if is_four_numbers(one.text) or any(is_four_numbers(text) for text in one.attrib.values()):
            raise BadPicture(file, f"four numbers in <{element.tag}>, which is no <{_OBJECT}>: a box?", UNPLACEABLE)


def _refuse_mark(tag: str, names: list[str], file: Path) -> None:
    if (mark := mark_among(names)) is not None:
        shown = f"<{tag}>" if plain(mark) == plain(tag) else f"'{mark}' in <{tag}>"
        raise BadPicture(file, f"{shown}, which is no <{_OBJECT}> of the picture: a thing?", UNPLACEABLE)
