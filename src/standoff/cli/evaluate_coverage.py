"""`standoff evaluate coverage`: whether the errors that runs state are true, on clips whose truth is known."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from standoff.cli.scoring_arguments import JsonFile, RunsAndClips, pairs_of_folders


def coverage(
    folders: RunsAndClips,
    json_file: JsonFile = None,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print the tables in Markdown.")] = False,
    report: Annotated[
        Path | None, typer.Option(help="Also write one HTML page with tables and a reliability plot.")
    ] = None,
) -> None:
    """Compare a run's distances and their stated errors with truth: how often is the truth within 68 and 95 %?"""
    from standoff import __version__
    from standoff.cli.console import print_tables, progress, write_json
    from standoff.cli.coverage_tables import coverage_tables
    from standoff.evaluation.coverage import evaluate_coverage

    runs = pairs_of_folders(folders)
    with progress("reading", len(runs), unit="runs", quiet=len(runs) == 1) as on_run:
        result = evaluate_coverage(runs, on_run)
    if str(json_file) != "-":
        print_tables(coverage_tables(result), as_markdown=markdown)
    if json_file is not None:
        write_json({"standoff": __version__, **result.to_dict()}, json_file)
    if report is not None:
        from standoff.evaluation.coverage.page import write_page

        write_page(result, report)
