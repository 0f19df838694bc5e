"""`overview.html`: one page about all films of a batch, with links to their reports."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Final
from urllib.parse import quote

from markupsafe import Markup

from standoff import __version__
from standoff.core.durations import minutes_text
from standoff.core.hazards import GRAVENESS
from standoff.core.lengths import UNITS, LengthUnit, UnitName
from standoff.core.outputs import ASSISTANCE, OUTPUTS
from standoff.core.watched_shares import percent_text
from standoff.drawing.page_template import page_template
from standoff.files.whole import whole_file
from standoff.scale.result import FilmResult, Findings, Moment

_MOST_MOMENTS: Final = 30


@dataclass(frozen=True, slots=True)
class _Film:
    """A row of the page.

    Attributes:
        result: Of the film.
        report: The way from the page to its report; empty where it has none.
    """

    result: FilmResult
    report: str


def write_overview(results: Sequence[FilmResult], path: Path, unit: UnitName = "metres") -> None:
    """Write the page, whole or not at all.

    Args:
        results: Of all films.
        path: The file; links go out from its folder.
        unit: Of lengths.

    Raises:
        OutputError: The file cannot be written.
    """
    with whole_file(path) as partial:
        partial.write_text(render(results, path.parent.resolve(), UNITS[unit]), encoding="utf-8")


def render(results: Sequence[FilmResult], folder: Path, unit: LengthUnit) -> str:
    """Return the page for a folder."""
    words = {"percent": percent_text, "hours": _hours, "clock": minutes_text, "length": unit.length}
    template = page_template("standoff.scale", "overview.html.j2", **words)
    films = [_Film(one, _report(one, folder)) for one in results]
    found = [one.found for one in results if one.found is not None]
    hazards: Counter[str] = Counter()
    for one in found:
        hazards.update(one.hazards)
    return template.render(
        version=__version__,
        written_at=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        css=Markup((files("standoff.stages.sinks") / "report.css").read_text(encoding="utf-8")),
        films=films,
        failed=[one for one in results if one.found is None],
        watched_s=sum(one.watched_s for one in found if math.isfinite(one.watched_s)),
        timeless=sum(not math.isfinite(one.watched_s) for one in found),
        mapped_share=_mean((one.mapped_share, one.watched_s) for one in found),
        ground_share=_mean((one.ground_share, one.watched_s) for one in found),
        hazards=hazards,
        severities=GRAVENESS[::-1],
        alarms=sum(one.alarms for one in found),
        worker_hours=sum(one.worker_hours for one in found),
        moments=_worst(films),
        assistance=ASSISTANCE,
    )


def _mean(shares_and_times: Iterable[tuple[float, float]]) -> float:
    """Return the mean of shares, each as long as its film is; NaN where none is known."""
    known = [(share, time_s) for share, time_s in shares_and_times if math.isfinite(share) and math.isfinite(time_s)]
    total_s = sum(time_s for _, time_s in known)
    return sum(share * time_s for share, time_s in known) / total_s if total_s else math.nan


def _worst(films: Sequence[_Film]) -> list[tuple[Moment, _Film]]:
    """Return the gravest moments of all films: danger first, then by how near it was."""
    moments = [(moment, film) for film in films for moment in _moments(film.result.found)]
    return sorted(moments, key=lambda row: row[0].rank())[:_MOST_MOMENTS]


def _moments(found: Findings | None) -> tuple[Moment, ...]:
    return () if found is None else found.worst


def _report(one: FilmResult, folder: Path) -> str:
    report = one.folder / OUTPUTS["report"]
    if one.found is None or not report.is_file():
        return ""
    return quote(report.relative_to(folder).as_posix()) if report.is_relative_to(folder) else report.as_uri()


def _hours(time_s: float) -> str:
    if math.isnan(time_s):
        return "unknown"
    return f"{time_s / 3600.0:.1f} h" if time_s >= 3600.0 else f"{time_s / 60.0:.1f} min"
