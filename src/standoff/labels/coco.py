"""COCO annotation files: pictures, categories and boxes in one JSON file.

A box is left, top, width, height in pixels, counted from the left and upper *edge* of the first pixel; ours are 0 at
its centre. Crowds (`iscrowd`) become ignored regions. The keypoint `ground_point` becomes the ground point.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeGuard

import numpy as np

from standoff.core.boxes import unknown_points
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.files.number_lists import number_array
from standoff.labels.coco_boxes import read_bboxes
from standoff.labels.documents import read_json
from standoff.labels.ground_points import KEYPOINT
from standoff.labels.layout_doubts import CORNER_AND_EXTENT, check_counting, check_layout
from standoff.labels.pictures import canvas_of
from standoff.labels.places import elsewhere, find_named
from standoff.labels.source import UNPLACEABLE, BadPicture, SourcePicture, SourceSet, read_each, split_named
from standoff.labels.strays import mark_within
from standoff.labels.truth_values import is_true
from standoff.labels.types import Problem, Split

_Entry = Mapping[str, Any]
_Id = int | str
_LONGEST_ID: Final = 30
_LARGEST: Final = 1e18
"""Of the numbers that are looked at; JSON has no largest."""
_LOST_SHARE: Final = 0.1
"""Of the pictures without a box: where annotations of so many others are lost, they may be theirs."""


@dataclass(frozen=True, slots=True, eq=False)
class _CocoFile:
    """One annotation file, by id.

    Attributes:
        path: Of the file.
        folders: Where its pictures may be.
        labels: By category id, in the order of the ids.
        point_at: By category id, of those that have it: where the ground point is among the keypoints.
        images: As listed.
        boxes: Annotations by image id.
        lost: Annotations of images that are not listed.
        shared: Ids that more than one image has: whose boxes are whose?
        doubtful: Whether pictures without a box may be those whose annotations are lost.
        split: Of all its pictures; None: its name does not say.
    """

    path: Path
    folders: tuple[Path, ...]
    labels: Mapping[_Id, str]
    point_at: Mapping[_Id, int]
    images: Sequence[_Entry]
    boxes: Mapping[_Id, Sequence[_Entry]]
    lost: Sequence[_Entry]
    shared: frozenset[_Id]
    doubtful: bool
    split: Split | None


def read_coco(paths: Sequence[Path], pictures: Path | None) -> SourceSet:
    """Read annotation files, one for each split if there are several.

    Args:
        paths: The files; `train.json` or `instances_val2017.json` say the split of their pictures.
        pictures: Folder of the pictures; None: beside a file or in the folder above, or there in `images` or in a
            folder named after the file.

    Raises:
        DataError: A file is not COCO.
    """
    files = [_open(path, read_json(path), pictures) for path in paths]
    listed = [(file, image) for file in files for image in file.images]
    found, problems = read_each(listed, _read_picture)
    for file in files:
        check_counting(
            {_id(box, "category_id") for boxes in file.boxes.values() for box in boxes}, file.labels, file.path
        )
    check_layout(found, paths[0], CORNER_AND_EXTENT)
    lost = [_lost(file.path, box) for file in files for box in file.lost]
    return SourceSet(
        tuple(dict.fromkeys(label for file in files for label in file.labels.values())), found, problems + lost
    )


def _open(path: Path, content: dict[str, Any], pictures: Path | None) -> _CocoFile:
    _refuse_strays(content, path)
    images, annotations, categories = (_entries(content, key, path) for key in ("images", "annotations", "categories"))
    named = sorted((entry for entry in categories if "name" in entry), key=lambda entry: _sortable(entry.get("id")))
    boxes: dict[_Id, list[_Entry]] = {_id(entry, "id"): [] for entry in images}
    lost: list[_Entry] = []
    for entry in annotations:
        boxes.get(_id(entry, "image_id"), lost).append(entry)
    shared = frozenset(number for number, count in Counter(_id(entry, "id") for entry in images).items() if count > 1)
    labels = {_id(entry, "id"): str(entry["name"]) for entry in named}
    _check_categories(named, path)
    keypoints = {_id(entry, "id"): entry.get("keypoints") for entry in named}
    point_at = {
        number: names.index(KEYPOINT)
        for number, names in keypoints.items()
        if isinstance(names, list) and KEYPOINT in names
    }
    folders, split = _folders(path, pictures), split_named(path.stem) or split_named(path.parent.name)
    return _CocoFile(path, folders, labels, point_at, images, boxes, lost, shared, _doubtful(boxes, lost), split)


def _check_categories(named: Sequence[_Entry], path: Path) -> None:
    """Refuse two labels under one id: whose boxes are they?"""
    labels: dict[_Id, str] = {}
    for entry in named:
        if (known := labels.setdefault(_id(entry, "id"), str(entry["name"]))) != str(entry["name"]):
            found = f"{entry.get('id')} of {known} and {entry['name']}"
            raise DataError(expected=f"an id of its own for each category in {path}", found=found, fix="correct it")


def _doubtful(boxes: Mapping[_Id, Sequence[_Entry]], lost: Sequence[_Entry]) -> bool:
    unmarked = sum(not entries for entries in boxes.values())
    return len({_id(entry, "image_id") for entry in lost}) > _LOST_SHARE * unmarked


def _id(entry: _Entry, key: str) -> _Id:
    """Return an id, a number written as text or as 1.0 as the number; whatever a damaged file has instead, as text."""
    value = entry.get(key)
    if isinstance(value, str) and value.isascii() and value.isdecimal() and len(value) < _LONGEST_ID:
        return int(value)
    if isinstance(value, float) and value.is_integer() and abs(value) < _LARGEST:
        return int(value)
    return value if isinstance(value, (int, str)) and not isinstance(value, bool) else repr(value)


def _lost(path: Path, entry: _Entry) -> Problem:
    found = f"annotation {entry.get('id')} of image {entry.get('image_id')}, which is not listed"
    return Problem(path, found, "annotation without picture", skipped_picture=False)


def _sortable(number: object) -> tuple[str, float, str]:
    """Order numbers as numbers, and whatever else somebody takes for ids as text."""
    return (type(number).__name__, float(number) if _is_number(number) else 0.0, str(number))


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < _LARGEST


def _folders(path: Path, pictures: Path | None) -> tuple[Path, ...]:
    if pictures is not None:
        return (pictures,)
    # COCO's own instances_train2017.json goes with train2017/, CVAT's instances_default.json with images/default/.
    name = path.stem.removeprefix("instances_")
    inners = ("", "images", path.stem, name, f"images/{name}")
    return tuple(folder / inner for folder in (path.parent, path.parent.parent) for inner in inners)


def _entries(content: dict[str, Any], key: str, path: Path) -> list[_Entry]:
    entries = content.get(key)
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise DataError(
            expected=f"a list `{key}` of COCO entries in {path}",
            found="none" if entries is None else type(entries).__name__,
            fix="give a COCO annotation file of the kind `instances`",
        )
    return entries


def _read_picture(listed: tuple[_CocoFile, _Entry]) -> SourcePicture:
    file, image = listed
    name = image.get("file_name")
    if not isinstance(name, str) or not name:
        raise BadPicture(file.path, f"image {image.get('id')} without file_name", "picture without name")
    path, reading = find_named(name, file.folders)
    boxes = file.boxes[_id(image, "id")]
    canvas = canvas_of(path, _stated_px(image, path), marked=bool(boxes))
    if _id(image, "id") in file.shared:
        raise BadPicture(path, f"its id {image.get('id')} is another picture's as well", "contradictory labels")
    mark = mark_within({key: value for key, value in image.items() if key not in ("width", "height")})
    if mark is not None:
        found = f"`{mark}` in the image's own entry, where no annotation should be"
        raise BadPicture(path, found, UNPLACEABLE)
    if not boxes and file.doubtful:
        found = f"no box, where {file.path.name} has {len(file.lost)} of pictures that it does not list"
        raise BadPicture(path, found, UNPLACEABLE)
    categories = [_id(box, "category_id") for box in boxes]
    unknown = [category for category in categories if category not in file.labels]
    if unknown:
        raise BadPicture(path, f"category {unknown[0]}, which {file.path.name} does not list", "unknown class id")
    corners = read_bboxes(boxes, path)
    return SourcePicture(
        path,
        canvas.size_px,
        tuple(file.labels[category] for category in categories),
        corners - 0.5,
        np.array([_is_ignored(box, path) for box in boxes], np.bool_),
        file.split,
        str(image.get("scene", "")),
        _points(boxes, categories, file.point_at, path),
        canvas.orientation,
        (*elsewhere(path, name, reading), *canvas.notes),
    )


def _is_ignored(box: _Entry, path: Path) -> bool:
    try:
        return any(is_true(box.get(mark)) for mark in ("iscrowd", "ignore"))
    except ValueError as error:
        raise BadPicture(path, f"an annotation with `iscrowd` or `ignore` {error}", "unreadable labels") from error


def _refuse_strays(content: Mapping[str, Any], path: Path) -> None:
    """Refuse annotations in another place than COCO has them: the pictures that they mark would have none."""
    for key, value in content.items():
        if key in ("info", "licenses", "images", "annotations", "categories") or not isinstance(value, list):
            continue
        if (mark := mark_within(value)) is not None or any("image_id" in one for one in value if isinstance(one, dict)):
            raise DataError(
                expected=f"all annotations of {path} in its list `annotations`",
                found=f"`{mark or 'image_id'}` in `{key}`",
                fix="export it again as a COCO annotation file of the kind `instances`",
            )


def _stated_px(image: _Entry, path: Path) -> tuple[float, float] | None:
    """Return the size that is stated; None where it is not, or 0."""
    width, height = image.get("width") or None, image.get("height") or None
    if width is None or height is None:
        return None
    if not all(_is_number(side) for side in (width, height)):
        raise BadPicture(path, "a size that is not two numbers", "unreadable labels")
    return float(width), float(height)


def _points(boxes: Sequence[_Entry], categories: Sequence[_Id], point_at: Mapping[_Id, int], path: Path) -> FloatArray:
    """Return (N, 2) ground points; NaN where none is marked."""
    points = unknown_points(len(boxes))
    for row, (box, category) in enumerate(zip(boxes, categories, strict=True)):
        if category not in point_at or "keypoints" not in box:
            continue
        start = 3 * point_at[category]
        try:
            x, y, visibility = number_array(box["keypoints"], 1, texts=True)[start : start + 3]
        except ValueError as error:
            raise BadPicture(path, "an annotation whose keypoints are not numbers", "unreadable labels") from error
        if visibility and np.isfinite([x, y]).all():
            points[row] = x - 0.5, y - 0.5
    return points
