"""What a sweep is told: a plan that all scenarios share, and in what each of them differs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from standoff.config import read_settings_file
from standoff.core.errors import ConfigError
from standoff.training.run.plan import PLAN_KEYS, Overrides, RunPlan, as_section, flat_settings, make_plan, take_plan

SCENARIO_KEYS: Final = tuple(key for key in PLAN_KEYS if key != "data")
_FOLDER_NAME: Final = re.compile(r"(?!sweep\.)\w[\w.+=-]*")
"""No path, nothing hidden, and none of the sweep's own files."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """Plans to compare.

    Attributes:
        shared: What they have in common.
        scenarios: The plan of each, by name; all on the data of `shared`, no two alike.
    """

    shared: RunPlan
    scenarios: Mapping[str, RunPlan]

    def differences(self, name: str) -> dict[str, Any]:
        """Return in what a scenario differs from the shared plan, as a sweep file has it."""
        return differences_of(self.shared.to_dict(), self.scenarios[name].to_dict())

    def to_dict(self) -> dict[str, Any]:
        """Return what repeats the sweep from any folder: plain values, as `sweep.yaml` holds them."""
        return {**self.shared.to_dict(), "scenarios": {name: self.differences(name) for name in self.scenarios}}


def read_sweep(path: Path, overrides: Overrides) -> Sweep:
    """Read a sweep: what a plan has, and `scenarios`, each with what it changes of `arch`, `weights` and `train`.

    Args:
        path: YAML file; paths in it are relative to it.
        overrides: Go before the file, in every scenario.

    Raises:
        ConfigError: It cannot be read, or one of the plans is not right.
        ModelError: A shipped detector to start from is not installed.
    """
    file = read_settings_file(path)
    scenarios = as_section(file.pop("scenarios", None), "scenarios")
    if not scenarios:
        raise ConfigError(
            expected=f"`scenarios` by name in {path}", found="none", fix="write what differs below a name for each"
        )
    given = take_plan(file, path.parent, f"{path} beside scenarios")
    shared = _plan(given, overrides, str(path))
    plans = {}
    for name, changes in scenarios.items():
        where = f"scenario {_checked_name(str(name))} of {path}"
        own = take_plan(
            as_section(changes, str(name)), path.parent, where,
            keys=SCENARIO_KEYS, fix="correct it; `data` is the same for all scenarios and stands above them",
        )  # fmt: skip
        own["train"] = as_section(own.get("train"), f"{name}.train")
        plans[str(name)] = _plan(_merged(given, own), overrides, where)
    _refuse_alike(plans)
    return Sweep(shared, plans)


def differences_of(shared: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Return what plain settings have otherwise than shared ones, of nested ones only that.

    >>> differences_of({"steps": 5, "augment": {"haze": 0.1, "mosaic": 1.0}}, {"steps": 5, "augment": {"mosaic": 0.0}})
    {'augment': {'mosaic': 0.0}}
    """
    differences: dict[str, Any] = {}
    for name, value in own.items():
        before = shared.get(name)
        if isinstance(before, Mapping) and isinstance(value, Mapping):
            if inner := differences_of(before, value):
                differences[name] = inner
        elif value != before:
            differences[name] = value
    return differences


def words_of(differences: Mapping[str, Any]) -> str:
    """Return differences as people would say them.

    >>> words_of({"arch": "yolov3-tiny", "train": {"learning_rate": 0.001, "augment": {"mosaic": 0.0}}})
    'arch yolov3-tiny, learning_rate 0.001, augment.mosaic 0'
    >>> words_of({})
    'nothing'
    """
    flat = flat_settings(differences)
    return ", ".join(f"{name.removeprefix('train.')} {_word(value)}" for name, value in flat.items()) or "nothing"


def _word(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_word, value))}]"
    if isinstance(value, str):
        # Of a path the file and its folder: weights are called best.weights in all of them.
        return "/".join(Path(value).parts[-2:])
    if value is None or isinstance(value, bool):
        return {None: "none", True: "true", False: "false"}[value]
    return f"{value:g}" if isinstance(value, float) else str(value)


def _plan(given: Mapping[str, Any], overrides: Overrides, origin: str) -> RunPlan:
    # The overrides change nested settings in place, which scenarios share.
    own = deepcopy(dict(given))
    overrides.apply(own)
    return make_plan(own, origin)


def _merged(shared: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the shared settings with changes: of nested ones only those that are named."""
    merged = dict(shared)
    for name, value in changes.items():
        before = shared.get(name)
        if isinstance(before, Mapping) and isinstance(value, Mapping):
            value = _merged(before, value)
        merged[name] = value
    return merged


def _checked_name(name: str) -> str:
    if not _FOLDER_NAME.fullmatch(name):
        raise ConfigError(
            expected="scenarios with names for folders: letters, digits and _ . + = -",
            found=f"'{name}'",
            fix="call it something else",
        )
    return name


def _refuse_alike(plans: Mapping[str, RunPlan]) -> None:
    first_of: dict[str, str] = {}
    for name, plan in plans.items():
        first = first_of.setdefault(str(plan.to_dict()), name)
        if first != name:
            raise ConfigError(
                expected="scenarios that differ",
                found=f"{first} and {name} alike",
                fix="leave one out; what --set says holds for all of them",
            )
