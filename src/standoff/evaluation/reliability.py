"""How true stated errors are, as a figure and a table for reports: stated probability against observed share."""

from __future__ import annotations

import math
from collections.abc import Sequence

from markupsafe import Markup

from standoff.drawing.page_charts import MUTED, inline_svg, themed_figure
from standoff.drawing.page_template import page_template
from standoff.drawing.palette import HEX
from standoff.evaluation.paper.metrics import DistanceScore
from standoff.evaluation.stated_errors import ONE_SIGMA, PROBABILITIES, Coverage

Measured = tuple[str, DistanceScore, Coverage]
"""A kind of pair, its errors, and how true the stated ones are."""

_COLOURS = tuple(HEX[tone] for tone in ("worker", "warning", "machine", "danger", "reference", "unknown"))


def reliability_section(kinds: Sequence[Measured], checked_on: str) -> Markup:
    """Return the section of a report about the errors that a run states, where truth is known.

    Args:
        kinds: Each kind of pair.
        checked_on: What the truth is of, in a few words.
    """
    template = page_template("standoff.evaluation", "reliability.html.j2")
    rows = [
        {
            "name": kind.replace("_", " "),
            "measured": f"{score.measured} of {score.frames}",
            "figures": [_number(value, unit) for value, unit in _figures(score, coverage)],
            "colour": _colour(place),
        }
        for place, (kind, score, coverage) in enumerate(kinds)
    ]
    return Markup(template.render(rows=rows, chart=Markup(reliability_chart(kinds)), checked_on=checked_on))


def reliability_chart(kinds: Sequence[Measured]) -> str:
    """Draw how often the truth lies within intervals of each stated probability; below the diagonal: too rarely.

    Args:
        kinds: Each kind of pair; those of which nothing was measured have no curve.
    """
    with themed_figure(4.6, 4.2) as figure:
        axes = figure.add_subplot()
        axes.plot([0, 100], [0, 100], color=MUTED, linewidth=1.0, linestyle=(0, (5, 3)))
        for probability in (ONE_SIGMA, 0.95):
            axes.axvline(100 * probability, color=MUTED, linewidth=0.6, alpha=0.5)
        stated = [0.0, *(100 * probability for probability in PROBABILITIES)]
        for place, (_, _, coverage) in enumerate(kinds):
            observed = [0.0, *(100 * share for share in coverage.observed)]
            axes.plot(stated, observed, color=_colour(place), linewidth=1.8, marker=".", markersize=5)
        axes.set_xlim(0, 100)
        axes.set_ylim(0, 101)
        axes.set_xlabel("probability that the stated error gives an interval, %")
        axes.set_ylabel("distances whose truth is in it, %")
        axes.set_aspect("equal")
        axes.grid(True)
        return inline_svg(figure)


def _colour(place: int) -> str:
    return _COLOURS[place % len(_COLOURS)]


def _figures(score: DistanceScore, coverage: Coverage) -> list[tuple[float, str]]:
    shares = ((100 * share, "%") for share in (coverage.inside_68, coverage.inside_95))
    return [(score.made_m, "m"), (score.median_m, "m"), *shares, (coverage.sigma_m, "m")]


def _number(value: float, unit: str) -> str:
    return f"{value:.{0 if unit == '%' else 2}f} {unit}" if math.isfinite(value) else "none"
