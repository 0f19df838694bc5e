"""What the files of one data set say, before anything is checked or mapped."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, TypeVar

from standoff.core.homography import BoolArray, FloatArray
from standoff.files.orientation import UPRIGHT, Orientation
from standoff.labels.ground_points import NO_POINTS, one_point_a_box
from standoff.labels.types import Problem, Split

ELSEWHERE: Final = "found elsewhere than its labels say"
"""Kind of problem of a file whose path is of another computer."""
UNPLACEABLE: Final = "labels cannot be placed"
"""Kind of problem of a picture whose boxes are not where its layout has them."""
_Item = TypeVar("_Item")

_SPLIT_WORDS: Final[tuple[tuple[str, Split], ...]] = (
    ("train", "train"),
    ("training", "train"),
    ("val", "val"),
    ("valid", "val"),
    ("validation", "val"),
    ("test", "test"),
    ("testing", "test"),
)


class BadPicture(Exception):
    """One picture that cannot be used; the others can.

    Args:
        path: File that is wrong.
        found: What is wrong with it.
        kind: The same words for the same kind of problem.
    """

    def __init__(self, path: Path, found: str, kind: str) -> None:
        self.problem = Problem(path, found, kind, skipped_picture=True)
        super().__init__(f"{path}: {found}")


@dataclass(frozen=True, slots=True, eq=False)
class SourcePicture:
    """One picture as its data set marks it.

    Attributes:
        path: Of the picture.
        size_px: (width, height) as its labels take it.
        labels: One for each box, in the set's own words.
        xyxy_px: (N, 4) as marked, possibly outside the picture; 0 is the centre of the first pixel.
        ignored: (N,) True where the set says that nothing is known.
        split: Where the set puts it; None: it does not say.
        scene: What the set calls its scene; empty: it does not say.
        foot_px: (N, 2) where the middle of each footprint appears, as in `LabelledPicture`; left out: nowhere marked.
        orientation: What makes of the stored picture the one that is marked.
        notes: What is odd about it and cost nothing.
    """

    path: Path
    size_px: tuple[int, int]
    labels: tuple[str, ...]
    xyxy_px: FloatArray
    ignored: BoolArray
    split: Split | None = None
    scene: str = ""
    foot_px: FloatArray = field(default_factory=lambda: NO_POINTS)
    orientation: Orientation = UPRIGHT
    notes: tuple[Problem, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "foot_px", one_point_a_box(self.foot_px, self.xyxy_px))


@dataclass(frozen=True, slots=True, eq=False)
class SourceSet:
    """A data set as it is on disk.

    Attributes:
        labels: All that it may use, in its own order.
        pictures: In a fixed order.
        problems: Pictures that could not be read.
    """

    labels: tuple[str, ...]
    pictures: Sequence[SourcePicture]
    problems: Sequence[Problem]


def read_each(
    items: Iterable[_Item], read: Callable[[_Item], SourcePicture]
) -> tuple[list[SourcePicture], list[Problem]]:
    """Read picture after picture; one that is bad, or that came before, becomes a problem and stops nothing.

    Of two entries that led to one file the first is right, unless one of them names another file that is not there:
    then nobody knows whose labels are whose, and the file is left out.
    """
    pictures: dict[Path, SourcePicture] = {}
    problems: list[Problem] = []
    unsure: set[Path] = set()
    for item in items:
        try:
            picture = read(item)
        except BadPicture as error:
            problems.append(error.problem)
            continue
        if picture.path in pictures:
            problems.append(Problem(picture.path, "listed twice", "picture listed twice", skipped_picture=True))
            both = (*picture.notes, *pictures[picture.path].notes)
            unsure |= {picture.path} if any(note.kind == ELSEWHERE for note in both) else set()
        else:
            pictures[picture.path] = picture
    found = "entries with other paths, which are not there, may mean it"
    problems += [Problem(path, found, "contradictory labels", skipped_picture=True) for path in sorted(unsure)]
    kept = [picture for path, picture in pictures.items() if path not in unsure]
    return kept, problems + [note for picture in kept for note in picture.notes]


def split_named(name: str) -> Split | None:
    """Return the split that a folder's or file's name means.

    >>> split_named("instances_val2017"), split_named("valid"), split_named("labels")
    ('val', 'val', None)
    """
    word = re.sub(r"^instances_|\d+$", "", name.lower())
    return dict(_SPLIT_WORDS).get(word)
