"""`standoff batch`: many films, side by side, on this machine or on many."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from standoff.scale import FilmPlan, FilmResult


def batch(
    films: Annotated[
        list[Path], typer.Argument(help="Video files, or folders of such.", show_default=False, metavar="FILMS...")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder: a folder in it for each film.", show_default=False)],
    config: Annotated[Path | None, typer.Option(help="Settings of all of them, YAML.")] = None,
    model: Annotated[str | None, typer.Option(help="Detector: site (ours, the default), or an ONNX file.")] = None,
    address: Annotated[
        str | None, typer.Option(help="Of a Ray cluster whose machines see the same files: ray://HOST[:PORT].")
    ] = None,
    cores_per_film: Annotated[int, typer.Option(min=1, help="Cores that one film may keep busy.")] = 2,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Watch films again that were watched with other settings.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was found in the films as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Monitor many films; what is finished is skipped, what fails is named, and the others go on."""
    from standoff.cli.console import write_json
    from standoff.cli.run import detector_overrides
    from standoff.config import load_settings
    from standoff.files.whole import make_folder
    from standoff.scale import find_films, plan_films, write_moments, write_overview, write_tables

    settings = load_settings(config, detector_overrides(model, None))
    plans = plan_films(find_films(films), out, settings, overwrites=overwrite)
    make_folder(out)
    results = sorted(_watched(plans, address, cores_per_film, quiet=quiet), key=lambda one: one.film.name)
    write_tables(results, out)
    write_moments(results, out / "moments.geojson", settings)
    write_overview(results, out / "overview.html", settings.show.unit)
    if as_json:
        write_json([result.to_dict() for result in results], Path("-"))
    elif not quiet:
        _tell(results, out / "overview.html")
    raise typer.Exit(int(any(result.status != "complete" for result in results)))


def _watched(plans: Sequence[FilmPlan], address: str | None, cores_per_film: int, *, quiet: bool) -> list[FilmResult]:
    """Watch the films with a progress bar; a film that fails is told at once."""
    from standoff.cli.console import progress
    from standoff.scale import watch_films

    # A request to terminate ends all processes, as Ctrl-C does.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    results: list[FilmResult] = []
    try:
        with progress("watching", len(plans), quiet=quiet, unit="films") as on_film:
            for result in watch_films(plans, address, cores_per_film=cores_per_film):
                results.append(result)
                if result.status != "complete":
                    typer.echo(f"standoff: {result.film.name}: {result.message}", err=True)
                on_film()
    except KeyboardInterrupt:
        words = f"{len(results)} of {len(plans)} films are done; the same command goes on with the others."
        typer.echo(f"standoff: interrupted; {words}", err=True)
        raise typer.Exit(1) from None
    return results


def _tell(results: Sequence[FilmResult], overview: Path) -> None:
    from standoff.cli.console import print_table
    from standoff.core.hazards import GRAVENESS

    rows = [(one.film.name, one.status if one.is_new else "finished before", *_numbers(one)) for one in results]
    print_table(str(overview), ("film", "", *GRAVENESS[::-1]), rows, texts=2)


def _numbers(one: FilmResult) -> tuple[str, ...]:
    """Return how many hazards of each severity there were, the gravest first; unknown where the film failed."""
    from standoff.core.hazards import GRAVENESS

    hazards = None if one.found is None else one.found.hazards
    return tuple("unknown" if hazards is None else str(hazards.get(severity, 0)) for severity in GRAVENESS[::-1])
