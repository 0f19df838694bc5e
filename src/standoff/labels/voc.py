"""Pascal VOC folders: an XML file for each picture in `Annotations`, pictures in `JPEGImages`.

Corners are indices of pixels by custom, counted from 1, both inside the box: the first pixel alone is 1, 1, 1, 1. Ours
are 0 at the centre of the first pixel and name edges, so the same box is -0.5 to 0.5. A set in which 0 occurs counts
from 0, and is read so. Boxes marked `difficult` become ignored regions, as they are in the challenge's own score.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from standoff.files.below import files_below
from standoff.files.plain_text import read_text
from standoff.labels.layout_doubts import CORNERS, check_layout
from standoff.labels.pictures import SUFFIXES, canvas_of
from standoff.labels.places import elsewhere, find_named, first_there
from standoff.labels.source import BadPicture, SourcePicture, SourceSet, read_each
from standoff.labels.truth_values import is_true
from standoff.labels.types import SPLITS, Problem, Split
from standoff.labels.voc_xml import UNREADABLE, objects_of, parse

_CORNERS: Final = ("xmin", "ymin", "xmax", "ymax")
_FROM_ONE_PX: Final = np.array([1.5, 1.5, 0.5, 0.5])
"""To be subtracted from indices that count from 1, to have edges where 0 is the centre of the first pixel."""
_FROM_ZERO_PX: Final = np.array([0.5, 0.5, -0.5, -0.5])
_EDGES_PX: Final = np.array([0.5, 0.5, 0.5, 0.5])
_PICTURE_FOLDERS: Final = ("JPEGImages", "images", ".")


def read_voc(folder: Path) -> SourceSet:
    """Read a folder with `Annotations`; `ImageSets/Main/{train,val,test}.txt` say the splits where they are."""
    splits = _read_splits(folder / "ImageSets" / "Main")
    files = list(files_below(folder / "Annotations", {".xml"}))
    read, problems = read_each(files, partial(_read_picture, folder, splits))
    pictures, notes = _from_first_pixel(read, folder)
    check_layout(pictures, folder, CORNERS)
    labels = sorted({label for picture in pictures for label in picture.labels})
    return SourceSet(tuple(labels), pictures, [*problems, *notes])


def _from_first_pixel(pictures: Sequence[SourcePicture], folder: Path) -> tuple[Sequence[SourcePicture], list[Problem]]:
    """Return the pictures of a set that may count from 0, boxes mended, and a note where 0 occurs.

    No index from 1 is 0; but where 1 is a box's first pixel more often than 0 is, the zeros are slips. A set that
    counts from 0 has edges where a box ends at its picture's whole width or height, or between pixels; else it has
    indices, both inside the box.
    """
    corners = np.concatenate([np.zeros((0, 4)), *(picture.xyxy_px + _FROM_ONE_PX for picture in pictures)])
    zeros, ones = (int((corners[:, :2] == first).any(axis=1).sum()) for first in (0.0, 1.0))
    if not zeros:
        return pictures, []
    are_edges = (corners % 1.0 != 0.0).any() or any(
        (picture.xyxy_px[:, 2:] + _FROM_ONE_PX[2:] == picture.size_px).any() for picture in pictures
    )
    counted = "1, as most are" if zeros < ones else "0, edges of pixels" if are_edges else "0"
    found = f"boxes that begin at 0 ({zeros}) and at 1 ({ones}): read as counted from {counted}"
    note = Problem(folder, found, "pixels counted from 0", skipped_picture=False)
    if zeros < ones:
        return pictures, [note]
    shift_px = _FROM_ONE_PX - (_EDGES_PX if are_edges else _FROM_ZERO_PX)
    return [replace(picture, xyxy_px=picture.xyxy_px + shift_px) for picture in pictures], [note]


def _read_splits(folder: Path) -> dict[str, Split]:
    """Return the split of each stem."""
    splits: dict[str, Split] = {}
    for split in SPLITS:
        if (folder / f"{split}.txt").is_file():
            lines = read_text(folder / f"{split}.txt", "a list of pictures").splitlines()
            splits |= {line.split()[0]: split for line in lines if line.strip()}
    return splits


def _read_picture(folder: Path, splits: dict[str, Split], file: Path) -> SourcePicture:
    root = parse(file)
    name = root.findtext("filename", "").strip()
    path, reading = _picture_file(folder, name, file.stem)
    objects = objects_of(root, file)
    canvas = canvas_of(path, _stated_px(root, file), marked=bool(objects))
    boxes = [[_number(box, corner, file) for corner in _CORNERS] for one in objects for box in one.findall("bndbox")]
    return SourcePicture(
        path,
        canvas.size_px,
        tuple(_label(one, file) for one in objects),
        np.array(boxes, np.float64).reshape(-1, 4) - _FROM_ONE_PX,
        np.array([_is_ignored(one, file) for one in objects], np.bool_),
        splits.get(file.stem),
        orientation=canvas.orientation,
        notes=(*elsewhere(path, name, reading), *canvas.notes),
    )


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
    (size,) = root.findall("size")
    return _number(size, "width", file), _number(size, "height", file)


def _label(one: ET.Element, file: Path) -> str:
    label = one.findtext("name", "").strip()
    if not label:
        raise BadPicture(file, "an object without name", UNREADABLE)
    return label


def _is_ignored(one: ET.Element, file: Path) -> bool:
    try:
        return any(is_true(one.findtext(mark)) for mark in ("difficult", "ignore"))
    except ValueError as error:
        raise BadPicture(file, f"an object with <difficult> or <ignore> {error}", UNREADABLE) from error


def _number(parent: ET.Element, name: str, file: Path) -> float:
    texts = [child.text or "" for child in parent.findall(name)]
    try:
        (number,) = map(float, texts)
    except ValueError as error:
        raise BadPicture(file, f"'{' and '.join(texts)}' for {name}", UNREADABLE) from error
    if not np.isfinite(number):
        raise BadPicture(file, f"'{texts[0]}' for {name}", UNREADABLE)
    return number
