"""Read labelled pictures from whatever they come in."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from standoff.core.boxes import unknown_points
from standoff.core.class_map import IGNORE
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.labels.checks import check_boxes, inside
from standoff.labels.layout import read_negatives, read_set
from standoff.labels.mixture import DROP, LabelSource, Mixture, is_mixture, read_mixture
from standoff.labels.pictures import TURNED
from standoff.labels.regions import OWN_REGIONS, read_regions
from standoff.labels.source import BadPicture, SourcePicture, SourceSet
from standoff.labels.splits import group_of, is_divided, split_pictures
from standoff.labels.types import SPLITS, LabelledData, LabelledPicture, Problem, Split

CUT_GROUP: Final = "group in two splits"
"""Kind of problem of a set whose own splits cut a scene."""
_NOWHERE: Final = np.zeros((0, 4))


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """Where a picture belongs."""

    source: LabelSource
    group: str
    regions_px: FloatArray


def read_data(path: Path) -> LabelledData:
    """Read labelled pictures; of the pictures themselves only the headers.

    Args:
        path: Folder of a YOLO, COCO or Pascal VOC data set, its data.yaml or COCO file, or a mixture file that
            lists several (see docs/labelled-data.md).

    Raises:
        DataError: It is none of these, contradicts itself, or more than half of a set's pictures cannot be used.
    """
    mixture = _open_mixture(path)
    sets = [_read_source(source) for source in mixture.sources]
    maps = [_map_labels(source, one) for source, one in zip(mixture.sources, sets, strict=True)]
    kept = [name for names in maps for name in names.values() if name not in (IGNORE, DROP)]
    classes = mixture.classes or tuple(dict.fromkeys(kept))
    if not classes:
        for source, one in zip(mixture.sources, sets, strict=True):
            if one.problems and not one.pictures:  # that there are no classes is not what must be repaired
                _require_enough(source, 0, one.problems)
        raise DataError(expected=f"classes in {path}", found="none", fix="add a set with labels, or `classes`")
    splits: dict[Split, list[LabelledPicture]] = {split: [] for split in SPLITS}
    problems: list[Problem] = []
    for source, one, names in zip(mixture.sources, sets, maps, strict=True):
        class_ids = _class_ids(source, names, one, classes)
        pictures, found = _check_source(source, one, class_ids, mixture.seed)
        problems += found
        for split in SPLITS:
            splits[split] += pictures[split]
    return LabelledData(
        classes=classes,
        splits={split: tuple(pictures) for split, pictures in splits.items()},
        problems=problems,
        is_divided=any(is_divided(source, one.pictures) for source, one in zip(mixture.sources, sets, strict=True)),
    )


def _open_mixture(path: Path) -> Mixture:
    if is_mixture(path):
        return read_mixture(path)
    return Mixture([LabelSource(path, path.resolve().name)])


def _read_source(source: LabelSource) -> SourceSet:
    if source.negatives:
        return read_negatives(source.path)
    return read_set(source.path, source.names, source.pictures)


def _map_labels(source: LabelSource, one: SourceSet) -> dict[str, str]:
    """Return what becomes of each label: a class, `ignore` or `drop`."""
    unknown = sorted(set(source.class_map) - set(one.labels) - {"*"})
    if unknown:
        raise DataError(
            expected=f"labels of '{source.name}' in its class map ({', '.join(one.labels)})",
            found=", ".join(unknown),
            fix="correct the class map",
        )
    return {label: source.class_map.get(label, source.class_map.get("*", label)) for label in one.labels}


def _class_ids(
    source: LabelSource, names: Mapping[str, str], one: SourceSet, classes: Sequence[str]
) -> dict[str, int | None]:
    """Return the class id of each label, None where ignored, nothing where dropped."""
    used = {label for picture in one.pictures for label in picture.labels}
    strange = sorted(label for label in used if names[label] not in (*classes, IGNORE, DROP))
    if strange:
        raise DataError(
            expected=f"labels of '{source.name}' that are classes ({', '.join(classes)})",
            found=", ".join(strange),
            fix=f"say in its `class_map` what they are: a class, {IGNORE} or {DROP}",
        )
    ids: dict[str, int | None] = {name: number for number, name in enumerate(classes)} | {IGNORE: None}
    return {label: ids[name] for label, name in names.items() if name in ids}


def _check_source(
    source: LabelSource, one: SourceSet, class_ids: Mapping[str, int | None], seed: int
) -> tuple[dict[Split, list[LabelledPicture]], list[Problem]]:
    """Return the good pictures of each split, and what was wrong with the others."""
    regions = _read_regions(source)
    groups = [group_of(picture, source.group) for picture in one.pictures]
    places = split_pictures(source, one.pictures, groups, seed)
    split_of = _splits_of_groups(groups, places)
    splits: dict[Split, list[LabelledPicture]] = {split: [] for split in SPLITS}
    problems = [*one.problems, *_cut_groups(source, split_of), *_lost_regions(source, regions, one)]
    for picture, group, split in zip(one.pictures, groups, places, strict=True):
        if split is None:
            problems.append(Problem(picture.path, "in none of the splits", "picture in no split", skipped_picture=True))
            continue
        # cut by the set's own splits, a group is two, so that no group is in two splits
        name = f"{source.name}/{group}" if len(split_of[group]) == 1 else f"{source.name}/{group} ({split})"
        try:
            labelled, mended = _label(
                picture, _Place(source, name, regions.get(picture.path.stem, _NOWHERE)), class_ids
            )
        except BadPicture as error:
            problems.append(error.problem)
            continue
        splits[split].append(labelled)
        problems += mended
    _require_enough(source, sum(map(len, splits.values())), problems)
    return splits, problems


def _splits_of_groups(groups: Sequence[str], splits: Sequence[Split | None]) -> dict[str, list[Split]]:
    pairs = set(zip(groups, splits, strict=True))
    return {group: [split for split in SPLITS if (group, split) in pairs] for group in dict.fromkeys(groups)}


def _cut_groups(source: LabelSource, split_of: Mapping[str, Sequence[Split]]) -> list[Problem]:
    return [
        Problem(source.path, f"'{group}' is in {' and '.join(found)}", CUT_GROUP, skipped_picture=False)
        for group, found in split_of.items()
        if len(found) > 1
    ]


def _lost_regions(source: LabelSource, regions: Mapping[str, FloatArray], one: SourceSet) -> list[Problem]:
    known = {picture.path.stem for picture in one.pictures} | {problem.path.stem for problem in one.problems}
    return [
        Problem(source.path, f"'{stem}' is no picture", "ignored region of no picture", skipped_picture=False)
        for stem in regions
        if stem not in known
    ]


def _label(
    picture: SourcePicture, place: _Place, class_ids: Mapping[str, int | None]
) -> tuple[LabelledPicture, tuple[Problem, ...]]:
    boxes = check_boxes(picture, class_ids)
    if len(place.regions_px) and any(note.kind == TURNED for note in picture.notes):
        raise BadPicture(picture.path, "turned by its EXIF data, and it has ignored regions", TURNED)
    regions_px = inside(place.regions_px, picture.size_px)
    regions_px = regions_px[(regions_px[:, :2] < regions_px[:, 2:]).all(axis=1)]
    labelled = LabelledPicture(
        picture.path,
        picture.size_px,
        np.concatenate([boxes.xyxy_px, regions_px]),
        np.concatenate([boxes.class_id, np.zeros(len(regions_px), np.int64)]),
        np.concatenate([boxes.ignored, np.ones(len(regions_px), np.bool_)]),
        place.group,
        place.source.name,
        place.source.weight,
        np.concatenate([boxes.foot_px, unknown_points(len(regions_px))]),
        picture.orientation,
    )
    return labelled, boxes.problems


def _read_regions(source: LabelSource) -> dict[str, FloatArray]:
    """Return (N, 4) boxes in which nothing is known, by the stem of the picture."""
    folder = source.path if source.path.is_dir() else source.path.parent
    path = source.ignore_regions or folder / OWN_REGIONS
    return read_regions(path) if source.ignore_regions is not None or path.is_file() else {}


def _require_enough(source: LabelSource, good: int, problems: Sequence[Problem]) -> None:
    kinds = Counter(problem.kind for problem in problems if problem.skipped_picture)
    skipped = kinds.total()
    if good >= skipped and good > 0:
        return
    examples = [next(problem for problem in problems if problem.kind == kind) for kind, _ in kinds.most_common(3)]
    reasons = [f"{one.kind} ({kinds[one.kind]}, as {one})" for one in examples]
    raise DataError(
        expected=f"pictures with labels in '{source.name}', most of them usable",
        found=f"{good} usable and {skipped} not: {'; '.join(reasons)}" if reasons else "no picture",
        fix="repair or remove them",
    )
