"""The results of `standoff evaluate paper` as tables for people."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from standoff.cli.answer_tables import print_answers, print_warning_times
from standoff.cli.console import print_table

if TYPE_CHECKING:
    from standoff.evaluation.paper import ClipResult
    from standoff.evaluation.paper.map_only import MapFigures
    from standoff.evaluation.paper.pooled import Interval


def print_results(results: Sequence[ClipResult]) -> None:
    """Print the paper's figures clip by clip, then rectification and distances of all clips."""
    for result in results:
        _print_figures(result)
    _print_rectification(results)
    _print_distances(results)
    print_answers([(result.clip.name, result.answers) for result in results if result.answers is not None])
    print_warning_times(results)
    _print_benchmark(results)
    _print_map_only(results)
    facts = "; ".join(f"{name}: {value}" for name, value in results[0].setup.describe().items())
    print_table("", ("", ""), [("tried", facts)], texts=2)
    _print_pooled(results)


def _print_figures(result: ClipResult) -> None:
    from standoff.evaluation.paper.captions import number_text

    figures = [
        (figure.label, number_text(figure.paper, figure.unit), number_text(figure.measured, figure.unit),
         number_text(figure.exact_before, figure.unit, none=""), number_text(figure.exact_after, figure.unit, none=""),
         f"{figure.count} of {figure.of}")
        for figure in result.figures()
    ]  # fmt: skip
    if not figures:
        return
    columns = ("figure", "paper", "measured", "before", "after", "frames")
    caption = "Measured: as the paper did. Before and after the outlier filter: against exact truth."
    if result.setup.detector == "truth" and any(figure.name.startswith("ale") for figure in result.figures()):
        caption += " With true boxes ALE is 0 by construction."
    print_table(f"{result.clip.name}: beside the paper", columns, figures, caption)


def _print_rectification(results: Sequence[ClipResult]) -> None:
    rows = [
        (result.clip.name, f"{score.frames}", f"{score.out_of_sight}", f"{score.failed}", f"{score.wrong}",
         f"{score.corner_rmse_px:.3f}", f"{100 * score.within_share:.1f}")
        for result in results if (score := result.rectification) is not None
    ]  # fmt: skip
    if rows:
        columns = ("clip", "frames", "unseen", "failed", "wrong", "rmse px", "within %")
        caption = (
            "Unseen: no map, and a corner outside the picture or all of it hidden. Failed: no map otherwise, or "
            "a wrong one: a corner more than 5 px off. Rmse: of all others' corners."
        )
        print_table("Rectification", columns, rows, caption)


def _print_distances(results: Sequence[ClipResult]) -> None:
    from standoff.evaluation.paper.captions import number_text
    from standoff.evaluation.paper.pairs import AFTER, BEFORE

    rows = []
    for result in results:
        for index, group in enumerate(result.groups):
            before, after = group.scores[BEFORE], group.scores[AFTER]
            _, _, machine = group.class_pair.replace("_", " ").partition("-")
            pair = machine + (f" x{group.pairs}" if group.pairs > 1 else "")
            numbers = (before.made_m, after.made_m, after.mape_percent, after.median_m)
            name = "" if index else result.clip.name
            inside = f"{_percent(group.coverage.inside_68)}, {_percent(group.coverage.inside_95)}"
            rows.append((name, pair, f"{after.measured}/{after.frames}", *map(number_text, numbers), inside))
    if rows:
        columns = ("clip", "machine", "measured", "before", "after", "after %", "median", "inside %")
        caption = (
            "Against exact truth, m: MADE before and after the outlier filter, MAPE (%) and median residual after it; "
            "inside: share (%) whose truth is within 1 and 1.96 stated standard errors. Measured: of the frames of all "
            "pairs of the kind."
        )
        print_table("Distances of workers from machines", columns, rows, caption, texts=2)


def _print_map_only(results: Sequence[ClipResult]) -> None:
    rows = []
    for result in results:
        if (score := result.map_only) is not None:
            missing = f"{score.without_map}, {score.without_map_since_seen}"
            rows.append((result.clip.name, missing, *_map_figures(score.level)))
            rows.append(("  uneven", "", *_map_figures(score.uneven)))
    if rows:
        columns = ("clip", "no map", *(label for _, label in _MAP_FIGURES))
        caption = (
            "True feet within 20 m of the reference through the map, m, without boxes and filters: if the ground were "
            "level, then as it is. No map: frames in all, and of these since the whole reference was first seen. "
            "Inside: of the map's own 95 % region. Wrong: off by more than 0.5 m and more than five of the standard "
            "errors that it states (sigma)."
        )
        print_table("The map alone", columns, rows, caption)


_MAP_FIGURES = (
    ("median_m", "median"),
    ("p95_m", "95 %"),
    ("worst_m", "worst"),
    ("inside_share", "inside %"),
    ("believed_wrong_share", "wrong %"),
    ("sigma_m", "sigma"),
)


def _map_figures(figures: MapFigures) -> list[str]:
    return [_map_number(name, getattr(figures, name)) for name, _ in _MAP_FIGURES]


def _percent(share: float) -> str:
    return "none" if math.isnan(share) else f"{100 * share:.0f}"


def _map_number(name: str, value: float) -> str:
    if math.isnan(value):
        return "none"
    return f"{100 * value:.1f}" if name.endswith("_share") else f"{value:.3f}"


def _print_pooled(results: Sequence[ClipResult]) -> None:
    from standoff.evaluation.paper import pool

    pooled = pool(results)
    if pooled is None or pooled.clips < 2:
        return
    kinds = (("level", pooled.level), ("uneven", pooled.uneven))
    rows = [
        (label, *(_with_interval(name, getattr(of, name), pooled.intervals[f"{kind} {name}"]) for kind, of in kinds))
        for name, label in _LONG.items()
    ]
    for name, label in (
        ("without_map_share", "frames without a map, %"),
        ("without_map_since_seen_share", "the same once seen, %"),
    ):
        share = _with_interval(name, getattr(pooled, name), pooled.intervals[name])
        rows.append((label, share, ""))
    caption = "In brackets: 95 % of a bootstrap over the clips."
    print_table(f"The map alone, {pooled.clips} clips", ("", "level ground", "ground as it is"), rows, caption)


_LONG = {
    "median_m": "median error, m",
    "p95_m": "95th percentile, m",
    "worst_m": "worst, m",
    "inside_share": "inside the map's 95 %, %",
    "believed_wrong_share": "wrong and believed, %",
    "sigma_m": "stated sigma, median, m",
}


def _with_interval(name: str, value: float, interval: Interval) -> str:
    low, high = (_map_number(name, end) for end in interval)
    return f"{_map_number(name, value)} ({low} to {high})"


def _print_benchmark(results: Sequence[ClipResult]) -> None:
    from standoff.evaluation.paper.captions import number_text
    from standoff.evaluation.paper.pairs import BENCHMARK

    rows = [
        (result.clip.name, group.class_pair.replace("_", " "), f"{score.measured} of {score.frames}",
         number_text(score.made_m, "m"), number_text(score.mape_percent, "%"), number_text(score.median_m, "m"))
        for result in results for group in result.groups if (score := group.scores.get(BENCHMARK)) is not None
    ]  # fmt: skip
    if rows:
        columns = ("clip", "pair", "frames", "MADE", "MAPE", "median")
        caption = "How wrong the yardstick itself is: the polynomial that the paper took for true, against exact truth."
        print_table("The paper's benchmark", columns, rows, caption, texts=2)
