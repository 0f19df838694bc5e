"""The paper's Fig. 8 for the lab test: accuracy by view and error by distance, before and after rectification."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from standoff.core.errors import OutputError
from standoff.core.homography import FloatArray
from standoff.evaluation.checkerboard import CheckerboardResult

_BEFORE, _AFTER, _POSE = "#c0562f", "#1f5f8b", "#3a7d44"
_QUIET = "#6b6b6b"


def checkerboard_figure(result: CheckerboardResult, path: Path | str) -> None:
    """Draw the lab test.

    Args:
        result: From `evaluate_checkerboard`.
        path: Picture to write; its suffix says the format (.png, .svg, .pdf).

    Raises:
        OutputError: It cannot be written.
    """
    figure = Figure(figsize=(11.0, 4.8), dpi=150, layout="constrained", facecolor="white")
    by_view, by_distance = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
    _draw_accuracy_by_view(by_view, result)
    _draw_error_by_distance(by_distance, result)
    figure.suptitle("Distances from the first corner of a checkerboard, the first square as reference", fontsize=12)
    try:
        figure.savefig(Path(path))
    except (OSError, ValueError) as error:
        fix = "choose another path, ending in .png, .svg or .pdf"
        raise OutputError(expected="a picture to write", found=f"{path}: {error}", fix=fix) from None


def _series(result: CheckerboardResult) -> list[tuple[str, str, float, FloatArray, FloatArray]]:
    """Return label, colour, overall accuracy, (V,) accuracies and (V, T) distances of each way to measure."""
    views = result.views
    series = [
        ("before rectification", _BEFORE, result.before_percent, "before_percent", "before_m"),
        ("after rectification", _AFTER, result.after_percent, "after_percent", "after_m"),
    ]
    if not np.isnan(result.after_pose_percent):
        series.append(
            ("after, with the camera's pose", _POSE, result.after_pose_percent, "after_pose_percent", "after_pose_m")
        )
    return [
        (
            label,
            colour,
            overall,
            np.array([getattr(v, percent) for v in views]),
            np.stack([getattr(v, m) for v in views]),
        )
        for label, colour, overall, percent, m in series
    ]


def _draw_accuracy_by_view(axes: Axes, result: CheckerboardResult) -> None:
    series = _series(result)
    order = np.argsort(series[0][3], kind="stable")[::-1]
    place = np.arange(len(order))
    axes.vlines(place, series[0][3][order], series[1][3][order], color="#d9d9d9", linewidth=2, zorder=1)
    for label, colour, overall, percent, _ in series:
        axes.plot(place, percent[order], "o", color=colour, markersize=6, label=f"{label}: {overall:.2f} %", zorder=3)
        axes.axhline(overall, color=colour, linewidth=0.9, linestyle=(0, (4, 3)), alpha=0.7, zorder=2)
    axes.axhline(100.0, color=_QUIET, linewidth=0.8)
    axes.set_xticks(place, [Path(result.views[i].name).stem for i in order], rotation=45, ha="right", fontsize=8)
    axes.set_ylabel("accuracy in % (Eq. 7)")
    axes.set_title("By view, sorted by accuracy before rectification", fontsize=10, loc="left")
    axes.legend(frameon=False, fontsize=9, loc="lower left")
    _tidy(axes)


def _draw_error_by_distance(axes: Axes, result: CheckerboardResult) -> None:
    distances_m = np.unique(np.round(result.truth_m, 9))
    unit, factor = ("mm", 1000.0) if result.truth_m.max() < 1.0 else ("m", 1.0)
    for label, colour, _, _, measured_m in _series(result):
        error = np.abs(measured_m - result.truth_m) * factor
        same = [error[:, np.isclose(result.truth_m, distance_m)].ravel() for distance_m in distances_m]
        low, middle, high = np.array([np.percentile(e, (10, 50, 90)) for e in same]).T
        axes.fill_between(distances_m * factor, low, high, color=colour, alpha=0.15, linewidth=0)
        axes.plot(distances_m * factor, middle, color=colour, linewidth=1.8, label=label)
    axes.set_xlabel(f"true distance from the first corner, {unit}")
    axes.set_ylabel(f"absolute error, {unit}")
    axes.set_title("By distance: median, and 10 to 90 % of all views", fontsize=10, loc="left")
    axes.set_xlim(0.0, None)
    axes.set_ylim(0.0, None)
    _tidy(axes)


def _tidy(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="#ececec", linewidth=0.8, zorder=0)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, colors=_QUIET)
