"""Accuracy against time: which network, at which input size, is worth its milliseconds."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from standoff.core.homography import FloatArray
from standoff.drawing.file_charts import INK, blank, colour_of, tidy
from standoff.evaluation.detection.coco import HEIGHT_BANDS_PX
from standoff.evaluation.detection.comparison import Comparison
from standoff.evaluation.detection.detector_trial import TrialResult

_SIZED: Final = re.compile(r"(?P<network>.+?)[-_.](?P<size>\d+x\d+)(?P<slices> \d+x\d+)?")
_SMALL: Final = HEIGHT_BANDS_PX.index((15.0, 30.0))
_ROOM_RIGHT: Final = 2.4
"""Factor of time right of the slowest, for its label."""
_LEAST_TOP: Final = 0.05
_BAR_COLOUR: Final = "#bbbbbb"
_LABEL_SHARE, _LABEL_LOG_WIDTH = 0.045, 0.055
"""Room for a label: share of the axis' height, and natural logarithm of the times that a letter spans."""


@dataclass(frozen=True, slots=True)
class Family:
    """One network at one or several input sizes, all with or all without slices.

    Attributes:
        name: Of the network, with the slices.
        rows: Positions of its results.
        sizes: What tells each of them from the others; empty where there is only one.
    """

    name: str
    rows: tuple[int, ...]
    sizes: tuple[str, ...]


def families(labels: Sequence[str]) -> list[Family]:
    """Tell which labels are one network at several input sizes, as `standoff export --size` is usually named.

    >>> [(one.name, one.rows, one.sizes) for one in families(["a-640x384", "b", "a-960x544", "a-960x544 2x2"])]
    [('a', (0, 2), ('640x384', '960x544')), ('b', (1,), ('',)), ('a-960x544 2x2', (3,), ('',))]
    """
    members: dict[str, list[tuple[int, str]]] = {}
    for row, label in enumerate(labels):
        sized = _SIZED.fullmatch(label)
        name = sized["network"] + (sized["slices"] or "") if sized else label
        members.setdefault(name, []).append((row, sized["size"] if sized else ""))
    return [
        Family(name, tuple(row for row, _ in own), tuple(size for _, size in own))
        if len(own) > 1
        else Family(labels[own[0][0]], (own[0][0],), ("",))
        for name, own in members.items()
    ]


def draw_accuracy_time(comparison: Comparison) -> Figure:
    """Draw the mean AP, and the AP50 of small workers where there are any, against milliseconds a picture.

    Networks that were given at several input sizes, `NAME-WIDTHxHEIGHT`, are lines.

    Args:
        comparison: With truth of at least one class.
    """
    results = comparison.results
    times_ms = np.array([result.median_ms for result in results])
    accuracy = np.array([result.score.mean_ap11 for result in results])
    small = np.array([_ap50_of_small_workers(result) for result in results])
    networks = families([result.candidate.label for result in results])
    note = "; bars: 95 % over scenes" if comparison.chance else ""
    drawn = {f"mean AP, 11 points (Eq. 1){note}": accuracy}
    if np.isfinite(small).any():
        drawn["AP50 of workers {:g} to {:g} px tall".format(*HEIGHT_BANDS_PX[_SMALL])] = small
    figure = blank(2.0 + 5.6 * len(drawn), 4.8)
    panels = figure.subplots(1, len(drawn), squeeze=False).ravel()
    for row in range(len(results)):
        interval = comparison.interval(row)
        if interval is not None:
            panels[0].vlines(times_ms[row], interval.low, interval.high, color=_BAR_COLOUR, linewidth=1.0, zorder=1)
    for axes, (title, values) in zip(panels, drawn.items(), strict=True):
        axes.set_title(title, fontsize=9.5, loc="left", color=INK)
        _draw_panel(axes, networks, times_ms, values)
    figure.suptitle(f"Accuracy against time on {comparison.material}", fontsize=11, x=0.01, ha="left", color=INK)
    return figure


def _ap50_of_small_workers(result: TrialResult) -> float:
    return next((one.ap50_by_height[_SMALL] for one in result.coco.classes if one.name == "worker"), float("nan"))


def _draw_panel(axes: Axes, networks: Sequence[Family], times_ms: FloatArray, values: FloatArray) -> None:
    for number, network in enumerate(networks):
        rows = np.array(network.rows)[np.argsort(times_ms[list(network.rows)])]
        axes.plot(
            times_ms[rows], values[rows], "o-", color=colour_of(number), linewidth=1.4, markersize=7,
            markeredgecolor="white",
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_xlim(times_ms.min() / 1.3, times_ms.max() * _ROOM_RIGHT)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_ylim(0.0, min(1.0, 1.15 * max(float(axes.dataLim.y1), _LEAST_TOP)))
    axes.set_xlabel("milliseconds a picture, median")
    _write_labels(axes, networks, times_ms, values)
    tidy(axes)


def _write_labels(axes: Axes, networks: Sequence[Family], times_ms: FloatArray, values: FloatArray) -> None:
    """Write the name of each network beside its slowest point, and the sizes of the others below theirs."""
    height = _LABEL_SHARE * (axes.get_ylim()[1] - axes.get_ylim()[0])
    placed: list[tuple[float, float, int]] = []
    slowest = {max(network.rows, key=times_ms.item) for network in networks}
    of_row = {
        row: (number, size)
        for number, network in enumerate(networks)
        for row, size in zip(network.rows, network.sizes, strict=True)
    }
    for row in np.argsort(values)[: np.isfinite(values).sum()].tolist():
        number, size = of_row[row]
        level, text = float(values[row]), size
        # A line goes up to the right: below its points is room.
        offset, font_size = (5, -8), 7.0
        if row in slowest:
            text, offset, font_size = f"{networks[number].name} {size}".strip(), (8, 0), 8.0
            for other_ms, other, letters in placed:
                left, right = sorted([(float(times_ms[row]), len(text)), (other_ms, letters)])
                if np.log(right[0] / left[0]) < _LABEL_LOG_WIDTH * left[1] and level < other + height:
                    level = other + height
            placed.append((float(times_ms[row]), level, len(text)))
        axes.annotate(
            text, (times_ms[row], level), xytext=offset, textcoords="offset points", va="center", fontsize=font_size,
            color=colour_of(number), zorder=1.5,
            bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.4},
        )  # fmt: skip
