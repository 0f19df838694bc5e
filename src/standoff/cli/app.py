"""Put the verbs together and turn errors into one line and an exit code."""

from __future__ import annotations

import logging
import sys
from importlib.metadata import entry_points
from typing import Annotated

import typer

from standoff import __version__
from standoff.cli import (
    batch,
    bench,
    blend,
    calibrate,
    config,
    demo,
    doctor,
    evaluate,
    export,
    join,
    label,
    live,
    marker,
    page,
    quantize,
    run,
    schema,
    simulator,
    train,
    train_points,
)
from standoff.core.errors import StandoffError

app = typer.Typer(
    name="standoff",
    help="Measure how close workers are to machines in a drone's video, in metres, and warn before somebody is struck.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("run")(run.run)
app.command("batch")(batch.batch)
app.command("train")(train.train)
app.command("train-points")(train_points.train_points)
app.command("blend")(blend.blend)
app.command("join")(join.join)
app.command("export")(export.export)
app.command("quantize")(quantize.quantize)
app.command("label")(label.label)
app.command("calibrate")(calibrate.calibrate)
app.command("marker")(marker.marker)
app.add_typer(evaluate.app, name="evaluate")
app.add_typer(config.app, name="config")
app.command("demo")(demo.demo)
app.command("bench")(bench.bench)
app.command("doctor")(doctor.doctor)
app.command("schema")(schema.schema)
app.command("setup")(page.setup)
app.command("open")(page.open_run)
app.command("serve")(live.serve)
app.command("reload")(live.reload)
app.command("wearable")(live.wearable)
app.command("latency")(live.latency)
app.command("shelve")(live.shelve)


def _join_verbs() -> None:
    """Add the verbs that other distributions bring: `simulate` comes from the simulator."""
    brought = {point.name: point for point in entry_points(group="standoff.verbs")}
    for name, point in brought.items():
        app.add_typer(point.load(), name=name)
    if "simulate" not in brought:
        anything = {"allow_extra_args": True, "ignore_unknown_options": True}
        app.command("simulate", context_settings=anything)(simulator.absent)


_join_verbs()


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"standoff {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    # What matplotlib and others have to say of themselves is not for whoever runs standoff.
    logging.basicConfig(level=logging.ERROR, format="standoff: %(message)s")
    logging.getLogger("standoff").setLevel(logging.WARNING)


def main() -> None:
    """Run the command line and exit."""
    try:
        app(prog_name="standoff")
    except StandoffError as error:
        typer.echo(f"standoff: {error}", err=True)
        sys.exit(2)
    except OSError as error:
        # A full disk or a lost share, wherever it strikes: one line, and never the whole stack.
        where = f" ({error.filename})" if error.filename else ""
        typer.echo(f"standoff: {error.strerror or error}{where}", err=True)
        sys.exit(1)
