"""What is to be known of labelled pictures before the first step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from standoff.core.errors import ConfigError, DataError
from standoff.labels import LabelledData, read_data
from standoff.labels.near_duplicates import near_duplicates
from standoff.labels.problems import problem_lines, readable_pictures
from standoff.labels.splits import require_splits, spread
from standoff.training.run.params import TrainParams


def open_data(path: Path, uses: Sequence[TrainParams], on_message: Callable[[str], None] | None) -> LabelledData:
    """Read labelled pictures, tell what is wrong with them, and refuse those that cannot be trained on.

    Args:
        path: See `standoff.labels.read_data`.
        uses: Settings of the runs that will use them, at least one.
        on_message: Hears what is wrong, line by line; None: nobody does, and nothing is decoded to find it.

    Raises:
        DataError: They cannot be read, a split is absent, or there is no box to validate with.
        ConfigError: A setting names a data set that is not among them.
    """
    data = read_data(path)
    if on_message is not None:
        validated = spread(data.splits["val"], max(params.validate_pictures for params in uses))
        _, unreadable = readable_pictures(validated, lambda: None)
        for line in problem_lines([*data.problems, *unreadable]):
            on_message(line)
    for params in uses:
        _require_usable(data, params)
    return data


def _require_usable(data: LabelledData, params: TrainParams) -> None:
    require_splits(data, ("train", "val"))
    shown = spread(data.splits["val"], params.validate_pictures)
    if all(picture.ignored.all() for picture in shown):
        raise DataError(
            expected="boxes to validate with",
            found=f"none in the {len(shown)} pictures of the validation split that are used",
            fix="label them, hold out other scenes, or raise validate_pictures",
        )
    sources = sorted({picture.source for pictures in data.splits.values() for picture in pictures})
    unknown = sorted(set(params.augment.any_rotation_sources) - set(sources))
    if unknown:
        raise ConfigError(
            expected=f"names of data sets ({', '.join(sources)}) in any_rotation_sources",
            found=", ".join(unknown),
            fix="correct the setting",
        )


def report_near_duplicates(data: LabelledData, on_message: Callable[[str], None]) -> None:
    """Warn of held-out pictures that look like training ones: their figures would say nothing about new sites."""
    found = near_duplicates(data)
    if found:
        first = found[0]
        on_message(
            f"{len(found)} held-out pictures look like one to train on, first {first.held_out.name} ({first.split}) "
            f"like {first.train.name}: split by scene, flight or video, or figures will be too good"
        )
