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
            rows.append((name, pair, f"{after.measured}/{after.frames}", *map(number_text, numbers)))
    if rows:
        columns = ("clip", "machine", "measured", "before", "after", "after %", "median")
        caption = (
            "Against exact truth, m: MADE before and after the outlier filter, MAPE (%) and median residual after it. "
            "Measured: of the frames of all pairs of the kind."
        )
        print_table("Distances of workers from machines", columns, rows, caption, texts=2)


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
