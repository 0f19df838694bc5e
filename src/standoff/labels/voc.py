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
from standoff.labels.layout_doubts import check_not_extents
from standoff.labels.pictures import SUFFIXES, canvas_of
from standoff.labels.places import elsewhere, find_named, first_there
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
    check_not_extents(pictures, folder)
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
    name = root.findtext("filename", "").strip()
    path, reading = _picture_file(folder, name, file.stem)
    objects = root.findall("object")
    canvas = canvas_of(path, _stated_px(root, file), marked=bool(objects))
    boxes = [[_number(one.find("bndbox"), corner, file) for corner in _CORNERS] for one in objects]
    return SourcePicture(
        path,
        canvas.size_px,
        tuple(_label(one, file) for one in objects),
        np.array(boxes, np.float64).reshape(-1, 4) - _TO_EDGES_PX,
        np.array([one.findtext("difficult", "0").strip() == "1" for one in objects], np.bool_),
        splits.get(file.stem),
        orientation=canvas.orientation,
        notes=(*elsewhere(path, name, reading), *canvas.notes),
    )


def _parse(file: Path) -> ET.Element:
    try:
        return ET.fromstring(file.read_bytes(), parser=ET.XMLParser(target=_NoDoctype()))
    except (OSError, ET.ParseError, ValueError, LookupError) as error:  # the last for encodings
        raise BadPicture(file, f"not XML of labels ({error})", "unreadable labels") from error


def _picture_file(folder: Path, name: str, stem: str) -> tuple[Path, str | None]:
    """Return the picture that the XML names, or one with the XML's own name, and how its name had to be read."""
    folders = [folder / inner for inner in _PICTURE_FOLDERS]
    own = [f"{stem}{suffix}" for suffix in (".jpg", *sorted(SUFFIXES - {".jpg"}))]
    path, reading = find_named(name or own[0], folders)
    if path.is_file():
        return path, reading
    return first_there(one / picture for one in folders for picture in own) or path, None


def _stated_px(root: ET.Element, file: Path) -> tuple[float, float] | None:
    """Return the size that is stated; None where it is left out or 0, as some programs have it."""
    if root.findtext("size/width", "0").strip() in ("", "0"):
        return None
    size = root.find("size")
    return _number(size, "width", file), _number(size, "height", file)


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
