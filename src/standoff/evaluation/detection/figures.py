"""Pictures of a comparison: precision against recall, and accuracy against time."""

from __future__ import annotations

import math
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from standoff.core.errors import OutputError
from standoff.drawing.file_charts import INK, QUIET, blank, colour_of, tidy
from standoff.evaluation.detection.accuracy_time import draw_accuracy_time
from standoff.evaluation.detection.comparison import Comparison
from standoff.evaluation.detection.score import PRECISION, ClassScore
from standoff.files.whole import whole_file

_PANEL_IN = (3.4, 3.3)
_MOST_COLUMNS = 4
_LEAST_WIDTH_IN = 5.0
_GOOD_AP = 0.4
"""Curves of better ones leave the lower left corner free, others the upper right."""


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
        "accuracy_time.png": draw_accuracy_time(comparison),
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
    figure = blank(max(_PANEL_IN[0] * columns, _LEAST_WIDTH_IN), _PANEL_IN[1] * rows + 0.4)
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
        axes.plot(one.curve.recall, one.curve.precision, color=colour_of(row), linewidth=1.6, solid_joinstyle="round")
        axes.plot(one.recall, one.precision, "o", color=colour_of(row), markersize=5, markeredgecolor="white")
    _name_curves(axes, [f"{result.candidate.label}  " for result in comparison.results], scores)
    axes.set_title(f"{name.replace('_', ' ')}, {scores[0].truths:,} to find", fontsize=9.5, loc="left", color=INK)
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.02), xlabel="recall", ylabel="precision")
    tidy(axes)


def _name_curves(axes: Axes, labels: list[str], scores: list[ClassScore]) -> None:
    """Write the models' names in their colours into the corner that the curves leave free."""
    good = max(one.ap11 for one in scores) > _GOOD_AP
    corner, align = ((0.03, 0.03), "left") if good else ((0.98, 0.97), "right")
    for row, (label, one) in enumerate(zip(labels, scores, strict=True)):
        lines_up = len(scores) - 1 - row if good else -row
        axes.annotate(
            f"{label if len(scores) > 1 else ''}AP {one.ap11:.3f}", corner, xycoords="axes fraction",
            xytext=(0, 11 * lines_up), textcoords="offset points", color=colour_of(row), fontsize=8,
            ha=align, va="bottom" if good else "top",
            bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.8},
        )  # fmt: skip
