"""The folder of a sweep: what it was told, and how its scenarios went so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from standoff import __version__
from standoff.core.errors import ConfigError
from standoff.files import json_text
from standoff.files.whole import whole_file
from standoff.files.yaml_text import write_yaml
from standoff.labels.documents import read_json
from standoff.training.run.plan import Overrides
from standoff.training.sweep.figure import draw_sweep
from standoff.training.sweep.results import Result, table_of
from standoff.training.sweep.scenarios import Sweep, differences_of, read_sweep, words_of


@dataclass(frozen=True, slots=True)
class SweepFolder:
    """Paths, readers and writers of one sweep.

    Attributes:
        path: The folder; that of a scenario's run is in it, under the scenario's name.
    """

    path: Path

    @property
    def plan(self) -> Path:
        """What repeats the sweep."""
        return self.path / "sweep.yaml"

    @property
    def record(self) -> Path:
        """How it went, for machines, and for going on with it."""
        return self.path / "sweep.json"

    def write_plan(self, sweep: Sweep) -> None:
        """Write `sweep.yaml`.

        Raises:
            OutputError: It cannot be written.
        """
        write_yaml(self.plan, sweep.to_dict())

    def write_results(self, results: Sequence[Result]) -> None:
        """Write the table as Markdown and as JSON, and the curves of what was validated.

        Raises:
            OutputError: They cannot be written.
        """
        with whole_file(self.path / "sweep.md") as path:
            path.write_text(table_of(results).to_markdown(), encoding="utf-8")
        if any(result.history for result in results):
            with whole_file(self.path / "sweep.png") as path:
                draw_sweep(results, path)
        # The last, and only after the others could be written: to go on, this is what counts.
        with whole_file(self.record) as path:
            json_text.write_json(path, {"standoff": __version__, "scenarios": [result.to_dict() for result in results]})

    def read_results(self, sweep: Sweep) -> dict[str, Result]:
        """Read how scenarios went so far, by name; absent are those that did not begin.

        Raises:
            DataError: The record is damaged.
        """
        known = self._recorded()
        return {
            name: Result(
                name, sweep.differences(name), known[name]["state"], known[name]["minutes"], known[name]["reason"],
                self.read_history(name),
            )
            for name in sweep.scenarios if name in known
        }  # fmt: skip

    def read_history(self, name: str) -> list[dict[str, Any]]:
        """Read the validations of a scenario's run, none before its first."""
        path = self.path / name / "history.json"
        rows: list[dict[str, Any]] = json_text.read_json(path, "a run's validations") if path.is_file() else []
        return rows

    def require_same(self, sweep: Sweep) -> None:
        """Refuse to go on with another sweep than the folder's.

        Scenarios may be added; those that failed may be changed. Data may have moved.

        Raises:
            ConfigError: There is no sweep in the folder, or it has a scenario that is absent or another one now.
            DataError: The record is damaged.
        """
        if not self.plan.is_file():
            raise ConfigError(
                expected=f"a sweep to go on with in {self.path}",
                found="no sweep.yaml",
                fix="start one without --resume, in a new or empty folder",
            )
        before, recorded = read_sweep(self.plan, Overrides()), self._recorded()
        for name, plan in before.scenarios.items():
            if recorded.get(name, {}).get("state") == "failed" and name in sweep.scenarios:
                continue
            if name not in sweep.scenarios:
                found = "none of this name"
            else:
                changes = differences_of(plan.to_dict(), sweep.scenarios[name].to_dict())
                changes.pop("data", None)
                if not changes:
                    continue
                found = words_of(changes)
            raise ConfigError(
                expected=f"scenario {name} as {self.plan} has it",
                found=found,
                fix="give the same scenarios (others may be added), or start a new sweep with another --out",
            )

    def _recorded(self) -> dict[str, dict[str, Any]]:
        if not self.record.is_file():
            return {}
        return {one["scenario"]: one for one in read_json(self.record)["scenarios"]}
