"""What `standoff evaluate paper` prints of danger, warning, clear and unknown, and of the time before each breach."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from standoff.cli.console import print_table

if TYPE_CHECKING:
    from standoff.evaluation.paper import ClipResult
    from standoff.evaluation.paper.answers import Answers, FrameByFrame
    from standoff.evaluation.paper.warning_time import Breach


def print_answers(clips: Sequence[tuple[str, FrameByFrame]]) -> None:
    """Print the answers of each clip, or kind of clips, under its name, and of all together where there are several."""
    from standoff.evaluation.paper.answers import UP_TO_M, FrameByFrame

    if not clips:
        return
    if len(clips) > 1:
        clips = [*clips, (f"all {len(clips)}", FrameByFrame.together([answers for _, answers in clips]))]
    rows = []
    for name, answers in clips:
        rows.append((name, "measured", *_figures(answers.measured)))
        rows.append(("", "said", *_figures(answers.said)))
    columns = ("clip", "", "prec., rec.", "F1", "danger", "warning", "clear", "unknown", "breach")
    caption = (
        f"Of every pair that can be seen, truly within {UP_TO_M:g} m, in every frame. Measured: by the distance of the "
        "frame itself; said: by the hazards that are open. Precision, recall and F1 over danger, warning and clear, as "
        "far as they are true; then the F1 of each. Unknown: share of all, %; breach: share of its frames that are "
        "called clear, %."
    )
    print_table("Danger, warning, clear or unknown, frame by frame", columns, rows, caption, texts=2)


def _figures(answers: Answers) -> list[str]:
    both = f"{_number(answers.macro_precision)}, {_number(answers.macro_recall)}"
    scores = (answers.macro_f1, *(one.f1 for one in answers.each[:3]))
    shares = (answers.unknown_share, answers.breach_called_clear_share)
    return [both, *(_number(score) for score in scores), *(_number(100 * share, 1) for share in shares)]


def print_warning_times(results: Sequence[ClipResult]) -> None:
    """Print how long before each breach it was said, for the clips that have one."""
    from standoff.evaluation.paper.warning_time import AHEAD_S

    clips = [(result.clip.name, result.breaches) for result in results if result.breaches]
    if not clips:
        return
    if len(clips) > 1:
        clips.append((f"all {len(clips)}", tuple(breach for _, breaches in clips for breach in breaches)))
    rows = [(name, *_times(breaches)) for name, breaches in clips]
    columns = ("clip", "breaches", "missed", "late", "median s", f"{AHEAD_S:g} s ahead", "from the start")
    caption = (
        "For how long a warning or danger of the pair had been open when its gap fell below 0. Late: said after that; "
        f"missed: not before it was over. {AHEAD_S:g} s ahead: of the breaches that began so late in the clip. From "
        "the start: further ones that had begun with the clip, which nobody could foretell."
    )
    print_table("Warning time before each breach", columns, rows, caption)


def _times(breaches: Sequence[Breach]) -> tuple[str, ...]:
    from standoff.evaluation.paper.warning_time import summarise

    found = summarise(breaches)
    counts = (f"{found.breaches}", f"{found.missed}", f"{found.late}", _number(found.median_s, 1))
    return (*counts, f"{found.ahead} of {found.foreseeable}", f"{len(breaches) - found.breaches}")


def _number(value: float, digits: int = 2) -> str:
    return "none" if math.isnan(value) else f"{value:.{digits}f}"
