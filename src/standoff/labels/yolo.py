"""YOLO folders: pictures, and beside each a text file of lines `class centre-x centre-y width height`.

The four numbers are shares of the picture, counted from the left and upper *edge* of the first pixel; ours are 0 at
its centre, half a pixel further. Other lines are read as well (see `standoff.labels.yolo_rows`), and ground points may
lie beside them (see `standoff.labels.ground_points`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
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
from standoff.labels.layout_doubts import CENTRE_AND_EXTENT, check_counting, check_layout
from standoff.labels.pictures import Canvas, canvas_of, find_pictures
from standoff.labels.places import elsewhere, find_named, first_there
from standoff.labels.source import UNPLACEABLE, BadPicture, SourcePicture, SourceSet, read_each, split_named
from standoff.labels.types import SPLITS, Problem, Split
from standoff.labels.yolo_rows import KeypointShape, Unplaceable, read_rows
from standoff.labels.yolo_yaml import SPLIT_KEYS, check_count, check_keys, keypoints_of

_NAME_FILES: Final = ("classes.txt", "obj.names", "labels/classes.txt")


@dataclass(frozen=True, slots=True)
class _Listed:
    """A picture that a set names.

    Attributes:
        path: Of the picture.
        split: Where the set puts it.
        notes: Where its path is of another computer.
    """

    path: Path
    split: Split | None = None
    notes: tuple[Problem, ...] = ()


@dataclass(frozen=True, slots=True)
class _Meaning:
    """What the numbers of a set's label files mean.

    Attributes:
        labels: By class id.
        keypoints: How many a box has; None: not said.
        used: Class ids that were met.
    """

    labels: tuple[str, ...]
    keypoints: KeypointShape | None = None
    used: set[float] = field(default_factory=set)


def read_yolo_yaml(path: Path, names: Sequence[str] | None) -> SourceSet:
    """Read a data set by its data.yaml: `names`, and a folder or list of pictures for each split.

    Args:
        path: The file.
        names: Labels by class id; None: those of the file.

    Raises:
        DataError: The file, a folder or a list of it cannot be used, or it contradicts itself.
    """
    content = read_yaml(path)
    labels = tuple(names) if names is not None else labels_of(content.get("names"), path)
    check_keys(content, path)
    check_count(content.get("nc"), labels, path)
    meaning = _Meaning(labels, keypoints_of(content.get("kpt_shape"), path))
    root, notes = _root(str(content.get("path") or "."), path)
    listed: list[_Listed] = []
    for key in SPLIT_KEYS:
        places = content.get(key) or ()
        for place in places if isinstance(places, (list, tuple)) else (places,):
            found = _pictures_at((root, path.parent), str(place), path)
            if found is not None:
                listed += [replace(one, split=split_named(key)) for one in found[0]]
                notes += found[1]
            elif key == "test":  # exports name it whether there is one or not
                gone = f"'{place}' of {key} is not there"
                notes.append(Problem(path, gone, "split missing", skipped_picture=False))
            else:
                raise _not_there(root, str(place), path)
    if not listed:
        raise DataError(
            expected=f"{', '.join(SPLITS)} in {path}", found="no pictures", fix="name folders or lists of pictures"
        )
    return _read_listed(listed, meaning, path, notes)


def read_yolo_folder(folder: Path, names: Sequence[str] | None) -> SourceSet:
    """Read a folder without data.yaml: label files beside the pictures, or `images` and `labels` side by side.

    Args:
        folder: Searched with everything below it; folders named after a split mean that split.
        names: Labels by class id; None: from classes.txt or obj.names.

    Raises:
        DataError: No names.
    """
    listed = [_Listed(picture, _split_of(picture.relative_to(folder))) for picture in find_pictures(folder)]
    meaning = _Meaning(tuple(names) if names is not None else _read_names(folder))
    return _read_listed(listed, meaning, folder, [])


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


def _root(text: str, path: Path) -> tuple[Path, list[Problem]]:
    """Return the folder that paths in a data.yaml start from: its own where the one that it names is not there."""
    root, reading = find_named(text, (path.parent,), Path.is_dir)
    if root.is_dir():
        return root, list(elsewhere(path, text, reading))
    return path.parent, list(elsewhere(path, text, "the folder that it is in"))


def _pictures_at(roots: tuple[Path, ...], place: str, path: Path) -> tuple[list[_Listed], tuple[Problem, ...]] | None:
    """Return the pictures of a folder, or those that a text file lists, and a note on where; None without either."""
    # Roboflow writes ../train/images for the folder train/images beside the file
    own = first_there((roots[0] / text for text in (place, place.removeprefix("../"))), Path.exists)
    found, reading = (own, None) if own is not None else find_named(place, roots, Path.exists)
    if found.is_dir():
        return [_Listed(picture) for picture in find_pictures(found)], elsewhere(path, place, reading)
    if found.is_file():
        lines = read_text(found, "a list of pictures").splitlines()
        named = [_listed_picture(line.strip(), (found.parent, *roots)) for line in lines if line.strip()]
        return named, elsewhere(path, place, reading)
    return None


def _not_there(root: Path, place: str, path: Path) -> DataError:
    return DataError(
        expected=f"the folder or list of pictures '{place}' that {path} names",
        found=f"nothing at {root / place}",
        fix="correct the path",
    )


def _listed_picture(line: str, roots: tuple[Path, ...]) -> _Listed:
    picture, reading = find_named(line, roots)
    return _Listed(picture, notes=elsewhere(picture, line, reading))


def _split_of(relative: Path) -> Split | None:
    return next((split for part in relative.parts[:-1] if (split := split_named(part))), None)


def _read_listed(listed: Sequence[_Listed], meaning: _Meaning, source: Path, notes: Sequence[Problem]) -> SourceSet:
    pictures, problems = read_each(listed, partial(_read_picture, meaning))
    check_counting(meaning.used, range(len(meaning.labels)), source)
    check_layout(pictures, source, CENTRE_AND_EXTENT)
    return SourceSet(meaning.labels, pictures, [*notes, *problems])


def _read_picture(meaning: _Meaning, listed: _Listed) -> SourcePicture:
    path, labels = listed.path, meaning.labels
    numbers, xyxy_px, foot_px, canvas = read_boxes(path, meaning.keypoints)
    meaning.used.update(numbers.tolist())
    unknown = [number for number in numbers if number not in range(len(labels))]
    if unknown:
        raise BadPicture(path, f"class id {unknown[0]:g}, of {len(labels)} classes", "unknown class id")
    names = tuple(labels[int(number)] for number in numbers)
    return SourcePicture(
        path,
        canvas.size_px,
        names,
        xyxy_px,
        np.zeros(len(names), np.bool_),
        listed.split,
        foot_px=foot_px,
        orientation=canvas.orientation,
        notes=(*listed.notes, *canvas.notes),
    )


def read_boxes(
    picture: Path, keypoints: KeypointShape | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, Canvas]:
    """Read the label file of a picture, and the ground points beside it.

    Args:
        picture: Its labels lie beside it, or in `labels` where it is in `images`.
        keypoints: How many a box has; None: not said.

    Returns:
        (N,) class ids as written, (N, 4) boxes and (N, 2) ground points, NaN where none is marked; 0 is the centre of
        the first pixel; and how the picture lies for them.

    Raises:
        BadPicture: The picture cannot be read, there is no label file, or one of the files holds something else.
    """
    try:
        rows = _read_rows(_label_file(picture), keypoints)
    except BadPicture:
        canvas_of(picture, None, marked=False)  # whether there is a picture at all comes first
        raise
    canvas = canvas_of(picture, None, marked=len(rows) > 0)
    size_px = canvas.size_px
    points = _sibling(picture, POINTS_FOLDER)
    if points is None or not points.is_file():
        foot_px = in_pixels(rows[:, 5:7], size_px)
    else:
        try:
            foot_px = read_points(points, len(rows), size_px)
        except ValueError as error:
            raise BadPicture(points, str(error), "unreadable labels") from error
    return rows[:, 0], _to_corners(rows[:, 1:5], size_px), foot_px, canvas


def _label_file(picture: Path) -> Path:
    """Return the label file: in `labels` where the picture is in `images`, else beside it."""
    apart = _sibling(picture, "labels")
    places = [*([apart] if apart else []), picture.with_suffix(".txt")]
    files = [place for place in places if first_there([place])]
    if not files:
        raise BadPicture(picture, f"no label file at {places[0]}", "label file missing")
    if len(files) > 1 and files[0].read_bytes().split() != files[1].read_bytes().split():
        raise BadPicture(picture, f"{files[0]} and {files[1]} say different things", "contradictory labels")
    return files[0]


def _sibling(picture: Path, folder: str) -> Path | None:
    """Return the text file of a picture in another folder beside `images`; None where it is in no such folder."""
    parts = list(picture.parts)
    if "images" not in parts[:-1]:
        return None
    last = len(parts) - 2 - parts[-2::-1].index("images")
    return Path(*parts[:last], folder, *parts[last + 1 :]).with_suffix(".txt")


def _read_rows(path: Path, keypoints: KeypointShape | None) -> FloatArray:
    """Return (N, 7) numbers of a label file, the last two NaN where no point is marked; an empty file has none."""
    try:
        text = read_text(path, "labels")
    except DataError as error:
        raise BadPicture(path, f"no text ({error.found})", "unreadable labels") from error
    try:
        return read_rows(text, keypoints)
    except Unplaceable as error:
        raise BadPicture(path, str(error), UNPLACEABLE) from error
    except ValueError as error:
        raise BadPicture(path, str(error), "unreadable labels") from error


def _to_corners(shares: FloatArray, size_px: tuple[int, int]) -> FloatArray:
    centre_px, extent_px = shares[:, :2] * size_px, shares[:, 2:] * size_px
    return np.hstack([centre_px - extent_px / 2, centre_px + extent_px / 2]) - 0.5
