"""Tell which layout a data set has, and read it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from standoff.core.errors import DataError
from standoff.files.below import files_below
from standoff.labels.coco import read_coco
from standoff.labels.pictures import canvas_of, find_pictures
from standoff.labels.source import SourcePicture, SourceSet, read_each, split_named
from standoff.labels.voc import read_voc
from standoff.labels.yolo import read_yolo_folder, read_yolo_yaml

YAML_SUFFIXES: Final = (".yaml", ".yml")


def read_set(path: Path, names: Sequence[str] | None = None, pictures: Path | None = None) -> SourceSet:
    """Read one data set, whatever its layout.

    Args:
        path: COCO file, data.yaml, or folder of a COCO, Pascal VOC or YOLO data set.
        names: Labels by class id, of a YOLO data set that does not tell them.
        pictures: Folder of the pictures of a COCO file, when they are not beside it.

    Raises:
        DataError: It is none of these, or its files do not hang together.
    """
    if path.is_file() and path.suffix.lower() == ".json":
        return read_coco([path], pictures)
    if path.is_file() and path.suffix.lower() in YAML_SUFFIXES:
        return read_yolo_yaml(path, names)
    if not path.is_dir():
        raise DataError(
            expected=f"a data set at {path}: a folder, a COCO .json, a data.yaml or a mixture .yaml",
            found="another kind of file" if path.exists() else "nothing",
            fix="check the path",
        )
    if annotations := _coco_files(path / "annotations") or _coco_of_splits(path):
        return read_coco(annotations, pictures)
    if next(files_below(path / "Annotations", {".xml"}), None) is not None:
        return read_voc(path)
    if (path / "data.yaml").is_file():
        return read_yolo_yaml(path / "data.yaml", names)
    if next(files_below(path, {".txt"}), None) is not None:
        return read_yolo_folder(path, names)
    raise DataError(
        expected=f"a data set in {path}",
        found="no data.yaml, no annotations/*.json, no Annotations/*.xml and no label files (.txt)",
        fix="give the folder that holds one of them; pictures without any object need a mixture with `negatives: true`",
    )


def read_negatives(folder: Path) -> SourceSet:
    """Read a folder of pictures in which nothing is to be found.

    Raises:
        DataError: There is no picture.
    """
    found = find_pictures(folder) if folder.is_dir() else []
    if not found:
        raise DataError(expected=f"a folder of pictures at {folder}", found="no picture", fix="check the path")
    pictures, problems = read_each(found, _unmarked)
    return SourceSet((), pictures, problems)


def _unmarked(path: Path) -> SourcePicture:
    canvas = canvas_of(path, None, marked=False)
    return SourcePicture(
        path,
        canvas.size_px,
        (),
        np.zeros((0, 4)),
        np.zeros(0, np.bool_),
        orientation=canvas.orientation,
        notes=canvas.notes,
    )


def _coco_files(folder: Path) -> list[Path]:
    """Return the annotation files of the splits; without any, the only one there is."""
    files = sorted(folder.glob("*.json")) if folder.is_dir() else []
    splits = [file for file in files if split_named(file.stem)]
    return splits or (files if len(files) == 1 else [])


def _coco_of_splits(folder: Path) -> list[Path]:
    """Return the annotation files that lie among the pictures of each split, as Roboflow exports them."""
    found = [
        path for split in sorted(folder.iterdir()) if split_named(split.name) for path in split.glob("*.coco.json")
    ]
    return sorted(found)
