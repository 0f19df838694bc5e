"""COCO annotation files: pictures, categories and boxes in one JSON file.

A box is left, top, width, height in pixels, counted from the left and upper *edge* of the first pixel; ours are 0 at
its centre. Crowds (`iscrowd`) become ignored regions. The keypoint `ground_point` becomes the ground point.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from standoff.core.boxes import unknown_points
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.labels.documents import read_json
from standoff.labels.ground_points import KEYPOINT
from standoff.labels.pictures import first_file, read_size_px
from standoff.labels.source import BadPicture, SourcePicture, SourceSet, read_each, split_named
from standoff.labels.types import Problem, Split

_Entry = Mapping[str, Any]
_Id = int | str


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
    lost = [_lost(file.path, box) for file in files for box in file.lost]
    return SourceSet(
        tuple(dict.fromkeys(label for file in files for label in file.labels.values())), found, problems + lost
    )


def _open(path: Path, content: dict[str, Any], pictures: Path | None) -> _CocoFile:
    images, annotations, categories = (_entries(content, key, path) for key in ("images", "annotations", "categories"))
    named = sorted((entry for entry in categories if "name" in entry), key=lambda entry: _sortable(entry.get("id")))
    boxes: dict[_Id, list[_Entry]] = {_id(entry, "id"): [] for entry in images}
    lost: list[_Entry] = []
    for entry in annotations:
        boxes.get(_id(entry, "image_id"), lost).append(entry)
    shared = frozenset(number for number, count in Counter(_id(entry, "id") for entry in images).items() if count > 1)
    labels = {_id(entry, "id"): str(entry["name"]) for entry in named}
    keypoints = {_id(entry, "id"): entry.get("keypoints") for entry in named}
    point_at = {
        number: names.index(KEYPOINT)
        for number, names in keypoints.items()
        if isinstance(names, list) and KEYPOINT in names
    }
    return _CocoFile(
        path, _folders(path, pictures), labels, point_at, images, boxes, lost, shared, split_named(path.stem)
    )


def _id(entry: _Entry, key: str) -> _Id:
    """Return an id; whatever a damaged file has instead, as text."""
    value = entry.get(key)
    return value if isinstance(value, (int, str)) else repr(value)


def _lost(path: Path, entry: _Entry) -> Problem:
    found = f"annotation {entry.get('id')} of image {entry.get('image_id')}, which is not listed"
    return Problem(path, found, "annotation without picture", skipped_picture=False)


def _sortable(number: object) -> tuple[str, float, str]:
    """Order numbers as numbers, and whatever else somebody takes for ids as text."""
    return (type(number).__name__, float(number) if isinstance(number, (int, float)) else 0.0, str(number))


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
    path = first_file([folder / name for folder in file.folders])
    size_px = read_size_px(path)
    stated = image.get("width") or size_px[0], image.get("height") or size_px[1]
    if stated != size_px:
        raise BadPicture(path, f"{size_px} pixels where its labels say {stated}", "size differs from labels")
    if _id(image, "id") in file.shared:
        raise BadPicture(path, f"its id {image.get('id')} is another picture's as well", "contradictory labels")
    boxes = file.boxes[_id(image, "id")]
    categories = [_id(box, "category_id") for box in boxes]
    unknown = [category for category in categories if category not in file.labels]
    if unknown:
        raise BadPicture(path, f"category {unknown[0]}, which {file.path.name} does not list", "unknown class id")
    try:
        corners = np.array([box["bbox"] for box in boxes], dtype=np.float64).reshape(len(boxes), 4)
    except (KeyError, TypeError, ValueError) as error:
        raise BadPicture(path, "an annotation whose bbox is not four numbers", "unreadable labels") from error
    if not np.isfinite(corners).all():
        raise BadPicture(path, "a number that is not finite", "unreadable labels")
    corners[:, 2:] += corners[:, :2]
    return SourcePicture(
        path,
        size_px,
        tuple(file.labels[category] for category in categories),
        corners - 0.5,
        np.array([bool(box.get("iscrowd")) for box in boxes], np.bool_),
        file.split,
        str(image.get("scene", "")),
        _points(boxes, categories, file.point_at, path),
    )


def _points(boxes: Sequence[_Entry], categories: Sequence[_Id], point_at: Mapping[_Id, int], path: Path) -> FloatArray:
    """Return (N, 2) ground points; NaN where none is marked."""
    points = unknown_points(len(boxes))
    for row, (box, category) in enumerate(zip(boxes, categories, strict=True)):
        if category not in point_at or "keypoints" not in box:
            continue
        start = 3 * point_at[category]
        try:
            x, y, visibility = (float(number) for number in box["keypoints"][start : start + 3])
        except (TypeError, ValueError) as error:
            raise BadPicture(path, "an annotation whose keypoints are not numbers", "unreadable labels") from error
        if visibility and np.isfinite([x, y]).all():
            points[row] = x - 0.5, y - 0.5
    return points
