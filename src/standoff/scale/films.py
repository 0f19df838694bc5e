"""From what somebody typed to one plan for each film."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from standoff.config import Settings, named_files
from standoff.core.errors import ConfigError
from standoff.files.fingerprint import digests
from standoff.scale.film import FilmPlan

FILM_SUFFIXES: Final = (".mp4", ".mov", ".mkv", ".avi", ".m4v", ".ts", ".mts", ".m2ts", ".webm", ".mpg", ".mpeg")
"""What is taken for a film where a folder is named; a film that is named itself may be called anything."""


def find_films(named: Iterable[Path]) -> list[Path]:
    """Return the films that are named, and those in folders that are named, these in the order of their names.

    Raises:
        ConfigError: Something named is not there, or a folder has no film in it.
    """
    films: list[Path] = []
    for path in named:
        if path.is_dir():
            inside = sorted(one for one in path.iterdir() if one.suffix.lower() in FILM_SUFFIXES and one.is_file())
            if not inside:
                raise ConfigError(
                    expected=f"films in {path}",
                    found="none",
                    fix=f"name the films, or a folder of {', '.join(FILM_SUFFIXES)}",
                )
            films += inside
        elif path.is_file():
            films.append(path)
        else:
            raise ConfigError(expected=f"a film at {path}", found="nothing", fix="check the name")
    return films


def plan_films(films: Sequence[Path], out: Path, settings: Settings, *, overwrites: bool = False) -> list[FilmPlan]:
    """Return a plan for each film; its run goes into a folder of the film's name.

    Args:
        films: As `find_films` returns them.
        out: Folder of all runs.
        settings: Of each run.
        overwrites: Replace complete runs of other settings.

    Raises:
        ConfigError: Two films have one name, a file that the settings name is missing, or a folder holds a complete run
            of other settings, which is not to be replaced.
    """
    named = named_files(settings)
    missing = next((name for name, path in named.items() if not path.is_file()), None)
    if missing is not None:
        raise ConfigError(
            expected=f"the file of the setting `{missing}`", found=f"nothing at {named[missing]}", fix="check its name"
        )
    files = digests(named)
    plans: dict[str, FilmPlan] = {}
    for film in films:
        name = film.stem
        if name in plans:
            raise ConfigError(
                expected="films with names of their own, which their folders get",
                found=f"{plans[name].film} and {film.resolve()}",
                fix="rename one, or watch them in two batches",
            )
        plans[name] = FilmPlan(film.resolve(), (out / name).resolve(), settings, files, overwrites)
    for plan in plans.values():
        plan.refuse_other_run()
    return list(plans.values())
