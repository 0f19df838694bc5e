"""`standoff train --sweep`: scenarios one after another, and their table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from standoff.cli.console import print_table, progress_bar
from standoff.cli.train_progress import show_run

if TYPE_CHECKING:
    from standoff.training.run.train import Listener
    from standoff.training.sweep.results import Cell, Result
    from standoff.training.sweep.scenarios import Sweep


def train_sweep(sweep: Sweep, out: Path, *, resumes: bool, quiet: bool) -> None:
    """Train all scenarios and print their table; leave with exit code 1 where one failed."""
    from standoff.training.run.distributed import Crew
    from standoff.training.sweep.sweep import SweepListener, run_sweep

    leads = Crew.join().leads
    places = {name: place for place, name in enumerate(sweep.scenarios, start=1)}
    with progress_bar(quiet=quiet or not leads, unit="steps") as bar:

        def on_message(line: str) -> None:
            bar.console.print(line, highlight=False, soft_wrap=True, markup=False)

        def on_scenario(name: str) -> Listener:
            return show_run(bar, sweep.scenarios[name].params.steps, f"{name} ({places[name]} of {len(places)})")

        results = run_sweep(sweep, out, SweepListener(on_message, on_scenario), resumes=resumes)
    if not leads:
        return
    _print_results(results)
    typer.echo(f"look at {out}/sweep.md and sweep.png, and at model-card.md in the folder of each scenario")
    if any(result.state == "failed" for result in results):
        raise typer.Exit(1)


def _print_results(results: Sequence[Result]) -> None:
    """Print figures and words as two tables: no terminal is wide enough for both."""
    from standoff.training.sweep.results import WORDS, table_of

    table = table_of(results)
    words = table.only(("scenario", *WORDS))
    print_table("Scenarios", words.columns, map(_marked, words.rows), texts=len(words.columns))
    figures = table.only([column for column in table.columns if column not in WORDS])
    caption = "11-point AP at the step with the best mAP, per cent; the best bold."
    print_table("On validation pictures", figures.columns, map(_marked, figures.rows), caption)


def _marked(row: Sequence[Cell]) -> list[str]:
    from rich.markup import escape

    return [f"[bold]{escape(cell.text)}[/bold]" if cell.is_best else escape(cell.text) for cell in row]
