"""The model card that a run writes: what it learnt from, how well it does, and what that says nothing about."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from standoff.files.json_text import plain
from standoff.files.yaml_text import dump_yaml
from standoff.labels import LabelledData, Split
from standoff.labels.read import CUT_GROUP
from standoff.labels.summary import SplitSummary, summarise
from standoff.training.run.before_after import BeforeAfter, before_after_table
from standoff.training.run.loop import Progress
from standoff.training.run.tables import markdown_table


def card_text(
    configuration: dict[str, Any], data: LabelledData, progress: Progress, compared: Sequence[BeforeAfter] = ()
) -> str:
    """Return the card as Markdown.

    Args:
        configuration: What repeats the run.
        data: What it was trained on.
        progress: How it went.
        compared: What the run gained and lost, set by set; empty: it began from nothing.
    """
    counts = "\n".join(_row(split, summary) for split, summary in summarise(data).splits.items())
    return f"""# Detector trained with standoff

Classes: {", ".join(data.classes)}.

## Data

| split | pictures | groups | {" | ".join(data.classes)} |
|---|---|---|{"---|" * len(data.classes)}
{counts}

{_about_groups(data)}

## Accuracy on the validation split, by step

11-point AP at IoU 0.5, per cent (Kim et al., Eq. 1 and 2). The weights kept are those of step {progress.best_step}.
They were chosen on this split, so that its figures are a little too good: measure on others with
`standoff evaluate detection`.

{markdown_table(progress.rows, data.classes)}
{_before_after(compared, data.classes)}## What these figures do not say

How the detector does on sites, seasons, machines and cameras that the data does not show.

## To repeat the run

```yaml
{dump_yaml(plain(configuration))}```
"""


def _before_after(compared: Sequence[BeforeAfter], classes: Sequence[str]) -> str:
    if not compared:
        return ""
    return f"""## Before and after, at the size of the exported network

{before_after_table(compared, classes)}
"""


def _about_groups(data: LabelledData) -> str:
    cut = [problem.found for problem in data.problems if problem.kind == CUT_GROUP]
    if not cut:
        return "Groups (scenes, flights, videos) are never in two splits."
    return f"Groups (scenes, flights, videos) in two splits: {len(cut)}, first {cut[0]}. That makes figures too good."


def _row(split: Split, summary: SplitSummary) -> str:
    marked = " | ".join(map(str, summary.boxes.values()))
    return f"| {split} | {summary.pictures} | {len(summary.groups)} | {marked} |"
