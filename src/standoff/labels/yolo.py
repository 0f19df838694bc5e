"""YOLO folders: pictures, and beside each a text file of lines `class centre-x centre-y width height`.

The four numbers are shares of the picture, counted from the left and upper *edge* of the first pixel; ours are 0 at
its centre, half a pixel further. Ground points may lie beside them (see `standoff.labels.ground_points`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from standoff.core.classes import names_by_line, names_in_list
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.files.plain_text import read_text
from standoff.labels.documents import read_yaml
from standoff.labels.ground_points import POINTS_FOLDER, in_pixels, read_points
from standoff.labels.pictures import find_pictures, first_file, read_size_px
from standoff.labels.source import BadPicture, SourcePicture, SourceSet, read_each, split_named
from standoff.labels.types import SPLITS, Split

_NAME_FILES: Final = ("classes.txt", "obj.names", "labels/classes.txt")
_BOX, _BOX_AND_POINT = 5, 8
"""Values of a line: class and box; then a keypoint and its visibility."""
_Listed = tuple[Path, Split | None]


def read_yolo_yaml(path: Path, names: Sequence[str] | None) -> SourceSet:
    """Read a data set by its data.yaml: `names`, and a folder or list of pictures for each split.

    Args:
        path: The file.
        names: Labels by class id; None: those of the file.

    Raises:
        DataError: The file, a folder or a list of it cannot be used.
    """
    content = read_yaml(path)
    labels = tuple(names) if names is not None else labels_of(content.get("names"), path)
    root = path.parent / str(content.get("path", "."))
    listed: list[_Listed] = []
    for key in ("train", "val", "valid", "test"):
        places = content.get(key) or ()
        for place in places if isinstance(places, (list, tuple)) else (places,):
            listed += [(picture, split_named(key)) for picture in _pictures_at(root, path.parent, str(place), path)]
    if not listed:
        raise DataError(
            expected=f"{', '.join(SPLITS)} in {path}", found="no pictures", fix="name folders or lists of pictures"
        )
    return _read_listed(listed, labels)


def read_yolo_folder(folder: Path, names: Sequence[str] | None) -> SourceSet:
    """Read a folder without data.yaml: label files beside the pictures, or `images` and `labels` side by side.

    Args:
        folder: Searched with everything below it; folders named after a split mean that split.
        names: Labels by class id; None: from classes.txt or obj.names.

    Raises:
        DataError: No names.
    """
    listed = [(picture, _split_of(picture.relative_to(folder))) for picture in find_pictures(folder)]
    return _read_listed(listed, tuple(names) if names is not None else _read_names(folder))


def labels_of(names: object, path: Path) -> tuple[str, ...]:
    """Return labels by class id, from a list or from a mapping of id to label.

    Args:
        names: As YAML gives it.
        path: Of the YAML, for messages.

    Raises:
        DataError: Something else, or ids with gaps.

    >>> labels_of({1: "car", 0: "person"}, Path("data.yaml"))
    ('person', 'car')
    """
    found = repr(names)
    try:
        if isinstance(names, list) and names:
            return names_in_list(names)
        if isinstance(names, Mapping) and names:
            by_id = {int(number): name for number, name in names.items()}
            if sorted(by_id) == list(range(len(by_id))):
                return names_in_list(by_id[number] for number in range(len(by_id)))
    except (TypeError, ValueError) as error:
        found = str(error)
    raise DataError(
        expected=f"`names` in {path}: a list of labels, or a mapping from class ids 0, 1, 2 ... to labels",
        found=found,
        fix="write down the labels in the order of their ids",
    )


def _read_names(folder: Path) -> tuple[str, ...]:
    for name in _NAME_FILES:
        if (folder / name).is_file():
            text = read_text(folder / name, "a label a line")
            try:
                labels = names_by_line(text)
            except ValueError as error:
                expected = f"a label a line in {folder / name}"
                raise DataError(expected=expected, found=str(error), fix="correct the file") from error
            if labels:
                return labels
    raise DataError(
        expected=f"the labels of the YOLO folder {folder} in data.yaml, classes.txt or obj.names",
        found="none of them",
        fix="write classes.txt, one label a line in the order of their ids, or give `names` in a mixture file",
    )


def _pictures_at(root: Path, beside: Path, place: str, path: Path) -> list[Path]:
    """Return the pictures of a folder, or those that a text file lists."""
    # Roboflow writes ../train/images for the folder train/images beside the file
    for candidate in (root / place, root / place.removeprefix("../")):
        if candidate.is_dir():
            return find_pictures(candidate)
        if candidate.is_file():
            lines = read_text(candidate, "a list of pictures").splitlines()
            return [_listed_picture(line.strip(), candidate.parent, (root, beside)) for line in lines if line.strip()]
    raise DataError(
        expected=f"the folder or list of pictures '{place}' that {path} names",
        found=f"nothing at {root / place}",
        fix="correct the path",
    )


def _listed_picture(line: str, parent: Path, roots: tuple[Path, ...]) -> Path:
    return first_file([folder / line for folder in (parent, *roots)])


def _split_of(relative: Path) -> Split | None:
    return next((split for part in relative.parts[:-1] if (split := split_named(part))), None)


def _read_listed(listed: Sequence[_Listed], labels: tuple[str, ...]) -> SourceSet:
    pictures, problems = read_each(listed, partial(_read_picture, labels))
    return SourceSet(labels, pictures, problems)


def _read_picture(labels: tuple[str, ...], listed: _Listed) -> SourcePicture:
    path, split = listed
    size_px = read_size_px(path)
    numbers, xyxy_px, foot_px = read_boxes(path, size_px)
    unknown = [number for number in numbers if number not in range(len(labels))]
    if unknown:
        raise BadPicture(path, f"class id {unknown[0]:g}, of {len(labels)} classes", "unknown class id")
    names = tuple(labels[int(number)] for number in numbers)
    return SourcePicture(path, size_px, names, xyxy_px, np.zeros(len(names), np.bool_), split, foot_px=foot_px)


def read_boxes(picture: Path, size_px: tuple[int, int]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Read the label file of a picture, and the ground points beside it.

    Args:
        picture: Its labels lie beside it, or in `labels` where it is in `images`.
        size_px: (width, height) of the picture.

    Returns:
        (N,) class ids as written, (N, 4) boxes and (N, 2) ground points, NaN where none is marked; 0 is the centre of
        the first pixel.

    Raises:
        BadPicture: There is no label file, or one of the files holds something else.
    """
    rows = _read_rows(_label_file(picture))
    points = _sibling(picture, POINTS_FOLDER)
    if points is None or not points.is_file():
        foot_px = in_pixels(rows[:, 5:7], size_px)
    else:
        try:
            foot_px = read_points(points, len(rows), size_px)
        except ValueError as error:
            raise BadPicture(points, str(error), "unreadable labels") from error
    return rows[:, 0], _to_corners(rows[:, 1:5], size_px), foot_px


