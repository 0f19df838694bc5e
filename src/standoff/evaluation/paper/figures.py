"""The paper's figures 8, 10, 11 and 13 for a simulated clip, as inline SVG in the page's colours."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from standoff.core.homography import BoolArray
from standoff.drawing.page_charts import INK, MUTED, inline_svg, themed_figure
from standoff.drawing.palette import HEX
from standoff.evaluation.paper.board import BoardScore
from standoff.evaluation.paper.monitored_clip import MonitoredClip
from standoff.evaluation.paper.pairs import PairSeries
from standoff.evaluation.rectification import FAILURE_PX

ESTIMATE, RAW, TREND = HEX["worker"], HEX["warning"], HEX["machine"]
_HEADROOM = 0.35
_MANY_FRAMES = 100


def pair_chart(series: PairSeries, paper_median_m: float | None = None) -> str:
    """Draw one pair's distance over the frames, and how its residuals are spread (Figs. 10, 11 and 13).

    Args:
        series: What to draw.
        paper_median_m: The paper's own median residual, if it has one.
    """
    with themed_figure(10.0, 3.3) as figure:
        over_time, spread = figure.subplots(1, 2, width_ratios=(3.6, 1.0))
        _draw_distances(over_time, series)
        _draw_residuals(spread, series, paper_median_m)
        return inline_svg(figure)


def corner_chart(monitored: MonitoredClip, failed: BoolArray) -> str:
    """Draw the worst corner's error over the frames, on a logarithmic scale."""
    with themed_figure(10.0, 2.5) as figure:
        axes = figure.add_subplot()
        _shade(axes, failed)
        worst_px = np.maximum(monitored.corner_error_px.max(axis=1), 1e-3)
        frame = np.arange(len(worst_px))
        axes.semilogy(frame, worst_px, ".", markersize=_marker_size(len(frame)), color=ESTIMATE)
        axes.axhline(FAILURE_PX, color=HEX["danger"], linewidth=0.9, linestyle=(0, (5, 3)))
        axes.set_ylabel("error of the worst corner, px")
        axes.set_ylim(0.8 * np.nanmin(worst_px, initial=0.1), 1.4 * np.nanmax(worst_px, initial=FAILURE_PX))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
        _finish(axes, len(frame))
        return inline_svg(figure)


def board_chart(board: BoardScore) -> str:
    """Draw Eq. 7's accuracy of every frame before and after rectification (Fig. 8)."""
    with themed_figure(10.0, 2.8) as figure:
        axes = figure.add_subplot()
        _shade(axes, ~np.isfinite(board.after))
        frame = np.arange(board.frames)
        for values, overall, colour in (
            (board.before, board.before_percent, RAW),
            (board.after, board.after_percent, ESTIMATE),
        ):
            axes.plot(frame, values, color=colour, linewidth=1.5, marker=".", markersize=3)
            if np.isfinite(overall):
                axes.axhline(overall, color=colour, linewidth=0.9, linestyle=(0, (5, 3)))
        axes.axhline(100.0, color=MUTED, linewidth=0.7)
        axes.set_ylabel("accuracy, % (Eq. 7)")
        _finish(axes, board.frames)
        return inline_svg(figure)


def _draw_distances(axes: Axes, series: PairSeries) -> None:
    frame = np.arange(len(series.truth_m))
    low, high = _limits(series)
    _shade(axes, series.failed)
    # What lies outside is drawn on the edge rather than left out.
    axes.plot(
        frame, np.clip(series.before_m, low, high), ".", markersize=_marker_size(len(frame)), color=RAW, clip_on=False
    )
    if series.benchmark is not None:
        axes.plot(frame, series.benchmark.baseline_m, color=TREND, linewidth=1.0, linestyle=":")
        axes.plot(frame, series.benchmark.trend_m, color=TREND, linewidth=1.6, linestyle=(0, (6, 2)))
    axes.plot(frame, series.filled_m, color=ESTIMATE, linewidth=1.5)
    axes.plot(frame, series.truth_m, color=INK, linewidth=1.3)
    axes.set_ylim(low, high)
    axes.set_ylabel("distance, m")
    axes.set_title(" and ".join(series.names).replace("_", " "), loc="left", fontsize=9, fontweight="bold")
    _finish(axes, len(frame))


def _draw_residuals(axes: Axes, series: PairSeries, paper_median_m: float | None) -> None:
    spreads = [
        ("before", series.before_m - series.truth_m, RAW),
        ("after", series.after_m - series.truth_m, ESTIMATE),
    ]
    if series.benchmark is not None:
        spreads.append(("bench-\nmark", series.benchmark.trend_m - series.truth_m, TREND))
    names = [name for name, _, _ in spreads]
    if paper_median_m is not None:
        names.append("paper")
        axes.plot(len(spreads), paper_median_m, marker="D", markersize=5, color=INK)
    for place, (_, residual_m, colour) in enumerate(spreads):
        residual_m = residual_m[np.isfinite(residual_m)]
        if not len(residual_m):
            continue
        line = {"color": colour, "linewidth": 1.4}
        axes.boxplot(
            residual_m, positions=[place], widths=0.55, whis=(5, 95), showfliers=False,
            boxprops=line, whiskerprops=line, capprops=line, medianprops={"color": INK, "linewidth": 1.6},
        )  # fmt: skip
    axes.axhline(0.0, color=MUTED, linewidth=0.8)
    axes.set_xticks(range(len(names)), names)
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_title("estimate less truth, m", loc="left", fontsize=9)
    axes.grid(True, axis="y")


def _limits(series: PairSeries) -> tuple[float, float]:
    """Return the range of what is known to be plausible, with room around it."""
    shown = [series.truth_m, series.filled_m]
    values = np.concatenate([one[np.isfinite(one)] for one in shown])
    if not len(values):
        return 0.0, 1.0
    truth_m = series.truth_m[np.isfinite(series.truth_m)]
    low, high = np.percentile(values, [1, 99])
    if len(truth_m):
        low, high = min(low, truth_m.min()), max(high, truth_m.max())
    room = _HEADROOM * max(high - low, 2.0)
    return max(0.0, low - room), high + room


def _marker_size(frames: int) -> float:
    return 3.5 if frames > _MANY_FRAMES else 7.0


def _shade(axes: Axes, failed: BoolArray) -> None:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], failed.astype(np.int8), [0]])))
    for start, stop in edges.reshape(-1, 2):
        axes.axvspan(start - 0.5, stop - 0.5, facecolor=MUTED, alpha=0.22, linewidth=0, zorder=0)


def _finish(axes: Axes, frames: int) -> None:
    axes.set_xlim(-0.5, frames - 0.5)
    axes.xaxis.set_major_locator(MaxNLocator(9, integer=True))
    axes.set_xlabel("frame")
    axes.grid(True, axis="y")
