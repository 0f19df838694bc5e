"""Scenarios trained one after another."""

from __future__ import annotations

import gc
import logging
import shutil
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from time import monotonic
from typing import Any

from standoff.core.errors import StandoffError
from standoff.files.whole import make_folder
from standoff.labels import LabelledData
from standoff.training.run.checkpoint import has_checkpoint
from standoff.training.run.data_checks import open_data, report_near_duplicates
from standoff.training.run.distributed import Crew
from standoff.training.run.memory import is_out_of_memory
from standoff.training.run.train import Listener, compose_start, train_on
from standoff.training.run.training_folder import CHECKPOINTS, refuse_used
from standoff.training.sweep.results import Result, State
from standoff.training.sweep.scenarios import Sweep
from standoff.training.sweep.sweep_folder import SweepFolder

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class SweepListener:
    """Who hears of a sweep.

    Attributes:
        on_message: What people should know of the data, or of scenarios that do not run, line by line.
        on_scenario: When a scenario begins or goes on, by its name: returns who hears of its run.
    """

    on_message: Callable[[str], None]
    on_scenario: Callable[[str], Listener]


def run_sweep(sweep: Sweep, out: Path, listener: SweepListener, *, resumes: bool = False) -> tuple[Result, ...]:
    """Train every scenario in a folder of its own, and write a table of all after each of their validations.

    Everything that can be known to be wrong is told before anything is written. What goes wrong with a scenario later
    is in the table, and the others run; among several processes, which would no longer agree, it ends the sweep.

    Args:
        sweep: What to do.
        out: Folder of the sweep.
        listener: Hears of it.
        resumes: Go on with the sweep in the folder: pass over what finished, go on with what has a checkpoint, and
            begin the rest.

    Returns:
        How it went, by scenario in the order of the sweep.

    Raises:
        DataError, ConfigError, ModelError, OutputError: A plan does not fit the data, or the folder is of no use.
    """
    crew, folder = Crew.join(), SweepFolder(out)
    if crew.leads and resumes:
        folder.require_same(sweep)
    elif crew.leads:
        refuse_used(out)
    board = _Board(folder, sweep, crew)
    # What is on the disk changes as soon as the leader goes on: it looks, and tells the others.
    waiting = [name for name in sweep.scenarios if not crew.agree(board.is_finished(name))]
    begun = [name for name in waiting if crew.agree(board.is_begun(name))]
    data = _checked_data(sweep, [name for name in waiting if name not in begun], listener, leads=crew.leads)
    if crew.leads:
        make_folder(out)
        folder.write_plan(sweep)
    for name in sweep.scenarios:
        if name in waiting:
            _run_scenario(name, data, board, listener.on_scenario(name), resumes=name in begun)
        elif crew.leads:
            listener.on_message(f"{name} is finished: passed over")
    return board.results


class _Board:
    """How the scenarios of a sweep went so far, in the folder as well."""

    def __init__(self, folder: SweepFolder, sweep: Sweep, crew: Crew) -> None:
        self.folder, self.sweep = folder, sweep
        self._leads = crew.leads
        self._results = folder.read_results(sweep) if crew.leads else {}
        for name in sweep.scenarios if crew.leads else ():
            if name not in self._results:
                refuse_used(folder.path / name)

    @property
    def results(self) -> tuple[Result, ...]:
        """Of the scenarios that began, in the order of the sweep."""
        return tuple(self._results[name] for name in self.sweep.scenarios if name in self._results)

    def is_finished(self, name: str) -> bool:
        known = self._results.get(name)
        return known is not None and known.state == "finished" and (self.folder.path / name / "model.onnx").is_file()

    def is_begun(self, name: str) -> bool:
        return name in self._results and has_checkpoint(self.folder.path / name / CHECKPOINTS)

    def clear(self, name: str) -> None:
        """Remove what a scenario left that has no checkpoint to go on from: it begins anew."""
        if self._leads and name in self._results:
            shutil.rmtree(self.folder.path / name, ignore_errors=True)

    def minutes(self, name: str) -> float:
        return self._results[name].minutes if name in self._results else 0.0

    def note(self, name: str, state: State, minutes: float, reason: str = "") -> None:
        if not self._leads:
            return
        history = self.folder.read_history(name)
        self._results[name] = Result(name, self.sweep.differences(name), state, minutes, reason, history)
        self.folder.write_results(self.results)


def _checked_data(sweep: Sweep, fresh: list[str], listener: SweepListener, *, leads: bool) -> LabelledData:
    """Read the data, and see that every scenario can begin."""
    uses = [plan.params for plan in sweep.scenarios.values()]
    data = open_data(sweep.shared.data, uses, listener.on_message if leads else None)
    for name in fresh:
        with _naming(name):
            compose_start(sweep.scenarios[name], data)
    if leads and fresh:
        report_near_duplicates(data, listener.on_message)
    return data


@contextmanager
def _naming(name: str) -> Generator[None, None, None]:
    try:
        yield
    except StandoffError as error:
        raise type(error)(expected=error.expected, found=f"{error.found} in scenario {name}", fix=error.fix) from error


def _run_scenario(name: str, data: LabelledData, board: _Board, listener: Listener, *, resumes: bool) -> None:
    if not resumes:
        board.clear(name)
    before, started_s = board.minutes(name), monotonic()

    def note(state: State, reason: str = "") -> None:
        board.note(name, state, before + (monotonic() - started_s) / 60.0, reason)

    def on_row(row: Mapping[str, Any]) -> None:
        listener.on_row(dict(row))
        note("unfinished")

    note("unfinished")
    plan, out = board.sweep.scenarios[name], board.folder.path / name
    try:
        train_on(data, plan, out, replace(listener, on_row=on_row), resumes=resumes)
    # torch raises RuntimeError for what fails in its kernels and in its loaders, memory among it. ValueError comes of
    # boxes that are no numbers, where a network diverged just before it was validated.
    except (StandoffError, MemoryError, RuntimeError, ValueError) as error:
        if Crew.join().size > 1:
            raise
        if not (isinstance(error, StandoffError) or is_out_of_memory(error)):
            _log.exception("scenario %s", name)
        reason = " ".join(str(error).split()) or type(error).__name__
        note("failed", reason)
        listener.on_message(f"failed: {reason}")
    else:
        note("finished")
        return
    # The frames of a caught error, and through them the network, hold each other: the next scenario needs the memory.
    gc.collect()