def _label_file(picture: Path) -> Path:
    """Return the label file: in `labels` where the picture is in `images`, else beside it."""
    apart = _sibling(picture, "labels")
    file = first_file([*([apart] if apart else []), picture.with_suffix(".txt")])
    if not file.is_file():
        raise BadPicture(picture, f"no label file at {file}", "label file missing")
    return file


def _sibling(picture: Path, folder: str) -> Path | None:
    """Return the text file of a picture in another folder beside `images`; None where it is in no such folder."""
    parts = list(picture.parts)
    if "images" not in parts[:-1]:
        return None
    last = len(parts) - 2 - parts[-2::-1].index("images")
    return Path(*parts[:last], folder, *parts[last + 1 :]).with_suffix(".txt")


def _read_rows(path: Path) -> FloatArray:
    """Return (N, 7) numbers of a label file, the last two NaN where no point is marked; an empty file has none."""
    try:
        lines = [line.split() for line in read_text(path, "labels").splitlines()]
    except DataError as error:
        raise BadPicture(path, f"no text ({error.found})", "unreadable labels") from error
    rows = [row for row in lines if row]
    wrong = [len(row) for row in rows if len(row) not in (_BOX, _BOX_AND_POINT)]
    if wrong:
        raise BadPicture(path, f"a line of {wrong[0]} values instead of 5", "unreadable labels")
    padded = [row if len(row) == _BOX_AND_POINT else [*row, "0", "0", "0"] for row in rows]
    try:
        numbers = np.array(padded, dtype=np.float64).reshape(-1, _BOX_AND_POINT)
    except ValueError as error:
        raise BadPicture(path, f"not a number ({error})", "unreadable labels") from error
    if not np.isfinite(numbers).all():
        raise BadPicture(path, "a number that is not finite", "unreadable labels")
    numbers[numbers[:, 7] == 0.0, 5:7] = np.nan
    return numbers[:, :7]


def _to_corners(shares: FloatArray, size_px: tuple[int, int]) -> FloatArray:
    centre_px, extent_px = shares[:, :2] * size_px, shares[:, 2:] * size_px
    return np.hstack([centre_px - extent_px / 2, centre_px + extent_px / 2]) - 0.5
