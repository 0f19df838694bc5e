"""The report's charts: of gaps, distances and watched ground over time, and the plan from above."""

from __future__ import annotations

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.ticker import FuncFormatter, MaxNLocator

from standoff.core.durations import minutes_text
from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray
from standoff.core.zones import Zone, ZoneKind, ring_middle
from standoff.drawing.ground_shapes import clip_to_box
from standoff.drawing.ground_window import rectify, window_around
from standoff.drawing.page_charts import INK, MUTED, SURFACE, inline_svg, read_in, themed_figure
from standoff.drawing.palette import HEX, class_tone
from standoff.stages.sinks.collect import RunSummary
from standoff.stages.sinks.series import Series, Trail
from standoff.stages.sinks.zone_drawing import largest_part

_FAINT_PAIRS = 20
_PANELS = 6
_PLAN_PX = 520
_HATCH: dict[ZoneKind, str] = {"no_go": "///", "machine_only": "...", "crossing": "---"}
_FIRST, _ON, _LAST = Outline.MOVETO, Outline.LINETO, Outline.CLOSEPOLY


def site_chart(summary: RunSummary, warning_gap_m: float) -> str:
    """Draw the closest pair's gap over time, with the limits and with what was not measured."""
    with themed_figure(10.0, 3.4) as figure:
        axes = figure.add_subplot()
        for pair in summary.worst_pairs()[:_FAINT_PAIRS]:
            series = summary.pairs[pair]
            axes.plot(series.column("time_s"), series.column("gap_m"), color=MUTED, alpha=0.45, linewidth=0.7)
        _shade_unmeasured(axes, summary.site, summary.no_map)
        _plot_by_limit(axes, summary.site, "gap_m", 0.0, warning_gap_m)
        read_in(axes.yaxis, summary.unit, "gap of the closest pair")
        highest = np.nanmax(summary.site.column("gap_m")) if summary.site.closest else 0.0
        axes.set_ylim(top=max(1.15 * highest, warning_gap_m + 8.0))
        _finish_time_axis(axes, summary)
        return inline_svg(figure)


def pair_charts(summary: RunSummary, warning_gap_m: float) -> str:
    """Draw the distance of the closest pairs over time, one panel each; empty when no pair was measured."""
    worst = summary.worst_pairs()[:_PANELS]
    if not worst:
        return ""
    rows = -(-len(worst) // 2)
    with themed_figure(10.0, 2.1 * rows) as figure:
        for i, pair in enumerate(worst):
            axes = figure.add_subplot(rows, 2, i + 1)
            series = summary.pairs[pair]
            time_s, distance, sigma = (series.column(name) for name in ("time_s", "distance_m", "sigma_m"))
            both_radii_m = float(np.nanmedian(distance - series.column("gap_m")))
            axes.fill_between(time_s, distance - sigma, distance + sigma, color=MUTED, alpha=0.35, linewidth=0)
            _shade_unmeasured(axes, series, series)
            _plot_by_limit(axes, series, "distance_m", both_radii_m, both_radii_m + warning_gap_m)
            axes.set_title(" and ".join(summary.pair_names[pair]), loc="left", fontsize=9, fontweight="bold")
            read_in(axes.yaxis, summary.unit, "distance")
            axes.set_ylim(bottom=0)
            _finish_time_axis(axes, summary)
        return inline_svg(figure)


def watched_chart(summary: RunSummary) -> str:
    """Draw which share of the ground was watched over time."""
    with themed_figure(10.0, 1.6) as figure:
        axes = figure.add_subplot()
        time_s, percent = summary.watched_share.column("time_s"), 100.0 * summary.watched_share.column("gap_m")
        axes.fill_between(time_s, percent, color=HEX["worker"], alpha=0.25, linewidth=0)
        axes.fill_between(
            time_s, percent, 100.0, facecolor="none", edgecolor=MUTED, alpha=0.6, hatch="////", linewidth=0
        )
        axes.plot(time_s, percent, color=INK, linewidth=1.4)
        axes.set_ylabel("watched, %")
        axes.set_ylim(0.0, 100.0)
        _finish_time_axis(axes, summary)
        return inline_svg(figure)


def plan_chart(summary: RunSummary) -> str:
    """Draw where everything went, seen from above, x to the right; empty when nothing was placed."""
    paths = [path for path in summary.paths.values() if np.isfinite(path.points_m).any()]
    if not paths:
        return ""
    points = np.vstack([path.points_m for path in paths])
    low, high = _square_around(points[np.isfinite(points[:, 0])])
    with themed_figure(7.2, 7.2) as figure:
        axes = figure.add_subplot()
        background = _background(summary, low, high)
        if background is not None:
            axes.imshow(background, extent=(low[0], high[0], low[1], high[1]), alpha=0.55, zorder=0)
        for zone in summary.placed_zones:
            _plot_zone(axes, zone, low, high)
        for path in paths:
            _plot_path(axes, path)
        _name_paths(axes, paths, label_size_m=(high - low) * (0.11, 0.025))
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_aspect("equal")
        read_in(axes.xaxis, summary.unit, "x")
        read_in(axes.yaxis, summary.unit, "y")
        axes.grid(True)
        return inline_svg(figure)


def _shade_unmeasured(axes: Axes, unmeasured: Series, no_map: Series) -> None:
    for start_s, end_s in unmeasured.unmeasured_spans_s():
        axes.axvspan(start_s, end_s, facecolor=MUTED, alpha=0.18, linewidth=0, zorder=0)
    for start_s, end_s in no_map.unmeasured_spans_s():
        axes.axvspan(start_s, end_s, facecolor="none", edgecolor=MUTED, alpha=0.6, hatch="////", linewidth=0, zorder=0)


def _plot_by_limit(axes: Axes, series: Series, column: str, danger_m: float, warning_m: float) -> None:
    """Plot a curve in ink, in amber below the warning limit and in red below the danger limit."""
    time_s, value = series.column("time_s"), series.column(column)
    axes.plot(time_s, value, color=INK, linewidth=1.4)
    for limit_m, tone in ((warning_m, HEX["warning"]), (danger_m, HEX["danger"])):
        axes.plot(time_s, np.where(value < limit_m, value, np.nan), color=tone, linewidth=2.0)
        axes.axhline(limit_m, color=tone, linewidth=0.9, linestyle=(0, (5, 3)))


def _finish_time_axis(axes: Axes, summary: RunSummary) -> None:
    span_s = max(summary.last_s - summary.first_s, 1e-3)
    axes.set_xlim(summary.first_s, summary.first_s + span_s)
    axes.xaxis.set_major_formatter(FuncFormatter(minutes_text))
    axes.xaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 3, 6, 10]))
    axes.grid(True, axis="y")


