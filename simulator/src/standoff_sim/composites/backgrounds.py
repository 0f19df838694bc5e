"""Photographs of real ground: what is known of each, and which of them belong together."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_args

import numpy as np

from standoff.core.class_map import IGNORE
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.core.types import IntArray
from standoff.files.yaml_text import read_yaml
from standoff.labels.documents import check_types, resolve_path
from standoff.labels.pictures import canvas_of, find_pictures
from standoff.labels.regions import corners_of, read_regions
from standoff.labels.source import BadPicture
from standoff.labels.splits import flight_of
from standoff.labels.types import Split
from standoff.labels.yolo import read_boxes
from standoff_sim.clip.presets import Condition

_CAR_M = 4.6
_DAYLIGHT: tuple[Condition, ...] = ("noon", "afternoon", "hazy", "overcast")
_PITCHES_DEG = {"nadir": 90.0, "oblique": 40.0}
_NOWHERE = np.empty((0, 4))
_TYPES: Mapping[str, tuple[type, ...]] = MappingProxyType(
    {
        "pictures": (str,),
        "view": (str,),
        "pitch_deg": (int, float),
        "px_per_m": (int, float),
        "light": (list,),
        "shadow_deg": (int, float),
        "labels": (dict,),
        "ignore_px": (list,),
        "ignore_regions": (str,),
        "group": (str,),
    }
)


@dataclass(frozen=True, slots=True, eq=False)
class Background:
    """A photograph.

    Attributes:
        path: Of the file.
        group: Flight that it belongs to; what one flight shows is in one split only.
        pitch_deg: Of the camera below the horizon: 90 looks straight down.
        px_per_m: Pixels a metre in the middle of the photograph; None if nobody knows.
        conditions: Kinds of light that it may have been taken in.
        shadow_deg: Where shadows fall, clockwise from the photograph's upper edge; None if nobody knows.
        xyxy_px: (N, 4) what is marked in it, 0 the centre of the first pixel.
        class_id: (N,) of `standoff.core.classes`.
        ignored_px: (M, 4) places with things that are not marked.
    """

    path: Path
    group: str
    pitch_deg: float
    px_per_m: float | None
    conditions: tuple[Condition, ...]
    shadow_deg: float | None
    xyxy_px: FloatArray
    class_id: IntArray
    ignored_px: FloatArray


def find_backgrounds(sources: Sequence[str]) -> tuple[Background, ...]:
    """Find the photographs.

    Args:
        sources: Each a folder, searched with all below, or a folder and how its pictures were taken, `DIR:nadir` or
            `DIR:oblique`, or a YAML file as `docs/simulator.md` describes it.

    Returns:
        In the order of the sources, then by name.

    Raises:
        DataError: A source that cannot be read, or no photograph at all.
    """
    found: list[Background] = []
    for source in sources:
        if source.endswith((".yaml", ".yml")):
            found += _listed(Path(source))
        else:
            folder, _, view = source.partition(":")
            found += _described(_below(Path(folder)), {"view": view or "nadir"}, Path(source))
    if not found:
        raise DataError(
            expected="photographs of ground (.jpg, .png)", found=f"none in {', '.join(sources)}", fix="name a folder"
        )
    return tuple(found)


def split_backgrounds(backgrounds: Sequence[Background], held_out: float) -> dict[Split, tuple[Background, ...]]:
    """Divide the flights among train, val and test: the smallest are held out, so that training sees most ground.

    Args:
        backgrounds: All.
        held_out: Share of the flights for each of val and test, at least one if there are three; 0 holds nothing out.

    Returns:
        The photographs of each split; val and test are empty if nothing is held out.
    """
    flights: dict[str, list[Background]] = defaultdict(list)
    for background in backgrounds:
        flights[background.group].append(background)
    by_size = sorted(flights, key=lambda group: (len(flights[group]), group))
    apart = max(round(held_out * len(by_size)), 1) if held_out > 0.0 and len(by_size) >= 3 else 0
    shares: dict[Split, list[str]] = {
        "val": by_size[:apart],
        "test": by_size[apart : 2 * apart],
        "train": by_size[2 * apart :],
    }
    return {split: tuple(b for group in groups for b in flights[group]) for split, groups in shares.items()}


def _below(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise DataError(expected="a folder of photographs", found=f"no folder {folder}", fix="check the path")
    return find_pictures(folder)


def _listed(file: Path) -> list[Background]:
    entries = read_yaml(file, "a YAML list of backgrounds")
    if not isinstance(entries, list):
        raise DataError(expected="a YAML list of backgrounds", found=f"another thing in {file}", fix="begin with '- '")
    found: list[Background] = []
    for number, entry in enumerate(entries, start=1):
        where = f"entry {number} of {file}"
        if not isinstance(entry, dict):
            raise DataError(expected=f"`pictures: PATTERN` in {where}", found=repr(entry), fix="see docs/simulator.md")
        check_types(entry, _TYPES, where)
        paths = _matching(file.parent, entry.get("pictures", ""))
        if not paths:
            raise DataError(expected="photographs under `pictures`", found=f"none in {file}", fix="check the pattern")
        found += _described(paths, entry, file)
    return found


def _matching(folder: Path, pattern: str) -> list[Path]:
    path = resolve_path(pattern, folder)
    return sorted(path.parent.glob(path.name)) if pattern else []


def _described(paths: Sequence[Path], entry: Mapping[str, Any], source: Path) -> list[Background]:
    view, light = entry.get("view", "nadir"), tuple(entry.get("light", _DAYLIGHT))
    wrong = [view] * (view not in _PITCHES_DEG) + [name for name in light if name not in get_args(Condition)]
    wrong += [name for name in [entry.get("group", "")] if "/" in name]
    if wrong:
        raise DataError(
            expected=f"views {', '.join(_PITCHES_DEG)}; light {get_args(Condition)}; a group without /",
            found=f"{', '.join(map(repr, wrong))} in {source}",
            fix="correct it",
        )
    regions = read_regions(resolve_path(entry["ignore_regions"], source.parent)) if "ignore_regions" in entry else {}
    known = {**entry, "pitch_deg": float(entry.get("pitch_deg", _PITCHES_DEG[view]))}
    return [_background(path, known, light, regions.get(path.stem, _NOWHERE)) for path in paths]


def _background(
    path: Path, entry: Mapping[str, Any], light: tuple[Condition, ...], regions_px: FloatArray
) -> Background:
    xyxy_px, ids = np.empty((0, 4)), np.empty(0, np.int64)
    ignored_px = corners_of(entry.get("ignore_px", []))
    if ignored_px is None:
        raise DataError(
            expected="`ignore_px` as [[x1, y1, x2, y2], ...]", found=f"{entry['ignore_px']}", fix="correct it"
        )
    ignored_px = np.concatenate([ignored_px, regions_px])
    if len(ignored_px):
        _check_as_stored(path)
    px_per_m = entry.get("px_per_m")
    if entry.get("labels"):
        boxes_px, names = _read_labels(path, entry["labels"])
        ignored = np.array([name == IGNORE for name in names], dtype=bool)
        ignored_px = np.concatenate([ignored_px, boxes_px[ignored]])
        xyxy_px = boxes_px[~ignored]
        ids = np.array([CLASS_BY_NAME[name].id for name in names if name != IGNORE], dtype=np.int64)
        cars = xyxy_px[ids == CLASS_BY_NAME["vehicle"].id]
        if px_per_m is None and len(cars):
            px_per_m = float(np.median((cars[:, 2:] - cars[:, :2]).max(axis=1))) / _CAR_M
    group, shadow_deg = entry.get("group", flight_of(path)), entry.get("shadow_deg")
    return Background(path, group, entry["pitch_deg"], px_per_m, light, shadow_deg, xyxy_px, ids, ignored_px)


def _check_as_stored(path: Path) -> None:
    """Refuse a photograph that EXIF data turn: its regions may be of the stored one or of the upright one."""
    try:
        canvas_of(path, None, marked=True)
    except BadPicture as error:
        raise DataError(
            expected=f"a photograph that is upright as stored, for its regions, at {path}",
            found=error.problem.found,
            fix="save it upright and mark it again",
        ) from error


def _read_labels(path: Path, names: Mapping[int, str]) -> tuple[FloatArray, list[str]]:
    """Return the boxes (N, 4) of a photograph's YOLO label file, and what each is."""
    try:
        numbers, xyxy_px, _, _ = read_boxes(path)
    except BadPicture as error:
        raise DataError(
            expected=f"a photograph with labels in {path}", found=str(error), fix="check the folder"
        ) from error
    if not set(numbers.tolist()) <= set(names) or not set(names.values()) <= {*CLASS_BY_NAME, IGNORE}:
        raise DataError(
            expected=f"for each class that {path} shows one of {', '.join(CLASS_BY_NAME)} or {IGNORE}",
            found=f"{dict(names)}",
            fix="name them under `labels`",
        )
    return xyxy_px, [names[int(number)] for number in numbers]
