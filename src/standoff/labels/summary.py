"""Count what labelled pictures hold, for tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from standoff.labels.types import LabelledData, LabelledPicture, Split


@dataclass(frozen=True, slots=True)
class SplitSummary:
    """What one split holds.

    Attributes:
        pictures: How many.
        empty: How many of them without a box.
        boxes: By class, in the order of the classes; ignored regions do not count.
        ignored: Ignored regions.
        sources: Pictures by data set.
        groups: Pictures by scene, flight or video.
    """

    pictures: int
    empty: int
    boxes: Mapping[str, int]
    ignored: int
    sources: Mapping[str, int]
    groups: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class DataSummary:
    """What labelled pictures hold.

    Attributes:
        splits: By split.
        problems: How often each kind of problem was met, most frequent first.
        skipped: Pictures left out.
    """

    splits: Mapping[Split, SplitSummary]
    problems: Mapping[str, int]
    skipped: int


def summarise(data: LabelledData) -> DataSummary:
    """Count pictures, boxes, groups and problems."""
    return DataSummary(
        {split: _summarise_split(data.classes, pictures) for split, pictures in data.splits.items()},
        dict(Counter(problem.kind for problem in data.problems).most_common()),
        sum(problem.skipped_picture for problem in data.problems),
    )


def _summarise_split(classes: tuple[str, ...], pictures: tuple[LabelledPicture, ...]) -> SplitSummary:
    counts = np.zeros(len(classes), np.int64)
    for picture in pictures:
        counts += np.bincount(picture.class_id[~picture.ignored], minlength=len(classes))
    return SplitSummary(
        pictures=len(pictures),
        empty=sum(not (~picture.ignored).any() for picture in pictures),
        boxes=dict(zip(classes, counts.tolist(), strict=True)),
        ignored=sum(int(picture.ignored.sum()) for picture in pictures),
        sources=dict(Counter(picture.source for picture in pictures)),
        groups=dict(Counter(picture.group for picture in pictures)),
    )
