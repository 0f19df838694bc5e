"""What a run is told: a file and the command line become a plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from standoff.config import read_params, read_settings_file
from standoff.core.errors import ConfigError
from standoff.files.json_text import plain
from standoff.files.yaml_text import parse_yaml
from standoff.labels.documents import resolve_path
from standoff.stages.detect import SHIPPED_MODELS, find_model
from standoff.training.run.params import TrainParams

PLAN_KEYS: Final = ("data", "arch", "weights", "train")
"""What a file with a plan may hold."""
_DEFAULT_ARCH: Final = "yolo-fastest-xl"
_ADVICE: Final = "correct them; `standoff train --show-settings` lists every train setting of a plan that is right"


@dataclass(frozen=True, slots=True)
class RunPlan:
    """What to train, from what, on what.

    Attributes:
        data: Labelled pictures; see `standoff.labels.read_data`.
        arch: Name of an architecture, or a Darknet cfg file.
        weights: To start from; None is from scratch.
        params: Settings.
    """

    data: Path
    arch: str
    weights: Path | None
    params: TrainParams

    def to_dict(self) -> dict[str, Any]:
        """Return what repeats the run from any folder: plain values, as `run.yaml` holds them."""
        weights = None if self.weights is None else str(self.weights.resolve())
        arch = str(Path(self.arch).resolve()) if self.arch.endswith(".cfg") else self.arch
        return {"data": str(self.data.resolve()), "arch": arch, "weights": weights, "train": plain(asdict(self.params))}


@dataclass(frozen=True, slots=True)
class Overrides:
    """What goes before a file: the words of a command line.

    Attributes:
        data: As in `RunPlan`; None leaves what the file says, here and below.
        arch: As in `RunPlan`.
        weights: As in `RunPlan`, or the name of a shipped detector.
        settings: NAME=VALUE of train settings, values as YAML has them.
    """

    data: Path | None = None
    arch: str | None = None
    weights: Path | None = None
    settings: Sequence[str] = ()

    def apply(self, given: dict[str, Any]) -> None:
        """Change what a file gave.

        Raises:
            ConfigError: A setting is not NAME=VALUE, or lies within something that is no section.
        """
        named = {"data": self.data, "arch": self.arch, "weights": self.weights}
        given.update({name: value for name, value in named.items() if value is not None})
        for setting in self.settings:
            name, equals, text = setting.partition("=")
            if not equals:
                raise ConfigError(
                    expected="--set NAME=VALUE", found=f"'{setting}'", fix="write for example --set steps=5000"
                )
            section = given
            *outer, last = ("train", *name.split("."))
            for one in outer:
                section[one] = as_section(section.get(one), one)
                section = section[one]
            section[last] = parse_yaml(text, "a value as YAML has it after --set NAME=", f"'{setting}'", ConfigError)


def read_plan(path: Path) -> dict[str, Any]:
    """Read a plan; paths in it are relative to it, `$VARIABLES` and `~` are expanded.

    Raises:
        ConfigError: It cannot be read, or has a key that no plan has.
    """
    return take_plan(read_settings_file(path), path.parent, str(path))


def take_plan(
    given: Mapping[str, Any],
    folder: Path,
    where: str,
    *,
    keys: Sequence[str] = PLAN_KEYS,
    fix: str = "correct the file",
) -> dict[str, Any]:
    """Return a plan, or a part of one, with paths that hold anywhere.

    Args:
        given: As the file has it.
        folder: Paths are relative to it.
        where: It stands, for messages.
        keys: What it may have.
        fix: What to do about others, for messages.

    Raises:
        ConfigError: It has others.
    """
    unknown = sorted(map(str, given.keys() - set(keys)))
    if unknown:
        raise ConfigError(expected=f"{', '.join(keys)} in {where}", found=", ".join(unknown), fix=fix)
    plan = dict(given)
    for name in ("data", "weights"):
        if plan.get(name) is not None:
            shipped = name == "weights" and plan[name] in SHIPPED_MODELS
            plan[name] = plan[name] if shipped else resolve_path(str(plan[name]), folder)
    if str(plan.get("arch", "")).endswith(".cfg"):
        plan["arch"] = str(resolve_path(plan["arch"], folder))
    return plan


def make_plan(given: Mapping[str, Any], origin: str) -> RunPlan:
    """Make a plan of what was given.

    Args:
        given: By `PLAN_KEYS`; what is absent has its default.
        origin: Where it comes from, for messages.

    Raises:
        ConfigError: Without data, or with a train setting that does not exist or is out of bounds.
        ModelError: The weights are a shipped detector that is not installed.
    """
    if given.get("data") is None:
        raise ConfigError(
            expected="labelled pictures", found="none", fix="name a data set, or a --config that names one"
        )
    weights = given.get("weights")
    return RunPlan(
        data=Path(given["data"]),
        arch=str(given.get("arch") or _DEFAULT_ARCH),
        weights=None if weights is None else find_model(str(weights)),
        params=read_params(TrainParams, as_section(given.get("train"), "train"), origin, _ADVICE),
    )


def as_section(value: object, name: str) -> dict[str, Any]:
    """Return settings by name; a section that was left empty has none.

    Args:
        value: What stands in the section.
        name: Of the section, for messages.

    Raises:
        ConfigError: It holds something else.
    """
    if not isinstance(value, dict | None):
        raise ConfigError(
            expected=f"settings by name in `{name}`", found=repr(value), fix="write `name: value` lines below it"
        )
    return value or {}


def flat_settings(settings: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Return nested settings by dotted name.

    >>> flat_settings({"steps": 5, "augment": {"mosaic": 0.0}})
    {'steps': 5, 'augment.mosaic': 0.0}
    """
    flat: dict[str, Any] = {}
    for name, value in settings.items():
        flat |= flat_settings(value, f"{before}{name}.") if isinstance(value, dict) else {f"{before}{name}": value}
    return flat
