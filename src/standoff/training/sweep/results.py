"""How scenarios went, and the table that says so."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

from standoff.training.sweep.scenarios import words_of

State = Literal["finished", "unfinished", "failed"]

_AP: Final = "ap_"
"""Before the name of a class, in a run's history."""
_NO_FIGURE: Final = "-"
WORDS: Final = ("differs in", "outcome")
"""Columns of whole sentences."""


@dataclass(frozen=True, slots=True)
class Result:
    """How far a scenario is, and how good.

    Attributes:
        scenario: Its name.
        differences: From the shared plan; see `Sweep.differences`.
        state: Whether it ended, and well.
        minutes: That it took, of all attempts together.
        reason: For which it failed; empty otherwise.
        history: Of its run, a row for each validation: see `Progress.rows`.
    """

    scenario: str
    differences: Mapping[str, Any]
    state: State = "unfinished"
    minutes: float = 0.0
    reason: str = ""
    history: Sequence[Mapping[str, Any]] = ()

    @property
    def best(self) -> Mapping[str, Any]:
        """Row of the history with the best mAP, whose weights were kept; empty before the first validation."""
        known = [row for row in self.history if row["map"] is not None]
        return max(known, key=lambda row: float(row["map"]), default={})

    @property
    def outcome(self) -> str:
        """State in words, with the reason."""
        if self.state == "failed":
            return f"failed: {self.reason}"
        return "not finished" if self.state == "unfinished" else "finished"

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as `sweep.json` holds them: shares, not per cent."""
        best = self.best
        return {
            "scenario": self.scenario,
            "differences": self.differences,
            "state": self.state,
            "reason": self.reason,
            "minutes": self.minutes,
            "best_step": best.get("step"),
            "ap": {name.removeprefix(_AP): value for name, value in best.items() if name.startswith(_AP)},
            "map": best.get("map"),
            "average_iou": best.get("average_iou"),
        }


@dataclass(frozen=True, slots=True)
class Cell:
    """What stands in a table.

    Attributes:
        text: As people read it.
        is_best: The highest figure of its column.
    """

    text: str
    is_best: bool = False


@dataclass(frozen=True, slots=True)
class ScenarioTable:
    """Scenarios side by side.

    Attributes:
        columns: Headings.
        rows: As many cells each.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]

    def only(self, columns: Sequence[str]) -> ScenarioTable:
        """Return the table with these columns, as far as it has them."""
        kept = [index for index, column in enumerate(self.columns) if column in columns]
        rows = tuple(tuple(row[index] for index in kept) for row in self.rows)
        return ScenarioTable(tuple(self.columns[index] for index in kept), rows)

    def to_markdown(self) -> str:
        """Return it as Markdown, the best figures bold."""
        lines = [self.columns, *(tuple(map(_markdown_cell, row)) for row in self.rows)]
        heading, *rows = (f"| {' | '.join(line)} |\n" for line in lines)
        return heading + "|---" * len(self.columns) + "|\n" + "".join(rows)


def table_of(results: Sequence[Result]) -> ScenarioTable:
    """Return in what scenarios differ, and their accuracy at their best step as the paper's Table 2 has it, per cent.

    The outcome is a column only where a scenario did not finish.

    >>> row = {"step": 500, "ap_worker": 0.5, "map": 0.5, "average_iou": 0.75}
    >>> slow = Result("slow", {"train": {"learning_rate": 0.0001}}, "finished", 12.0, history=[row])
    >>> print(table_of([slow]).to_markdown())  # doctest: +NORMALIZE_WHITESPACE
    | scenario | differs in | best step | worker AP | mAP | average IoU | minutes |
    |---|---|---|---|---|---|---|
    | slow | learning_rate 0.0001 | 500 | **50.00** | **50.00** | **75.00** | 12.0 |
    """
    figures = [name for name in max((result.best for result in results), key=len) if name.startswith(_AP)]
    figures += ["map", "average_iou"]
    highest = {name: max((_number(result, name) for result in results), default=math.nan) for name in figures}
    tells = any(result.state != "finished" for result in results)
    headings = {"map": "mAP", "average_iou": "average IoU"}
    names = [headings.get(name, f"{name.removeprefix(_AP)} AP") for name in figures]
    rows = []
    for result in results:
        cells = [Cell(result.scenario), Cell(words_of(result.differences))]
        cells.append(Cell(str(result.best.get("step", _NO_FIGURE))))
        cells += [_figure_cell(_number(result, name), highest[name]) for name in figures]
        cells.append(Cell(f"{result.minutes:.1f}"))
        rows.append((*cells, *([Cell(result.outcome)] if tells else [])))
    differs, outcome = WORDS
    columns = ("scenario", differs, "best step", *names, "minutes", *([outcome] if tells else []))
    return ScenarioTable(columns, tuple(rows))


def _number(result: Result, name: str) -> float:
    """Return a figure; minus infinity where there is none: for a class without truths, or before any validation."""
    value = result.best.get(name)
    return -math.inf if value is None else float(value)


def _figure_cell(value: float, highest: float) -> Cell:
    return Cell(f"{100 * value:.2f}", value == highest) if math.isfinite(value) else Cell(_NO_FIGURE)


def _markdown_cell(cell: Cell) -> str:
    text = cell.text.replace("|", "\\|")
    return f"**{text}**" if cell.is_best else text
