"""A progress bar that says a line a minute where there is no terminal to draw it on."""

from __future__ import annotations

import sys
from time import monotonic
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

EVERY_S = 60.0
_TELLING = 10
"""Steps before which a rate says nothing: the first one loads and compiles what the others need."""


class SpokenProgress(Progress):
    """Rate, share and time left, on standard error.

    Args:
        unit: What is counted.
        quiet: Neither bar nor lines.
    """

    def __init__(self, unit: str, *, quiet: bool) -> None:
        self._speaks = not quiet and not sys.stderr.isatty()
        self._unit, self._spoke_s = unit, monotonic()
        super().__init__(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn(unit + "  {task.fields[rate]:.1f} a second"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            disable=quiet or self._speaks,
        )

    def update(self, task_id: TaskID, **changes: Any) -> None:  # noqa: ANN401 - as rich has it
        """Take note of what has changed, as `rich.progress.Progress.update`."""
        super().update(task_id, **changes)
        if self._speaks and monotonic() - self._spoke_s >= EVERY_S:
            self._spoke_s = monotonic()
            self.console.print(self._line(task_id), highlight=False, soft_wrap=True)

    def _line(self, task_id: TaskID) -> str:
        task = self._tasks[task_id]
        rate = float(task.fields["rate"])
        if task.total is None:
            return f"{task.description}: {task.completed:.0f} {self._unit}, {rate:.2g} a second"
        line = f"{task.description}: {task.completed:.0f} of {task.total:.0f} {self._unit}"
        if not rate > 0.0 or task.completed < _TELLING:
            return line
        left_min = round((task.total - task.completed) / rate / 60.0)
        return f"{line}, {rate:.2g} a second, {left_min // 60} h {left_min % 60} min left"
