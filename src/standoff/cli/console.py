"""What all verbs print with: JSON for machines, tables and progress for people."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from rich.progress import Progress


def write_json(data: object, path: Path) -> None:
    """Write JSON to a file, whole or not at all, or to standard output where the path is `-`; NaN becomes null.

    Raises:
        OutputError: The file cannot be written.
    """
    from standoff.files.json_text import json_text
    from standoff.files.json_text import write_json as write_json_file

    if str(path) == "-":
        typer.echo(json_text(data), nl=False)
        return
    write_json_file(path, data)


def print_table(
    title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "", *, texts: int = 1
) -> None:
    """Print a table for people: the first `texts` columns to the left, numbers to the right."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, show_header=any(columns))
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index < texts else "right", overflow="fold")
    for row in rows:
        table.add_row(*row)
    console = Console(highlight=False)
    console.print(title, style="bold")
    console.print(table)
    if caption:
        console.print(caption)


@dataclass(frozen=True, slots=True)
class Table:
    """A table for people: the first `texts` columns are words, the others numbers."""

    title: str
    columns: tuple[str, ...]
    rows: list[tuple[str, ...]]
    caption: str = ""
    texts: int = 1

    def markdown(self) -> str:
        """Return the table as Markdown."""
        rule = ["---" if place < self.texts else "---:" for place in range(len(self.columns))]
        lines = [" | ".join(cells) for cells in (self.columns, rule, *self.rows)]
        return "\n".join([f"**{self.title}**", "", *(f"| {line} |" for line in lines), "", self.caption]).rstrip()


def print_tables(tables: Iterable[Table], *, as_markdown: bool) -> None:
    """Print those tables that have rows."""
    for table in tables:
        if not table.rows:
            continue
        if as_markdown:
            typer.echo(table.markdown() + "\n")
        else:
            print_table(table.title, table.columns, table.rows, table.caption, texts=table.texts)


def progress_bar(*, quiet: bool, unit: str = "frames") -> Progress:
    """Return a progress bar on standard error with rate and time left; a line a minute where that is no terminal."""
    from standoff.cli.spoken_progress import SpokenProgress

    return SpokenProgress(unit, quiet=quiet)


@contextmanager
def progress(
    what: str, total: int | None, *, quiet: bool = False, unit: str = "frames"
) -> Generator[Callable[[], None], None, None]:
    """Show the progress of one task of a known or unknown number of steps; give what is to be called after each."""
    with progress_bar(quiet=quiet, unit=unit) as bar:
        task = bar.add_task(what, total=total, rate=0.0)
        started_s = monotonic()
        done = 0

        def step() -> None:
            nonlocal done
            done += 1
            bar.update(task, completed=done, rate=done / (monotonic() - started_s))

        yield step
