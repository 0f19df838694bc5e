"""A data set of labelled pictures on disk, in YOLO's or COCO's layout."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from standoff import __version__
from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.files.yaml_text import dump_yaml, write_yaml
from standoff.labels.ground_points import POINTS_FOLDER, points_line
from standoff.labels.marking import would_be_marked
from standoff.labels.regions import OWN_REGIONS
from standoff.labels.types import SPLITS, Split
from standoff.labels.views import VIEWS_FILE, GroundView, view_line
from standoff_sim.clip.coco import Annotations
from standoff_sim.clip.truth import Row

SET_FILES: Final = (
    *("images", "labels", POINTS_FOLDER, "annotations"),
    *(OWN_REGIONS, VIEWS_FILE, "data.yaml", "dataset.json"),
)
"""What a data set holds at its top."""

Box = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class LabelledImage:
    """One picture of a data set.

    Attributes:
        name: Of the file, without folder.
        jpeg: Its content.
        size_px: (width, height).
        entities: What is marked in it: class and box as in `standoff.clips.TRUTH_SCHEMA`; COCO's layout also needs
            what is visible.
        ignored_px: Left, top, right, bottom of places of which nothing is known.
        about: Further fields of the picture in COCO's layout.
        view: Where it was taken from; None: nobody knows.
    """

    name: str
    jpeg: bytes
    size_px: tuple[int, int]
    entities: Sequence[Row]
    ignored_px: Sequence[Box] = ()
    about: Mapping[str, Any] = field(default_factory=dict)
    view: View | None = None


def draw_split(key: Sequence[int], index: int, count: int, held_out: float) -> Split:
    """Return the split of one of `count` things: the first of a fixed shuffled order are held out.

    Args:
        key: Seeds of the order.
        index: Of the thing.
        count: How many there are.
        held_out: Share for each of val and test; of few things it may round to none.

    >>> sorted(draw_split([7], index, 10, 0.2) for index in range(10))
    ['test', 'test', 'train', 'train', 'train', 'train', 'train', 'train', 'val', 'val']
    """
    place = int(np.flatnonzero(np.random.default_rng(key).permutation(count) == index)[0])
    held = round(held_out * count)
    return "val" if place < held else "test" if place < 2 * held else "train"


class PictureSet:
    """Writes pictures with their labels, one by one.

    Args:
        folder: Empty.
        layout: Of the annotations.
    """

    def __init__(self, folder: Path, layout: Literal["yolo", "coco"]) -> None:
        self._folder, self._layout = folder, layout
        self._annotations = {split: Annotations() for split in SPLITS}
        self._ignored: dict[str, list[list[float]]] = {}
        self._views: list[str] = []
        for split in SPLITS:
            (folder / "images" / split).mkdir(parents=True)
            if layout == "yolo":
                (folder / "labels" / split).mkdir(parents=True)
                (folder / POINTS_FOLDER / split).mkdir(parents=True)

    def add(self, split: Split, picture: LabelledImage) -> None:
        """Write a picture and, in YOLO's layout, its labels."""
        (self._folder / "images" / split / picture.name).write_bytes(picture.jpeg)
        if self._layout == "yolo":
            name = Path(picture.name).with_suffix(".txt")
            lines = [yolo_line(row, picture.size_px) for row in picture.entities]
            (self._folder / "labels" / split / name).write_text("".join(lines))
            points = [points_line(foot_of(row), picture.size_px) for row in picture.entities]
            (self._folder / POINTS_FOLDER / split / name).write_text("".join(points))
        else:
            entry = {"file_name": f"images/{split}/{picture.name}", **picture.about}
            self._annotations[split].add(entry, picture.entities, picture.size_px, None)
        if picture.ignored_px:
            self._ignored[Path(picture.name).stem] = [[round(edge, 2) for edge in box] for box in picture.ignored_px]
        if picture.view is not None:
            heights_m = [row["z_m"] for row in picture.entities if "z_m" in row]
            ground_m = float(np.mean(heights_m)) if heights_m else 0.0
            self._views.append(view_line(picture.name, GroundView(picture.view, ground_m)))

    def finish(self, description: str, settings: Mapping[str, Any]) -> None:
        """Write what belongs to all pictures.

        Args:
            description: For COCO's layout.
            settings: What the set was made with, for `dataset.json`; paths become their text.
        """
        if self._layout == "coco":
            (self._folder / "annotations").mkdir()
            for split in SPLITS:
                text = json.dumps(self._annotations[split].to_dict(f"{description}, {split}"))
                (self._folder / "annotations" / f"{split}.json").write_text(text)
        if self._ignored:
            text = dump_yaml(dict(sorted(self._ignored.items())), flow=None)
            (self._folder / OWN_REGIONS).write_text(text, encoding="utf-8")
        if self._views:
            (self._folder / VIEWS_FILE).write_text("".join(self._views))
        names = {site_class.id: site_class.name for site_class in CLASSES}
        content: dict[str, Any] = {**{split: f"images/{split}" for split in SPLITS}, "names": names}
        write_yaml(self._folder / "data.yaml", content)
        (self._folder / "dataset.json").write_text(
            json.dumps({"standoff": __version__, **settings}, default=str, indent=2)
        )


def yolo_line(row: Row, size_px: tuple[int, int]) -> str:
    r"""Return one line of a YOLO label file: class, centre and size as shares of the picture.

    >>> yolo_line({"class_id": 2, "x1_px": -0.5, "y1_px": -0.5, "x2_px": 9.5, "y2_px": 4.5}, (20, 10))
    '2 0.250000 0.250000 0.500000 0.500000\n'
    """
    left, top, right, bottom = (row[f"{name}_px"] + 0.5 for name in ("x1", "y1", "x2", "y2"))
    width_px, height_px = size_px
    shares = (
        (left + right) / 2 / width_px,
        (top + bottom) / 2 / height_px,
        (right - left) / width_px,
        (bottom - top) / height_px,
    )
    return f"{row['class_id']} " + " ".join(f"{share:.6f}" for share in shares) + "\n"


def foot_of(row: Row) -> FloatArray:
    """Return (2,) where the middle of an entity's footprint appears; NaN where the row does not say."""
    return np.array([row.get("foot_x_px", np.nan), row.get("foot_y_px", np.nan)], dtype=np.float64)


def is_marked(row: Row) -> bool:
    """Return whether somebody who marks pictures would mark an entity; the rest is too small or too hidden."""
    box_px = np.array([[row[f"{name}_px"] for name in ("x1", "y1", "x2", "y2")]], dtype=np.float64)
    seen = (np.array([row[name]], dtype=np.float64) for name in ("visible_px", "visible_share"))
    return bool(would_be_marked(box_px, *seen)[0])
