"""The result of `standoff evaluate detection` as tables, on the screen or in Markdown."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

from standoff.cli.console import Table, print_tables
from standoff.core.classes import CLASSES, Role
from standoff.evaluation.detection.coco import HEIGHT_BANDS_PX
from standoff.evaluation.detection.score import PRECISION

if TYPE_CHECKING:
    from standoff.evaluation.detection.comparison import Comparison
    from standoff.evaluation.detection.detector_trial import TrialResult

_NONE = "n/a"
_WORKER = next(site_class.name for site_class in CLASSES if site_class.role is Role.PERSON)


def print_comparison(comparison: Comparison, *, as_markdown: bool = False) -> None:
    """Print the models side by side, then class by class."""
    tables = [make(comparison) for make in (_summary, _by_class, _at_best, _by_height, _points, _at_thresholds)]
    print_tables(tables, as_markdown=as_markdown)


def _number(value: float, digits: int = 3) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else _NONE


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")


def _summary(comparison: Comparison) -> Table:
    results = comparison.results
    rows = [(label, *(_number(figure(result)) for result in results)) for label, figure in _FIGURES.items()]
    if comparison.chance:
        ranges = (f"{one.low:.3f}-{one.high:.3f}" for one in comparison.chance.intervals)
        rows.insert(1, ("  95 % of it", *ranges))
    rows += _worker_rows(results)
    rows += [
        ("ms a picture, median", *(_number(result.median_ms, 1) for result in results)),
        ("  19 of 20 within", *(_number(result.p95_ms, 1) for result in results)),
    ]
    of = f"{_count(comparison.pictures, 'picture')} of {_count(comparison.groups, 'scene')}"
    columns = ("", *(result.candidate.label for result in results))
    return Table(f"Detectors on {comparison.material}: {of}", columns, rows, _caption(comparison))


_FIGURES: Mapping[str, Callable[[TrialResult], float]] = MappingProxyType(
    {
        "mean AP, 11 points (Eq. 1)": lambda result: result.score.mean_ap11,
        "average IoU (Eq. 2)": lambda result: result.score.average_iou,
        "COCO AP": lambda result: result.coco.mean("ap"),
        "COCO AP50": lambda result: result.coco.mean("ap50"),
        "COCO AP75": lambda result: result.coco.mean("ap75"),
        "COCO AP small": lambda result: result.coco.mean("ap_small"),
        "COCO AP medium": lambda result: result.coco.mean("ap_medium"),
        "COCO AP large": lambda result: result.coco.mean("ap_large"),
    }
)


def _worker_rows(results: Sequence[TrialResult]) -> list[tuple[str, ...]]:
    workers = [one for result in results for one in result.coco.classes if one.name == _WORKER]
    return [
        (f"worker AP50, {band}", *(_number(worker.ap50_by_height[place]) for worker in workers))
        for place, band in enumerate(_bands())
        if workers and workers[0].truths_by_height[place]
    ]


def _bands() -> list[str]:
    return [f"{low:g}-{high:g} px" if math.isfinite(high) else f"{low:g}+ px" for low, high in HEIGHT_BANDS_PX]


def _caption(comparison: Comparison) -> str:
    iou = comparison.results[0].score.iou
    notes = [f"Means over the classes that have truth, IoU {iou:g}; COCO's AP over IoUs from 0.5 to 0.95."]
    notes += [
        f"{result.candidate.label} does not know {', '.join(result.unseen)}: AP 0."
        for result in comparison.results
        if result.unseen
    ]
    if comparison.chance is None:
        notes.append("Too few scenes for an interval of the mean AP.")
    elif comparison.chance.difference is not None:
        low, high = comparison.chance.difference.low, comparison.chance.difference.high
        verdict = "which may be chance" if low <= 0.0 <= high else "more than chance"
        notes.append(f"Mean AP, second less first: {low:+.3f} to {high:+.3f} (95 % over scenes), {verdict}.")
    return " ".join(notes)


def _by_class(comparison: Comparison) -> Table:
    rows = []
    for cells, result, place in _class_rows(comparison):
        one, coco = result.score.classes[place], result.coco.classes[place]
        numbers = (one.ap11, one.ap, coco.ap, coco.ap50, coco.ap75)
        rows.append((*cells, f"{one.truths}", *map(_number, numbers)))
    blank = [""] * (len(_head(comparison)) - 1)
    rows += [(_readable(name), *blank, "0", *[_NONE] * 5) for name in _without_truth(comparison)]
    columns = (*_head(comparison), "boxes", "AP11", "AP", "COCO AP", "AP50", "AP75")
    caption = "AP11: 11 points (Eq. 1). AP: all points. The others: COCO's."
    return Table("By class", columns, rows, caption, texts=len(_head(comparison)))


def _at_best(comparison: Comparison) -> Table:
    in_metres = any(result.ale_m for result in comparison.results)
    rows = []
    for cells, result, place in _class_rows(comparison):
        one = result.score.classes[place]
        numbers = [one.threshold, one.precision, one.recall, one.average_iou, one.recall_at_precision(PRECISION)]
        numbers += [result.ale_m.get(one.name, math.nan)] if in_metres else []
        rows.append((*cells, *map(_number, numbers)))
    columns = (*_head(comparison), "score", "precision", "recall", "IoU", f"recall at {PRECISION:g}")
    caption = f"At the score that gives the best F1; IoU: Eq. 2. Recall at {PRECISION:g}: at that precision."
    if in_metres:
        columns += ("ALE m",)
        caption += " ALE: Eq. 3."
    return Table("By class, at its best score", columns, rows, caption, texts=len(_head(comparison)))


def _by_height(comparison: Comparison) -> Table:
    rows = []
    for cells, result, place in _class_rows(comparison):
        one = result.coco.classes[place]
        bands = (
            f"{_number(ap50)} ({count})" if count else ""
            for ap50, count in zip(one.ap50_by_height, one.truths_by_height, strict=True)
        )
        rows.append((*cells, *bands))
    columns = (*_head(comparison), *_bands())
    caption = "AP50 of boxes so tall in the picture, and how many there are."
    return Table("By class and height", columns, rows, caption, texts=len(_head(comparison)))


def _points(comparison: Comparison) -> Table:
    rows = []
    for result in comparison.results:
        for one, bands in zip(result.points.classes, result.points.by_height, strict=True):
            heights = zip(("all", *_bands()), (one, *bands), strict=True)
            rows += [
                (
                    *((_readable(score.name), result.candidate.label)[: len(_head(comparison))]),
                    height,
                    f"{score.count}",
                    *(_number(value, 1) for value in (score.median_px, score.p95_px)),
                    *(_number(value) for value in (score.median_heights, score.p95_heights)),
                    *(_number(value, 2) for value in (score.median_m, score.p95_m, score.anchor_median_m)),
                    _number(100.0 * score.inside, 1),
                )
                for height, score in heights
                if score.count
            ]
    columns = (
        *(*_head(comparison), "box height", "points", "px", "p95 px", "heights", "p95 heights", "m", "p95 m"),
        *("bottom centre m", "in 95 %, %"),
    )
    caption = (
        "Ground points of right boxes at the best score: median and 95 % of their errors in pixels, in heights of "
    )
    caption += "the box, in metres on the ground; how many lie in the ellipse in which 95 of 100 should."
    return Table("Where things stand", columns, rows, caption, texts=len(_head(comparison)) + 1)


def _at_thresholds(comparison: Comparison) -> Table:
    rows = [
        (*cells, f"{threshold:g}", *map(_number, result.score.classes[place].curve.at(threshold)))
        for threshold in comparison.thresholds
        for cells, result, place in _class_rows(comparison)
    ]
    columns = (*_head(comparison), "score", "precision", "recall")
    return Table("By class, at given scores", columns, rows, texts=len(_head(comparison)))


def _class_rows(comparison: Comparison) -> Iterator[tuple[tuple[str, ...], TrialResult, int]]:
    """Give the words at the head of a row, the model, and the position of the class, for classes with truth."""
    for place, one in enumerate(comparison.results[0].score.classes):
        if not one.truths:
            continue
        for number, result in enumerate(comparison.results):
            name = "" if number else _readable(one.name)
            yield (name, result.candidate.label)[: len(_head(comparison))], result, place


def _without_truth(comparison: Comparison) -> list[str]:
    return [one.name for one in comparison.results[0].score.classes if not one.truths]


def _head(comparison: Comparison) -> tuple[str, ...]:
    return ("class", "model") if len(comparison.results) > 1 else ("class",)


def _readable(name: str) -> str:
    return name.replace("_", " ")
