"""The curves of a sweep."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from standoff.drawing.file_charts import SERIES_COLOURS, blank, colour_of, tidy
from standoff.training.sweep.results import Result

_DASHES: Final = ("-", "--", ":", "-.")
"""One for each time that the colours begin again."""


def draw_sweep(results: Sequence[Result], path: Path) -> None:
    """Draw mAP on the validation split by step, a line for each scenario that was validated.

    Args:
        results: Of which one was, at least.
        path: PNG to write.
    """
    figure = blank(7.5, 4.6)
    axes = figure.subplots()
    for row, result in enumerate(results):
        if not result.history:
            continue
        axes.plot(
            [validation["step"] for validation in result.history],
            [math.nan if validation["map"] is None else 100.0 * validation["map"] for validation in result.history],
            _DASHES[row // len(SERIES_COLOURS) % len(_DASHES)],
            color=colour_of(row),
            linewidth=1.8,
            marker="o" if len(result.history) < 2 else None,
            label=result.scenario,
        )
    axes.set(title="mAP on validation pictures, %", xlabel="step")
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    tidy(axes)
    figure.savefig(path, format="png")
