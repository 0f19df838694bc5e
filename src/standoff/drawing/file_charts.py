"""Charts for picture files: figures on white, in quiet colours."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

SERIES_COLOURS = ("#1f5f8b", "#c0562f", "#3a7d44", "#7a4fa3", "#b38600", "#2b8f8f", "#a33a5b", "#5b5b5b")
INK, QUIET, GRID = "#222222", "#6b6b6b", "#ececec"


def blank(width_in: float, height_in: float) -> Figure:
    """Return an empty figure."""
    return Figure(figsize=(width_in, height_in), dpi=150, layout="constrained", facecolor="white")


def colour_of(row: int) -> str:
    """Return the colour of a series; the ninth has that of the first."""
    return SERIES_COLOURS[row % len(SERIES_COLOURS)]


def tidy(axes: Axes) -> None:
    """Leave of the frame what is read: quiet axes below and left, a grid behind what is drawn."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(QUIET)
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, colors=QUIET)
    axes.xaxis.label.set_fontsize(8.5)
    axes.yaxis.label.set_fontsize(8.5)
