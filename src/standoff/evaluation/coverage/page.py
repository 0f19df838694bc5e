"""One self-contained page about how true the errors are that runs state."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path

from markupsafe import Markup

from standoff import __version__
from standoff.drawing.page_template import page_template
from standoff.evaluation.coverage.score import ALL, CoverageResult
from standoff.evaluation.reliability import reliability_section
from standoff.files.whole import make_folder, whole_file


def write_page(result: CoverageResult, path: Path) -> None:
    """Write the page, whole or not at all.

    Raises:
        OutputError: The file cannot be written.
    """
    make_folder(path.parent)
    with whole_file(path) as partial:
        partial.write_text(render(result), encoding="utf-8")


def render(result: CoverageResult) -> str:
    """Return the page."""
    words = {"metres": _metres, "percent": _percent, "words": lambda name: name.replace("_", " ")}
    template = page_template("standoff.evaluation.coverage", "page.html.j2", **words)
    checked_on = f"{result.clips} simulated clip" + "s" * (result.clips > 1)
    kinds = [(row.kind, row.score, row.coverage) for row in result.whole_kinds()]
    return template.render(
        version=__version__,
        written_at=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        css=Markup((files("standoff.stages.sinks") / "report.css").read_text("utf-8")),
        section=reliability_section(kinds, checked_on),
        bands=[row for row in result.pairs if row.by != ALL],
        result=result,
    )


def _metres(value: float) -> str:
    return f"{value:.2f} m" if math.isfinite(value) else "none"


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if math.isfinite(share) else "none"
