"""Tables of a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any


def markdown_table(rows: Iterable[dict[str, Any]], classes: Sequence[str]) -> str:
    """Return accuracy by step as the paper's Table 2 has it: AP of each class, mAP and average IoU in per cent.

    >>> row = {"step": 500, "ap_worker": 0.5, "map": 0.5, "average_iou": 0.75, "loss_total": 2.0}
    >>> print(markdown_table([row], ["worker"]))  # doctest: +NORMALIZE_WHITESPACE
    | step | loss | worker AP | mAP | average IoU |
    |---|---|---|---|---|
    | 500 | 2.00 | 50.00 | **50.00** | 75.00 |
    """
    rows = list(rows)
    best = max((row["map"] for row in rows), default=0.0)
    lines = ["| step | loss | " + " | ".join(f"{name} AP" for name in classes) + " | mAP | average IoU |"]
    lines.append("|---" * (len(classes) + 4) + "|")
    for row in rows:
        mark = "**" if row["map"] == best else ""
        values = [f"{100 * row[f'ap_{name}']:.2f}" for name in classes]
        values += [f"{mark}{100 * row['map']:.2f}{mark}", f"{100 * row['average_iou']:.2f}"]
        lines.append(f"| {row['step']} | {row['loss_total']:.2f} | " + " | ".join(values) + " |")
    return "\n".join(lines) + "\n"
