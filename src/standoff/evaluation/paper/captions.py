"""What the report says about its tables and figures: which source of error each shows, and the paper's values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from standoff.evaluation.paper.board import BoardScore
from standoff.evaluation.paper.pairs import AFTER, AGAINST_BENCHMARK, BEFORE, BENCHMARK, FILLED, PairSeries
from standoff.evaluation.paper.published import PUBLISHED, Published
from standoff.evaluation.paper.result import ClipResult

ISOLATES: Mapping[str, str] = MappingProxyType(
    {
        BEFORE: "each frame by itself: its map, its boxes, uneven ground",
        AFTER: "the same with the paper's outlier filter",
        FILLED: "the same with failed frames guessed, as the paper counted them",
        AGAINST_BENCHMARK: "the paper's own comparison: what both sides share cancels",
        BENCHMARK: "the yardstick alone: how wrong the paper's substitute for truth is",
    }
)
"""By what is compared: what goes into the error."""

_SOURCES = (("mobile", "Figs. 10 and 11"), ("stationary", "Fig. 13"))
_SHORT = (("made", "MADE"), ("mape", "MAPE"), ("median", "median"))


def number_text(value: float, unit: str = "", none: str = "none") -> str:
    """Return a measured number for people, `none` where nothing was measured.

    >>> number_text(0.3312, "m"), number_text(37, "frames"), number_text(float("nan"), "%")
    ('0.33 m', '37 frames', 'none')
    """
    if not math.isfinite(value):
        return none
    digits = 0 if unit == "frames" else 2 if abs(value) >= 0.1 or value == 0 else 3
    return f"{value:.{digits}f} {unit}".strip()


def published_for(preset: str, class_pair: str) -> Mapping[str, Published]:
    """Return the paper's figures of a pair by their short name; empty where it has none.

    >>> {name: figure.value for name, figure in published_for("stationary-15", "worker-excavator").items()}
    {'MADE': 0.632, 'MAPE': 4.214}
    """
    names = {short: f"{preset} {key} {class_pair}" for key, short in _SHORT}
    return {short: PUBLISHED[name] for short, name in names.items() if name in PUBLISHED}


def pair_caption(result: ClipResult, series: PairSeries) -> str:
    """Say what the chart of a pair shows, and what the paper has there."""
    source = next(
        (f" (the paper's {where})" for preset, where in _SOURCES if result.clip.preset.startswith(preset)), ""
    )
    text = (
        f"Left: distance between {' and '.join(series.names).replace('_', ' ')} in every frame, centre to centre, m. "
        f"Right: residuals, m; boxes are quartiles, whiskers 5 and 95 %{source}."
    )
    paper = published_for(result.clip.preset, series.class_pair)
    if not paper:
        return text
    mine = {
        short: figure.measured
        for key, short in _SHORT
        for figure in result.figures()
        if figure.name == f"{result.clip.preset} {key} {series.class_pair}"
    }
    values = ", ".join(
        f"{short} {number_text(figure.value, figure.unit)} (here {number_text(mine[short], figure.unit)})"
        for short, figure in paper.items()
    )
    against = "; both against the paper's substitute for truth" if series.benchmark is not None else ""
    return f"{text} The paper has {values}{against}."


def board_caption(board: BoardScore) -> str:
    """Say what the chart of a board shows, and what the paper has there."""
    before, after = PUBLISHED["board before"], PUBLISHED["board after"]
    return (
        f"Accuracy (Eq. 7: 100 % less MAPE) of the distances from the first corner to the {board.corners - 1} others "
        f"in every frame; dashed: over all frames. The paper's Fig. 8 has {number_text(before.value, '%')} before and "
        f"{number_text(after.value, '%')} after; here {number_text(board.before_percent, '%')} and "
        f"{number_text(board.after_percent, '%')}."
    )
