"""Pictures of a comparison: precision against recall, and accuracy against time."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from standoff.core.errors import OutputError
from standoff.core.homography import FloatArray
from standoff.evaluation.detection.comparison import Comparison
from standoff.evaluation.detection.score import PRECISION, ClassScore
from standoff.stages.sinks.whole import whole_file

SERIES_COLOURS = ("#1f5f8b", "#c0562f", "#3a7d44", "#7a4fa3", "#b38600", "#2b8f8f", "#a33a5b", "#5b5b5b")
INK, QUIET, GRID = "#222222", "#6b6b6b", "#ececec"
_PANEL_IN = (3.4, 3.3)
_MOST_COLUMNS = 4
_LEAST_WIDTH_IN = 5.0
_GOOD_AP = 0.4
"""Curves of better ones leave the lower left corner free, others the upper right."""
_LABEL_SHARE, _LABEL_LOG_WIDTH = 0.045, 0.9
"""Room for a label: share of the axis' height, and natural logarithm of the times that it spans."""


def write_figures(comparison: Comparison, folder: Path) -> tuple[Path, ...]:
    """Draw `precision_recall.png` and `accuracy_time.png`.

    Args:
        comparison: With truth of at least one class.
        folder: Is created.

    Returns:
        The files.

    Raises:
        OutputError: They cannot be written.
    """
    drawn = {
        "precision_recall.png": _draw_curves(comparison),
        "accuracy_time.png": _draw_accuracy_against_time(comparison),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        fix = "choose another folder or give write permission"
        found = error.strerror or str(error)
        raise OutputError(expected=f"to write figures to {folder}", found=found, fix=fix) from error
    for name, figure in drawn.items():
        with whole_file(folder / name) as path:
            figure.savefig(path, format="png")
    return tuple(folder / name for name in drawn)


def _draw_curves(comparison: Comparison) -> Figure:
    names = [one.name for one in comparison.results[0].score.classes if one.truths]
    columns = min(_MOST_COLUMNS, len(names))
    rows = math.ceil(len(names) / columns)
    figure = _blank(max(_PANEL_IN[0] * columns, _LEAST_WIDTH_IN), _PANEL_IN[1] * rows + 0.4)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, name in zip(panels, names, strict=False):
        _draw_class(axes, comparison, name)
    for axes in panels[len(names) :]:
        axes.set_visible(False)
    figure.suptitle(f"Precision against recall on {comparison.material}", fontsize=11, x=0.01, ha="left", color=INK)
    return figure


def _draw_class(axes: Axes, comparison: Comparison, name: str) -> None:
    axes.axhline(PRECISION, color=QUIET, linewidth=0.7, linestyle=(0, (4, 3)))
    scores = [result.score.of(name) for result in comparison.results]
    for row, one in enumerate(scores):
        axes.plot(one.curve.recall, one.curve.precision, color=_colour(row), linewidth=1.6, solid_joinstyle="round")
        axes.plot(one.recall, one.precision, "o", color=_colour(row), markersize=5, markeredgecolor="white")
    _name_curves(axes, [f"{result.candidate.label}  " for result in comparison.results], scores)
    axes.set_title(f"{name.replace('_', ' ')}, {scores[0].truths:,} to find", fontsize=9.5, loc="left", color=INK)
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.02), xlabel="recall", ylabel="precision")
    _tidy(axes)


def _name_curves(axes: Axes, labels: list[str], scores: list[ClassScore]) -> None:
    """Write the models' names in their colours into the corner that the curves leave free."""
    good = max(one.ap11 for one in scores) > _GOOD_AP
    corner, align = ((0.03, 0.03), "left") if good else ((0.98, 0.97), "right")
    for row, (label, one) in enumerate(zip(labels, scores, strict=True)):
        lines_up = len(scores) - 1 - row if good else -row
        axes.annotate(
            f"{label if len(scores) > 1 else ''}AP {one.ap11:.3f}", corner, xycoords="axes fraction",
            xytext=(0, 11 * lines_up), textcoords="offset points", color=_colour(row), fontsize=8,
            ha=align, va="bottom" if good else "top",
            bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.8},
        )  # fmt: skip


def _draw_accuracy_against_time(comparison: Comparison) -> Figure:
    figure = _blank(8.6, 4.6)
    axes = figure.add_subplot()
    times_ms = np.array([result.median_ms for result in comparison.results])
    accuracy = np.array([result.score.mean_ap11 for result in comparison.results])
    for row in range(len(comparison.results)):
        interval = comparison.interval(row)
        if interval is not None:
            axes.vlines(times_ms[row], interval.low, interval.high, color=_colour(row), linewidth=1.2, alpha=0.6)
        axes.plot(times_ms[row], accuracy[row], "o", color=_colour(row), markersize=7, markeredgecolor="white")
    axes.set_xscale("log")
    axes.set_xlim(times_ms.min() / 1.6, times_ms.max() * 2.6)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_ylim(0.0, min(1.0, 1.15 * float(np.nanmax([*accuracy, *_tops(comparison)], initial=0.05))))
    axes.set(xlabel="milliseconds a picture, median", ylabel="mean AP, 11 points (Eq. 1)")
    _label_points(axes, comparison, times_ms, accuracy)
    note = ", bars: 95 % over scenes" if comparison.chance else ""
    axes.set_title(f"Accuracy against time on {comparison.material}{note}", fontsize=11, loc="left", color=INK)
    _tidy(axes)
    return figure


def _tops(comparison: Comparison) -> list[float]:
    return [interval.high for interval in comparison.chance.intervals] if comparison.chance else []


def _label_points(axes: Axes, comparison: Comparison, times_ms: FloatArray, accuracy: FloatArray) -> None:
    """Write each label to the right of its point, moved up where it would cover the one below."""
    height = _LABEL_SHARE * (axes.get_ylim()[1] - axes.get_ylim()[0])
    placed: list[tuple[float, float]] = []
    for row in np.argsort(accuracy):
        level = float(accuracy[row])
        for time_ms, other in placed:
            if abs(np.log(time_ms / times_ms[row])) < _LABEL_LOG_WIDTH and level < other + height:
                level = other + height
        placed.append((float(times_ms[row]), level))
        axes.annotate(
            comparison.results[row].candidate.label, (times_ms[row], level), xytext=(8, 0), textcoords="offset points",
            va="center", fontsize=8.5, color=_colour(row),
        )  # fmt: skip


def _blank(width_in: float, height_in: float) -> Figure:
    return Figure(figsize=(width_in, height_in), dpi=150, layout="constrained", facecolor="white")


def _colour(row: int) -> str:
    return SERIES_COLOURS[row % len(SERIES_COLOURS)]


def _tidy(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(QUIET)
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, colors=QUIET)
    axes.xaxis.label.set_fontsize(8.5)
    axes.yaxis.label.set_fontsize(8.5)
