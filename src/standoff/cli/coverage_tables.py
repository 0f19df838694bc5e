"""The result of `standoff evaluate coverage` as tables for people."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from standoff.cli.console import Table
from standoff.evaluation.resampling import LEAST_GROUPS

if TYPE_CHECKING:
    from standoff.evaluation.coverage import CoverageResult, PairRow

_COLUMNS = ("measured", "MADE", "MAPE", "median", "p95", "68 %", "95 %", "sigma")
_SIGHT = "The worse of the two. Hidden: less than nine tenths of it to be seen; cut off: by the picture's edge."


def coverage_tables(result: CoverageResult) -> list[Table]:
    """Return all pairs of each kind, the same by distance and by visibility, and single positions."""
    of = f"{result.clips} clip{'s' * (result.clips > 1)}, {result.frames} frames"
    by = {name: [row for row in result.pairs if row.by == name] for name in ("distance", "visibility")}
    return [
        Table(f"Distances against truth: {of}", ("worker and", *_COLUMNS), _whole(result), _caption(result)),
        _banded("By true distance", by["distance"], "Centre to centre."),
        _banded(
            "By visibility",
            by["visibility"],
            _SIGHT,
        ),
        _positions(result),
    ]


def _whole(result: CoverageResult) -> list[tuple[str, ...]]:
    rows = []
    for row in result.whole_kinds():
        rows.append((_machine(row), *_cells(row)))
        if row.intervals:
            names = ("measured_share", "made_m", "mape_percent", "", "", "inside_68", "inside_95", "")
            rows.append(("  95 % of clips", *(_range(row.intervals, name) for name in names)))
    return rows


def _caption(result: CoverageResult) -> str:
    text = (
        "Measured: of the pairs that can be seen. MADE, median (signed: measured less true) and p95 of the error in m, "
        "MAPE in %. 68 %, 95 %: share whose truth is within 1 and 1.96 stated standard errors; sigma: their median, m. "
    )
    if result.clips < LEAST_GROUPS:
        return text + f"Fewer than {LEAST_GROUPS} clips: no intervals; the errors of one clip stand or fall together."
    return text + "95 % of clips: of a bootstrap over the clips; of measured, %."


def _banded(title: str, rows: Iterable[PairRow], caption: str) -> Table:
    cells = [(f"{_machine(row)}, {row.band}", *_cells(row)) for row in rows]
    return Table(title, ("worker and", *_COLUMNS), cells, caption)


def _cells(row: PairRow) -> tuple[str, ...]:
    score, coverage = row.score, row.coverage
    return (
        f"{score.measured}/{score.frames}",
        _number(score.made_m),
        _number(score.mape_percent, 1),
        f"{score.median_m:+.2f}" if math.isfinite(score.median_m) else "none",
        _number(score.p95_m),
        _number(100 * coverage.inside_68, 0),
        _number(100 * coverage.inside_95, 0),
        _number(coverage.sigma_m),
    )


def _positions(result: CoverageResult) -> Table:
    rows: list[tuple[str, ...]] = [
        (_readable(one.class_name), f"{one.located} of {one.visible}", _number(one.median_m), _number(one.p95_m),
         _number(100 * one.inside_68, 0), _number(100 * one.inside_95, 0), _number(one.sigma_m))
        for one in result.positions
    ]  # fmt: skip
    caption = "Distance from the true place, m, and how often that is in the stated ellipse of 68 and 95 %."
    if result.runs_without_positions:
        caption += f" {result.runs_without_positions} of {len(result.runs)} runs count their places from elsewhere."
    columns = ("class", "located", "median", "p95", "68 %", "95 %", "sigma")
    return Table("Single positions", columns, rows, caption)


def _range(intervals: Mapping[str, tuple[float, float]], name: str) -> str:
    if name not in intervals:
        return ""
    in_percent, digits = (100.0, 0) if name.endswith(("share", "68", "95")) else (1.0, 1 if "percent" in name else 2)
    return "-".join(_number(in_percent * end, digits) for end in intervals[name])


def _number(value: float, digits: int = 2) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "none"


def _machine(row: PairRow) -> str:
    return _readable(row.kind.partition("-")[2] or row.kind)


def _readable(name: str) -> str:
    return name.replace("_", " ")
