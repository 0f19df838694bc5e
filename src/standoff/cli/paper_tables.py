"""The results of `standoff evaluate paper` as tables for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from standoff.cli.console import print_table

if TYPE_CHECKING:
    from standoff.evaluation.paper import ClipResult


def print_results(results: Sequence[ClipResult]) -> None:
    """Print the paper's figures clip by clip, then rectification and distances of all clips."""
    for result in results:
        _print_figures(result)
    _print_rectification(results)
    _print_distances(results)
    _print_benchmark(results)
    facts = "; ".join(f"{name}: {value}" for name, value in results[0].trial.describe().items())
    print_table("", ("", ""), [("tried", facts)], texts=2)


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
    if result.trial.detector == "truth" and any(figure.name.startswith("ale") for figure in result.figures()):
        caption += " With true boxes ALE is 0 by construction."
    print_table(f"{result.clip.name}: beside the paper", columns, figures, caption)


def _print_rectification(results: Sequence[ClipResult]) -> None:
    rows = [
        (result.clip.name, f"{score.frames}", f"{score.out_of_sight}", f"{score.failed}", f"{score.wrong}",
         f"{score.corner_rmse_px:.3f}", f"{100 * score.within_share:.1f}")
        for result in results if (score := result.rectification) is not None
    ]  # fmt: skip
    if rows:
        columns = ("clip", "frames", "out of sight", "failed", "wrong", "corner rmse px", "within 5 px %")
        caption = (
            "Out of sight: no map, and a corner outside the picture or all of it hidden. Failed: no map otherwise, or a "
            "wrong one: a corner more than 5 px off."
        )
        print_table("Rectification", columns, rows, caption)


def _print_distances(results: Sequence[ClipResult]) -> None:
    from standoff.evaluation.paper.pairs import AFTER, BEFORE
    from standoff.evaluation.paper.captions import number_text

    rows = []
    for result in results:
        for group in result.groups:
            before, after = group.scores[BEFORE], group.scores[AFTER]
            numbers = (
                number_text(before.made_m, "m"), number_text(after.made_m, "m"), number_text(after.mape_percent, "%"),
                number_text(after.median_m, "m"),
            )  # fmt: skip
            pair = group.class_pair.replace("_", " ") + (f" x {group.pairs}" if group.pairs > 1 else "")
            rows.append((result.clip.name, pair, f"{after.measured} of {after.frames}", *numbers))
    if rows:
        columns = ("clip", "pairs", "measured", "MADE before", "MADE after", "MAPE after", "median after")
        caption = "Against exact truth, before and after the outlier filter; measured: frames of all pairs of the kind."
        print_table("Distances", columns, rows, caption, texts=2)


def _print_benchmark(results: Sequence[ClipResult]) -> None:
    from standoff.evaluation.paper.pairs import BENCHMARK
    from standoff.evaluation.paper.captions import number_text

    rows = [
        (result.clip.name, group.class_pair.replace("_", " "), f"{score.measured} of {score.frames}",
         number_text(score.made_m, "m"), number_text(score.mape_percent, "%"), number_text(score.median_m, "m"))
        for result in results for group in result.groups if (score := group.scores.get(BENCHMARK)) is not None
    ]  # fmt: skip
    if rows:
        columns = ("clip", "pair", "frames", "MADE", "MAPE", "median")
        caption = "How wrong the yardstick itself is: the polynomial that the paper took for true, against exact truth."
        print_table("The paper's benchmark", columns, rows, caption, texts=2)