def _plot_zone(axes: Axes, zone: Zone, low: FloatArray, high: FloatArray) -> None:
    """Draw a zone and its name where it can be seen between two corners of the plan."""
    # Outer rings and holes go round in opposite directions, which is how a path knows holes.
    corners = np.concatenate([np.concatenate([ring, ring[:1]]) for ring in zone.rings_m])
    codes = np.concatenate([[_FIRST, *[_ON] * (len(ring) - 1), _LAST] for ring in zone.rings_m])
    style = {"edgecolor": HEX["zone"], "hatch": _HATCH[zone.kind], "linewidth": 1.6, "zorder": 1}
    axes.add_patch(PathPatch(Outline(corners, codes), facecolor="none", **style))
    part = largest_part([clip_to_box(outer, low, high) for outer, *_ in zone.polygons_m])
    if part is not None:
        box = {"facecolor": SURFACE, "edgecolor": HEX["zone"], "pad": 2.0, "linewidth": 0.8}
        x_m, y_m = ring_middle(part).tolist()
        axes.annotate(zone.title, (x_m, y_m), ha="center", va="center", fontsize=8, bbox=box, zorder=2.5)


def _plot_path(axes: Axes, path: Trail) -> None:
    points = path.points_m
    placed = points[np.isfinite(points[:, 0])]
    colour = HEX[class_tone(path.class_id)]
    axes.plot(*points.T, color=SURFACE, linewidth=3.2, alpha=0.7)
    axes.plot(*points.T, color=colour, linewidth=1.7)
    axes.plot(*placed[0], marker="o", markersize=5, color=SURFACE, markeredgecolor=colour, markeredgewidth=1.6)
    axes.plot(*placed[-1], marker="s", markersize=5.5, color=colour, markeredgecolor=SURFACE)


def _name_paths(axes: Axes, paths: list[Trail], label_size_m: FloatArray) -> None:
    """Write the names at the ends, those of the longest paths first, none over another."""
    named: list[FloatArray] = []
    for path in sorted(paths, key=len, reverse=True):
        end = path.points_m[np.isfinite(path.points_m[:, 0])][-1]
        if all((np.abs(end - other) > label_size_m).any() for other in named):
            axes.annotate(path.name, end, xytext=(6, 4), textcoords="offset points", fontsize=8)
            named.append(end)


def _square_around(points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the low and high corner of a square around nearly all points."""
    low, high = np.percentile(points_m, [0.5, 99.5], axis=0)
    half = 0.5 * float((high - low).max()) * 1.15 + 3.0
    centre = (low + high) / 2.0
    return centre - half, centre + half


def _background(summary: RunSummary, low: FloatArray, high: FloatArray) -> ImageArray | None:
    """Return the first mapped frame as seen from above, RGBA, clear where the camera saw nothing."""
    if summary.background is None:
        return None
    picture, ground = summary.background
    window = window_around(np.vstack([low, high]), (_PLAN_PX, _PLAN_PX), np.array([0.0, 1.0]), margin_m=0.0)
    seen = np.zeros((_PLAN_PX, _PLAN_PX, 3), dtype=np.uint8)
    rectify(np.full_like(picture, 255), ground, window, seen)
    plan = np.zeros_like(seen)
    rectify(picture, ground, window, plan)
    rgba: ImageArray = np.dstack([cv2.cvtColor(plan, cv2.COLOR_BGR2RGB), seen[:, :, 0]]).astype(np.uint8, copy=False)
    return rgba
