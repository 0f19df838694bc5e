"""Charts for our pages: figures in one style, as inline SVG that follows the page's light or dark colours."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.axis import Axis
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import AutoLocator, ScalarFormatter

from standoff.core.lengths import LengthUnit

INK, MUTED, SURFACE = "#010203", "#040506", "#070809"
"""Stand-ins for the page's colours of text, of what matters less and of its surface, which `inline_svg` puts in."""

_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9.0,
    "text.color": INK,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.facecolor": "none",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "grid.color": MUTED,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.6,
    "figure.facecolor": "none",
    "svg.hashsalt": "standoff",
}


class _RoundIn(AutoLocator):
    """Ticks of an axis in metres where another unit has round numbers."""

    def __init__(self, unit: LengthUnit) -> None:
        super().__init__()
        self._in_m = unit.in_m

    def tick_values(self, vmin: float, vmax: float) -> list[float]:
        """Return their places."""
        return [value * self._in_m for value in super().tick_values(vmin / self._in_m, vmax / self._in_m)]


class _WrittenIn(ScalarFormatter):
    """Numbers of an axis in metres, in another unit."""

    def __init__(self, unit: LengthUnit) -> None:
        super().__init__(useOffset=False)
        self._in_m = unit.in_m

    def set_locs(self, locs: list[float]) -> None:
        """Take all places that are going to be written at."""
        super().set_locs([place / self._in_m for place in locs])

    def __call__(self, x: float, pos: int | None = None) -> str:
        return super().__call__(x / self._in_m, pos)


def read_in(axis: Axis, unit: LengthUnit, what: str) -> None:
    """Let an axis whose data are in metres be read in a unit; what is drawn on it stays in metres."""
    axis.set_major_locator(_RoundIn(unit))
    axis.set_major_formatter(_WrittenIn(unit))
    axis.set_label_text(f"{what}, {unit.symbol}")


@contextmanager
def themed_figure(width_in: float, height_in: float) -> Iterator[Figure]:
    """Give a figure in the report's style; draw on it and call `inline_svg` before leaving."""
    with mpl.rc_context(_STYLE):
        yield Figure(figsize=(width_in, height_in), layout="constrained")


def inline_svg(figure: Figure) -> str:
    """Return the figure as an SVG element without prolog, links or fixed size, in the page's colours."""
    text = io.StringIO()
    # `figure.savefig` gives the same, and draws everything twice
    FigureCanvasSVG(figure).print_svg(text, metadata={"Date": None})  # type: ignore[no-untyped-call]
    svg = re.sub(r"<metadata>.*?</metadata>", "", text.getvalue(), flags=re.DOTALL)
    head, body = svg[svg.index("<svg") :].split(">", 1)
    svg = re.sub(r' (width|height|xmlns:xlink)="[^"]*"', "", head) + ">" + body.replace("xlink:href", "href")
    for stand_in, name in ((INK, "--ink"), (MUTED, "--muted"), (SURFACE, "--surface")):
        svg = svg.replace(stand_in, f"var({name})")
    return svg
