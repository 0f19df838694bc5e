"""What is printed of a run against its clip's truth; by `standoff demo` beside the paper's method on the same boxes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from standoff.cli.console import print_table

if TYPE_CHECKING:
    from standoff.evaluation.clip_run import ClipScore, Encounter
    from standoff.evaluation.paper.metrics import DistanceScore
    from standoff.evaluation.paper.pairs import PairGroup

_MEANING = (
    "Map: true feet within 20 m of the reference through the map, boxes left out; level: if the ground were. MADE: the "
    "paper's mean absolute error of distances, from box to metre. Inside: share of the distances whose truth is within "
    "1 and 1.96 stated standard errors."
)


def print_scores(ours: ClipScore, papers: ClipScore) -> None:
    """Print who was found and what was said of it, then both methods side by side.

    Args:
        ours: Of standoff's defaults.
        papers: Of the paper's method on the same detections.
    """
    _print_found(ours)
    _print_hazards(ours)
    rows = [
        (label, paper, own)
        for (label, own), (_, paper) in zip(_compared(ours), _compared(papers), strict=True)
    ]  # fmt: skip
    columns = ("", "the paper's method", "standoff")
    print_table("Against the film's truth", columns, rows, f"From the same detections. {_MEANING}")


def print_score(score: ClipScore) -> None:
    """Print who was found, what was said of it, and how far off the run is."""
    _print_found(score)
    _print_hazards(score)
    print_table("Against the clip's truth", ("", "this run"), _compared(score), _MEANING)


def _print_found(score: ClipScore) -> None:
    found = [
        (one.class_name, f"{one.detected} of {one.visible}", _number(100 * one.detected / one.visible, "%", 0),
         _number(one.ale_m, "m"), _number(one.position_median_m, "m"))
        for one in score.classes
    ]  # fmt: skip
    columns = ("class", "boxes found", "recall", "ALE", "median position error")
    print_table("Detection", columns, found)


def _print_hazards(score: ClipScore) -> None:
    met = [_encounter_row(one) for one in score.encounters]
    false = ", ".join(score.false_hazards) or "none"
    caption = f"{_recognised(score)} recognised. False warnings and dangers: {false}."
    print_table("Hazards", ("really", "between", "seconds", "least gap", "said", "at"), met, caption, texts=2)


def _recognised(score: ClipScore) -> str:
    return f"{sum(one.recognised for one in score.encounters)} of {len(score.encounters)}"


def _encounter_row(one: Encounter) -> tuple[str, ...]:
    said = (one.said, f"{one.said_s:.1f} s") if one.said else ("nothing", "")
    return one.kind, ", ".join(one.names), f"{one.start_s:.1f}-{one.end_s:.1f}", f"{one.least_gap_m:.2f} m", *said


def _compared(score: ClipScore) -> list[tuple[str, str]]:
    """Return what is compared of one method, by its label."""
    level, uneven = score.map_only.level, score.map_only.uneven
    pairs = {group.class_pair: _after(score, group.class_pair) for group in score.pairs}
    measured, frames = (sum(getattr(one, name) for one in pairs.values()) for name in ("measured", "frames"))
    return [
        ("frames with a map", f"{score.frames_with_map} of {score.frames}"),
        ("map, level ground: median, 95 %", f"{_number(level.median_m, 'm')}, {_number(level.p95_m, 'm')}"),
        ("map, ground as it is: median, 95 %", f"{_number(uneven.median_m, 'm')}, {_number(uneven.p95_m, 'm')}"),
        ("distances measured", f"{measured} of {frames}"),
        *((f"MADE {name.replace('_', ' ')}", _number(one.made_m, "m")) for name, one in pairs.items()),
        *((f"inside 68, 95 %, {group.class_pair.replace('_', ' ')}", _inside(group)) for group in score.pairs),
        ("encounters recognised", _recognised(score)),
        ("false warnings and dangers", f"{len(score.false_hazards)}"),
    ]


def _inside(group: PairGroup) -> str:
    return ", ".join(_number(100 * share, "%", 0) for share in (group.coverage.inside_68, group.coverage.inside_95))


def _after(score: ClipScore, class_pair: str) -> DistanceScore:
    from standoff.evaluation.paper.pairs import AFTER

    return next(group.scores[AFTER] for group in score.pairs if group.class_pair == class_pair)


def _number(value: float, unit: str, digits: int = 2) -> str:
    return "none" if math.isnan(value) else f"{value:.{digits}f} {unit}"
