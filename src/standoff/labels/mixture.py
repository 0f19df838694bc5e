"""Mixture files: several data sets as one, under one list of classes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from standoff.core.errors import DataError
from standoff.labels.documents import check_types, read_yaml, resolve_path
from standoff.labels.layout import YAML_SUFFIXES
from standoff.labels.types import SPLITS, Split
from standoff.labels.yolo import labels_of

DROP: Final = "drop"
"""In a class map: as if the box had never been marked."""


@dataclass(frozen=True, slots=True)
class LabelSource:
    """One data set of a mixture, and what to make of it.

    Attributes:
        path: Folder or file.
        name: For tables and messages.
        names: Labels by class id, of a YOLO set that does not tell them.
        pictures: Folder of a COCO file's pictures, when they are not beside it.
        class_map: Label to class, `ignore` or `drop`; `*` stands for all labels that are not named.
        group: Regular expression; its first group, found in a file's stem, is the scene; None: guess.
        held_out: Share of the pictures for `val` and `test`, in whole groups; None: not said.
        split: Of all pictures; None: the set's own.
        groups: Names of the groups of `val` and `test`; the others train.
        weight: How often its pictures are drawn in training.
        negatives: Whether it is a folder of pictures in which nothing is to be found.
        ignore_regions: YAML of boxes by picture stem in which nothing is known.
    """

    path: Path
    name: str
    names: Sequence[str] | None = None
    pictures: Path | None = None
    class_map: Mapping[str, str] = field(default_factory=dict)
    group: re.Pattern[str] | None = None
    held_out: Mapping[Split, float] | None = None
    split: Split | None = None
    groups: Mapping[Split, Sequence[str]] = field(default_factory=dict)
    weight: float = 1.0
    negatives: bool = False
    ignore_regions: Path | None = None


@dataclass(frozen=True, slots=True)
class Mixture:
    """Data sets under one list of classes.

    Attributes:
        sources: The sets.
        classes: Names; None: all that the sets have, in the order of first appearance.
        seed: Of the choice of held-out groups.
    """

    sources: Sequence[LabelSource]
    classes: tuple[str, ...] | None = None
    seed: int = 0


_TYPES: Final[Mapping[str, tuple[type, ...]]] = {
    "path": (str,),
    "name": (str,),
    "names": (list, dict),
    "pictures": (str,),
    "class_map": (dict,),
    "group": (str,),
    "held_out": (dict,),
    "split": (str,),
    "groups": (dict,),
    "weight": (int, float),
    "negatives": (bool,),
    "ignore_regions": (str,),
}
_MIXTURE_TYPES: Final[Mapping[str, tuple[type, ...]]] = {"classes": (list,), "sources": (list,), "seed": (int,)}


def is_mixture(path: Path) -> bool:
    """Tell whether a file is a mixture file, rather than a data set or its description.

    Raises:
        DataError: It is YAML that cannot be read.
    """
    return path.is_file() and path.suffix.lower() in YAML_SUFFIXES and "sources" in read_yaml(path)


def read_mixture(path: Path) -> Mixture:
    """Read a mixture file.

    Raises:
        DataError: Not readable, an unknown name, or a value of the wrong kind.
    """
    content = read_yaml(path)
    check_types(content, _MIXTURE_TYPES, str(path))
    entries = content.get("sources") or []
    sources = [_source(entry, f"source {number} of {path}", path.parent) for number, entry in enumerate(entries, 1)]
    names = [source.name for source in sources]
    if not sources or len(set(names)) < len(names):
        raise DataError(
            expected=f"one or more `sources` in {path}, each with a `name` of its own",
            found=", ".join(names) or "none",
            fix="correct the file",
        )
    classes = tuple(map(str, content["classes"])) if "classes" in content else None
    if classes is not None and not 0 < len(set(classes)) == len(classes):
        raise DataError(
            expected=f"different `classes` in {path}", found=", ".join(classes) or "none", fix="correct them"
        )
    return Mixture(sources, classes, content.get("seed", 0))


def _source(entry: object, where: str, folder: Path) -> LabelSource:
    if not isinstance(entry, dict) or "path" not in entry:
        raise DataError(expected=f"`path` in {where}", found=repr(entry), fix="write `path: FOLDER or FILE`")
    check_types(entry, _TYPES, where)
    _check_splits(entry, where)
    path = resolve_path(entry["path"], folder)
    chosen: dict[str, Any] = {key: entry[key] for key in ("held_out", "split", "negatives") if key in entry}
    chosen |= {key: resolve_path(entry[key], folder) for key in ("pictures", "ignore_regions") if key in entry}
    if "names" in entry:
        chosen["names"] = labels_of(entry["names"], Path(where))
    if "class_map" in entry:
        chosen["class_map"] = {str(label): str(name) for label, name in entry["class_map"].items()}
    if "groups" in entry:
        chosen["groups"] = {split: tuple(map(str, names)) for split, names in entry["groups"].items()}
    if "group" in entry:
        chosen["group"] = _pattern(entry["group"], where)
    weight = float(entry.get("weight", 1.0))
    if not 0.0 < weight < float("inf"):
        raise DataError(expected=f"a `weight` over 0 in {where}", found=str(weight), fix="correct it")
    return LabelSource(path, entry.get("name", path.name), weight=weight, **chosen)


def _check_splits(entry: Mapping[str, Any], where: str) -> None:
    said = [key for key in ("held_out", "split", "groups") if key in entry]
    if len(said) > 1:
        raise DataError(
            expected=f"one of held_out, split and groups in {where}", found=" and ".join(said), fix="remove the others"
        )
    if "split" in entry and entry["split"] not in SPLITS:
        raise DataError(expected=f"split: train, val or test in {where}", found=entry["split"], fix="correct it")
    for key, kind in (("held_out", (int, float)), ("groups", list)):
        for split, value in entry.get(key, {}).items():
            if split not in ("val", "test") or isinstance(value, bool) or not isinstance(value, kind):
                raise DataError(
                    expected=f"`{key}` of val and test in {where}", found=f"{split}: {value}", fix="correct it"
                )
    shares = entry.get("held_out", {}).values()
    if any(not 0.0 <= share < 1.0 for share in shares) or sum(shares) >= 1.0:
        raise DataError(
            expected=f"shares in all under 1 in `held_out` of {where}", found=f"{list(shares)}", fix="correct them"
        )


def _pattern(text: str, where: str) -> re.Pattern[str]:
    try:
        pattern = re.compile(text)
    except re.error as error:
        raise DataError(
            expected=f"a regular expression as `group` in {where}", found=f"{text} ({error})", fix="correct it"
        ) from error
    if not pattern.groups:
        raise DataError(
            expected=f"a group in parentheses in the regular expression `group` of {where}",
            found=text,
            fix="put parentheses around what names the scene, as in '(.*)-[0-9]+'",
        )
    return pattern
