"""Pascal VOC folders: an XML file for each picture in `Annotations`, pictures in `JPEGImages`.

Corners are indices of pixels by custom, counted from 1, both inside the box: the first pixel alone is 1, 1, 1, 1. Ours
are 0 at the centre of the first pixel and name edges, so the same box is -0.5 to 0.5. Boxes marked `difficult` become
ignored regions, as they are in the challenge's own score.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from standoff.files.plain_text import read_text
from standoff.labels.pictures import SUFFIXES, first_file, read_size_px
from standoff.labels.source import BadPicture, SourcePicture, SourceSet, read_each
from standoff.labels.types import SPLITS, Split

_CORNERS: Final = ("xmin", "ymin", "xmax", "ymax")
_TO_EDGES_PX: Final = np.array([1.5, 1.5, 0.5, 0.5])
_PICTURE_FOLDERS: Final = ("JPEGImages", "images", ".")


class _NoDoctype(ET.TreeBuilder):
    """Refuse document types: labels need none, and entities defined in them can grow without bounds."""

    def doctype(self, name: str, pubid: str, system: str) -> None:
        raise ET.ParseError(f"a document type ({name})")


def read_voc(folder: Path) -> SourceSet:
    """Read a folder with `Annotations`; `ImageSets/Main/{train,val,test}.txt` say the splits where they are."""
    splits = _read_splits(folder / "ImageSets" / "Main")
    files = sorted((folder / "Annotations").rglob("*.xml"))
    pictures, problems = read_each(files, partial(_read_picture, folder, splits))
    labels = sorted({label for picture in pictures for label in picture.labels})
    return SourceSet(tuple(labels), pictures, problems)


def _read_splits(folder: Path) -> dict[str, Split]:
    """Return the split of each stem."""
    splits: dict[str, Split] = {}
    for split in SPLITS:
        if (folder / f"{split}.txt").is_file():
            lines = read_text(folder / f"{split}.txt", "a list of pictures").splitlines()
            splits |= {line.split()[0]: split for line in lines if line.strip()}
    return splits


def _read_picture(folder: Path, splits: dict[str, Split], file: Path) -> SourcePicture:
    root = _parse(file)
    path = _picture_file(folder, root.findtext("filename", "").strip(), file.stem)
    size_px = read_size_px(path)
    stated = tuple(_number(root.find("size"), side, file) for side in ("width", "height")) if _has_size(root) else None
    if stated is not None and stated != size_px:
        raise BadPicture(path, f"{size_px} pixels where its labels say {stated}", "size differs from labels")
    objects = root.findall("object")
    boxes = [[_number(one.find("bndbox"), corner, file) for corner in _CORNERS] for one in objects]
    return SourcePicture(
        path,
        size_px,
        tuple(_label(one, file) for one in objects),
        np.array(boxes, np.float64).reshape(-1, 4) - _TO_EDGES_PX,
        np.array([one.findtext("difficult", "0").strip() == "1" for one in objects], np.bool_),
        splits.get(file.stem),
    )


def _parse(file: Path) -> ET.Element:
    try:
        return ET.fromstring(file.read_bytes(), parser=ET.XMLParser(target=_NoDoctype()))
    except (OSError, ET.ParseError, ValueError) as error:
        raise BadPicture(file, f"not XML of labels ({error})", "unreadable labels") from error


def _picture_file(folder: Path, name: str, stem: str) -> Path:
    """Return the picture that the XML names, or one with the XML's own name."""
    names = ([name] if name else []) + [f"{stem}{suffix}" for suffix in (".jpg", *sorted(SUFFIXES - {".jpg"}))]
    return first_file([folder / inner / one for inner in _PICTURE_FOLDERS for one in names])


def _has_size(root: ET.Element) -> bool:
    """Return whether the size is stated: some programs leave it out or write 0."""
    return root.findtext("size/width", "0").strip() not in ("", "0")


def _label(one: ET.Element, file: Path) -> str:
    label = one.findtext("name", "").strip()
    if not label:
        raise BadPicture(file, "an object without name", "unreadable labels")
    return label


def _number(parent: ET.Element | None, name: str, file: Path) -> float:
    text = "" if parent is None else parent.findtext(name, "")
    try:
        number = float(text)
    except ValueError as error:
        raise BadPicture(file, f"'{text}' for {name}", "unreadable labels") from error
    if not np.isfinite(number):
        raise BadPicture(file, f"'{text}' for {name}", "unreadable labels")
    return number
