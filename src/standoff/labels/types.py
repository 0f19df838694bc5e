"""Labelled pictures: what training learns from and what detectors are scored on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, get_args

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.files.orientation import UPRIGHT, Orientation
from standoff.labels.ground_points import NO_POINTS, one_point_a_box

Split = Literal["train", "val", "test"]
SPLITS: tuple[Split, ...] = get_args(Split)
UNREADABLE = "unreadable picture"
"""`Problem.kind` of a picture of which the header or the pixels cannot be decoded."""


@dataclass(frozen=True, slots=True, eq=False)
class LabelledPicture:
    """One picture and what is marked in it.

    Attributes:
        path: Of the picture.
        size_px: (width, height) as its labels take it.
        xyxy_px: (N, 4) left, top, right, bottom edges, inside the picture; 0 is the centre of the first pixel, so that
            a box over the whole picture is -0.5 to width - 0.5.
        class_id: (N,) position in `LabelledData.classes`; whatever it says does not count where `ignored`.
        ignored: (N,) True for a region of which nothing is known: crowds, difficult objects, things that the source
            does not label. Neither finding something there nor missing it is wrong.
        group: Scene, flight or video that it belongs to; no group is in two splits.
        source: Name of the data set.
        weight: How often it is drawn in training, relative to others.
        foot_px: (N, 2) ground points: where the middle of each footprint appears (of an excavator the centre of its
            swing), also where it is hidden or outside the picture; NaN where nobody marked it; left out: nowhere.
        orientation: What makes of the stored picture the one that is marked.
    """

    path: Path
    size_px: tuple[int, int]
    xyxy_px: FloatArray
    class_id: IntArray
    ignored: BoolArray
    group: str
    source: str
    weight: float = 1.0
    foot_px: FloatArray = field(default_factory=lambda: NO_POINTS)
    orientation: Orientation = UPRIGHT

    def __post_init__(self) -> None:
        object.__setattr__(self, "foot_px", one_point_a_box(self.foot_px, self.xyxy_px))


@dataclass(frozen=True, slots=True)
class Problem:
    """Something wrong with a picture or its labels, and what became of it.

    Attributes:
        path: File that it is in.
        found: What is wrong, in a few words ("class id 9, of 7 classes").
        kind: For counting: the same words for the same kind of problem.
        skipped_picture: True if the picture is left out; otherwise only the box was dropped or mended.
    """

    path: Path
    found: str
    kind: str
    skipped_picture: bool

    def __str__(self) -> str:
        return f"{self.path}: {self.found}"


@dataclass(frozen=True, slots=True, eq=False)
class LabelledData:
    """Pictures of one or more data sets, under one list of classes.

    Attributes:
        classes: Names; `class_id` is a position in it.
        splits: The pictures of each split, in a fixed order; a split may be empty.
        problems: What was wrong, in the order found.
        is_divided: False where nothing in the data says what is held out, so that the splits are standoff's own choice.
    """

    classes: tuple[str, ...]
    splits: dict[Split, tuple[LabelledPicture, ...]]
    problems: Sequence[Problem]
    is_divided: bool = True
