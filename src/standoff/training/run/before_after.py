"""What a training that went on from a detector gained and lost: on the new pictures, and on those that it knew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from standoff.evaluation.detection import DetectionScore
from standoff.labels import LabelledData, LabelledPicture, Split
from standoff.labels.splits import spread
from standoff.training.darknet.cfg import DarknetCfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.weights import load_weights
from standoff.training.run.validation import validate


@dataclass(frozen=True, slots=True, eq=False)
class BeforeAfter:
    """Both networks on the held-out pictures of one set.

    Attributes:
        source: Name of the set.
        split: Which pictures: `test` where there is one, because the weights were chosen on `val`.
        before: Of the weights at the start.
        after: Of the weights that were kept.
    """

    source: str
    split: Split
    before: DetectionScore
    after: DetectionScore

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "source": self.source,
            "split": self.split,
            "before": self.before.to_dict(),
            "after": self.after.to_dict(),
        }


def compare_before_after(
    cfg: DarknetCfg,
    weights: tuple[Path, Path],
    data: LabelledData,
    *,
    most: int,
    bf16: bool,
    device: torch.device,
) -> list[BeforeAfter]:
    """Score the weights at the start and those that were kept on each set's held-out pictures.

    Args:
        cfg: Of both networks; its input size is that of the comparison.
        weights: Darknet weights before and after.
        data: What was trained on.
        most: At most so many pictures of each set, evenly spread.
        bf16: Compute in bfloat16 where it is safe.
        device: To compute on.

    Returns:
        One for each set that holds out boxes.
    """
    sets = _held_out(data, most)
    scores: list[list[DetectionScore]] = []
    for path in weights:
        network = DarknetNetwork(cfg)
        load_weights(network, path)
        network.to(device)
        scores.append([validate(network, pictures, data.classes, bf16=bf16) for _, _, pictures in sets])
    return [
        BeforeAfter(source, split, before, after)
        for (source, split, _), before, after in zip(sets, *scores, strict=True)
    ]


def _held_out(data: LabelledData, most: int) -> list[tuple[str, Split, Sequence[LabelledPicture]]]:
    sets: list[tuple[str, Split, Sequence[LabelledPicture]]] = []
    sources = dict.fromkeys(picture.source for pictures in data.splits.values() for picture in pictures)
    splits: tuple[Split, ...] = ("test", "val")
    for source in sources:
        for split in splits:
            pictures = spread([one for one in data.splits[split] if one.source == source], most)
            if any(not one.ignored.all() for one in pictures):
                sets.append((source, split, pictures))
                break
    return sets


def before_after_table(compared: Sequence[BeforeAfter], classes: Sequence[str]) -> str:
    """Return 11-point AP at IoU 0.5 before and after as Markdown, per cent; a dash where a set has no such box."""
    lines = ["| held out | pictures | " + " | ".join(classes) + " | mAP |", "|---" * (len(classes) + 3) + "|"]
    for one in compared:
        pairs = [(one.before.of(name).ap11, one.after.of(name).ap11) for name in classes]
        pairs.append((one.before.mean_ap11, one.after.mean_ap11))
        cells = [f"{100 * old:.1f} → {100 * new:.1f}" if np.isfinite(new) else "-" for old, new in pairs]
        lines.append(f"| {one.source} ({one.split}) | {one.after.matches.pictures} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def before_after_lines(compared: Sequence[BeforeAfter]) -> list[str]:
    """Say for each set what became of its mAP."""
    return [
        f"{one.source}, {one.after.matches.pictures} held-out pictures ({one.split}): "
        f"mAP {100 * one.before.mean_ap11:.1f} % before, {100 * one.after.mean_ap11:.1f} % after"
        for one in compared
    ]
