"""`standoff batch`: many films, side by side, on this machine or on many."""

from __future__ import annotations

import math
import signal
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Self

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from standoff.scale import FilmPart, FilmPlan, FilmResult


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
    part_minutes: Annotated[
        float,
        typer.Option(min=0.0, help="Long films are looked at in parts of about this length, side by side; 0: never."),
    ] = 10.0,
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
    results = sorted(_watched(plans, address, cores_per_film, part_minutes, quiet=quiet), key=lambda one: one.film.name)
    write_tables(results, out)
    write_moments(results, out / "moments.geojson", settings)
    write_overview(results, out / "overview.html", settings.show.unit)
    if as_json:
        write_json([result.to_dict() for result in results], Path("-"))
    elif not quiet:
        _tell(results, out / "overview.html")
    raise typer.Exit(int(any(result.status != "complete" for result in results)))


def _watched(
    plans: Sequence[FilmPlan], address: str | None, cores_per_film: int, part_minutes: float, *, quiet: bool
) -> list[FilmResult]:
    """Watch the films with a progress bar; a film that fails is told at once."""
    from standoff.scale import watch_films

    # A request to terminate ends all processes, as Ctrl-C does.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    results: list[FilmResult] = []
    part_s = 60.0 * part_minutes or math.inf
    try:
        with _Steps(len(plans), quiet=quiet) as steps:
            for result in watch_films(
                plans, address, cores_per_film=cores_per_film, part_s=part_s, on_part=steps.take_part
            ):
                results.append(result)
                if result.status != "complete":
                    typer.echo(f"standoff: {result.film.name}: {result.message}", err=True)
                steps.take()
    except KeyboardInterrupt:
        words = f"{len(results)} of {len(plans)} films are done; the same command goes on with the others."
        typer.echo(f"standoff: interrupted; {words}", err=True)
        raise typer.Exit(1) from None
    return results


class _Steps:
    """A progress bar of films and of the parts of long ones, of which nobody knows how many there are before they come.

    Args:
        films: How many there are.
        quiet: No progress bar.
    """

    def __init__(self, films: int, *, quiet: bool) -> None:
        from standoff.cli.console import progress_bar

        self._bar = progress_bar(quiet=quiet, unit="films and parts")
        self._total, self._done, self._begun_s = films, 0, monotonic()
        self._divided = set[Path]()
        self._task = self._bar.add_task("watching", total=films, rate=0.0)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def take(self) -> None:
        """Take that one is done."""
        self._done += 1
        rate = self._done / (monotonic() - self._begun_s)
        self._bar.update(self._task, completed=self._done, total=self._total, rate=rate)

    def take_part(self, part: FilmPart) -> None:
        """Take that a part of a film is done, which with all others comes before the film."""
        if part.plan.out not in self._divided:
            self._divided.add(part.plan.out)
            self._total += part.count
        self.take()


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
