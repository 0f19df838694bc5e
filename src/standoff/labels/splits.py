"""Which scene a picture belongs to, which scenes are held out, and which few pictures stand for many."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from standoff.core.errors import DataError
from standoff.core.types import IntArray
from standoff.labels.mixture import LabelSource
from standoff.labels.source import SourcePicture
from standoff.labels.types import LabelledData, LabelledPicture, Split

DEFAULT_HELD_OUT: Final[Mapping[Split, float]] = {"val": 0.1, "test": 0.1}
_SHOWN: Final = 12
"""Groups that a message names."""
_TRAILING_NUMBER: Final = re.compile(r"[-_. ]*\d+$")


def group_of(picture: SourcePicture, pattern: re.Pattern[str] | None) -> str:
    """Return the scene, flight or video of a picture.

    Args:
        picture: The picture.
        pattern: Its first group, found in the file's stem, is the answer; None: the scene that the set names, or the
            stem without the number at its end, or the folder where the stem is only a number.

    Raises:
        DataError: The pattern does not fit the stem.
    """
    if pattern is not None:
        found = pattern.search(picture.path.stem)
        if found is None or found[1] is None:
            raise DataError(
                expected=f"stems of pictures that `group: {pattern.pattern}` fits",
                found=str(picture.path),
                fix="correct the regular expression",
            )
        return found[1]
    return picture.scene or flight_of(picture.path)


def flight_of(path: Path) -> str:
    """Return what a picture seems to be a part of: its name less the last number, or its folder.

    >>> [flight_of(Path(name)) for name in ("DJI_0005-0018.jpg", "DJI_0031.JPG", "MOS76.png", "roof/7.png")]
    ['DJI_0005', 'DJI', 'MOS', 'roof']
    """
    return _TRAILING_NUMBER.sub("", path.stem) or path.parent.name


def split_pictures(
    source: LabelSource, pictures: Sequence[SourcePicture], groups: Sequence[str], seed: int
) -> list[Split | None]:
    """Decide the split of each picture of a data set.

    Args:
        source: What the mixture says about the set.
        pictures: All of the set.
        groups: Group of each picture.
        seed: Of the choice of groups.

    Returns:
        The split of each; None where a set with splits leaves a picture out of all of them.

    Raises:
        DataError: A group that does not exist, or too few groups to hold any out.
    """
    own = {picture.split for picture in pictures} - {None}
    if source.split is not None:
        return [source.split] * len(pictures)
    if source.groups:
        return _split_as_named(source, groups)
    if source.held_out is None and own:
        return [picture.split for picture in pictures]
    if source.held_out is not None and len(own) > 1:
        raise DataError(
            expected=f"no splits in '{source.name}', because `held_out` makes them",
            found=", ".join(sorted(split for split in own if split)),
            fix="remove `held_out`, or name the groups to hold out",
        )
    split_of = hold_out(groups, DEFAULT_HELD_OUT if source.held_out is None else source.held_out, seed)
    missing = [split for split, share in (source.held_out or {}).items() if share and split not in split_of.values()]
    if missing:
        raise DataError(
            expected=f"enough groups in '{source.name}' to hold some out for {' and '.join(missing)}",
            found=_listed(groups),
            fix="give `group`, a regular expression that tells its scenes or flights apart, or `split`",
        )
    return [split_of[group] for group in groups]


def is_divided(source: LabelSource, pictures: Sequence[SourcePicture]) -> bool:
    """Tell whether the set or the mixture says what is held out."""
    says = source.split is not None or bool(source.groups) or source.held_out is not None
    return says or any(picture.split for picture in pictures)


def hold_out(groups: Sequence[str], held_out: Mapping[Split, float], seed: int) -> dict[str, Split]:
    """Choose groups to hold out, so that about the wanted share of the pictures is in them.

    Groups come in the order of a hash of seed and name, and each goes to the first split that it brings nearer to its
    share. A split that none fits gets the smallest group. One group is always left to train, and one for each split
    that has none yet, as far as there are any.

    Args:
        groups: Group of each picture.
        held_out: Share of the pictures of each split.
        seed: Of the choice.

    Returns:
        The split of each group.

    >>> hold_out(["a", "a", "b", "c"], {"val": 0.25}, seed=0)
    {'b': 'val', 'a': 'train', 'c': 'train'}
    """
    size = Counter(groups)
    order = sorted(size, key=lambda group: hashlib.blake2b(f"{seed}/{group}".encode()).digest())
    wanted = {split: share * len(groups) for split, share in held_out.items() if share > 0}
    held = dict.fromkeys(wanted, 0)
    split_of: dict[str, Split] = dict.fromkeys(order, "train")
    left = len(order)
    for group in order:
        for split, share in wanted.items():
            needed = 1 + sum(not held[other] for other in wanted if other != split)
            if left > needed and abs(held[split] + size[group] - share) < share - held[split]:
                split_of[group] = split
                held[split] += size[group]
                left -= 1
                break
    for split in (split for split in wanted if not held[split]):
        train = [group for group in order if split_of[group] == "train"]
        if len(train) > 1:
            split_of[min(train, key=lambda group: size[group])] = split
    return split_of


def require_splits(data: LabelledData, needed: Sequence[Split]) -> None:
    """Refuse data without pictures in a split.

    Args:
        data: To be trained on, say.
        needed: The splits.

    Raises:
        DataError: One of them is empty; says so when all pictures are of one scene.
    """
    empty = [split for split in needed if not data.splits[split]]
    if not empty:
        return
    every = [picture for pictures in data.splits.values() for picture in pictures]
    scenes = {picture.group for picture in every}
    if len(scenes) == 1:
        found = f"that all pictures are of one scene ({_scene(every[0])})"
        fix = "add another video, or give `group` in a mixture file"
    else:
        found = f"none in {' and '.join(empty)}"
        fix = "give data with these splits, or `held_out` in a mixture file"
    raise DataError(expected=f"pictures in the splits {' and '.join(needed)}", found=found, fix=fix)


def spread(pictures: Sequence[LabelledPicture], most: int) -> tuple[LabelledPicture, ...]:
    """Return at most `most` pictures, evenly over the sequence."""
    return tuple(pictures[row] for row in spread_rows(len(pictures), most))


def spread_rows(count: int, most: int | None) -> IntArray:
    """Return positions of all of `count` things, or of `most` evenly over them, the first and the last among them.

    >>> spread_rows(9, 3).tolist(), spread_rows(2, 3).tolist(), spread_rows(2, None).tolist()
    ([0, 4, 8], [0, 1], [0, 1])
    """
    return np.linspace(0, count - 1, min(count, most or count)).round().astype(np.int64)


def _scene(picture: LabelledPicture) -> str:
    return picture.group.removeprefix(f"{picture.source}/")


def _split_as_named(source: LabelSource, groups: Sequence[str]) -> list[Split | None]:
    split_of: dict[str, Split] = {name: split for split, names in source.groups.items() for name in names}
    unknown = sorted(set(split_of) - set(groups))
    if unknown or len(split_of) < sum(len(names) for names in source.groups.values()):
        raise DataError(
            expected=f"groups of '{source.name}', each once: {_listed(groups)}",
            found=", ".join(unknown) or "one in two splits",
            fix="correct `groups`",
        )
    return [split_of.get(group, "train") for group in groups]


def _listed(groups: Sequence[str]) -> str:
    names = sorted(set(groups))
    return ", ".join(names[:_SHOWN]) + (f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else "")
