"""Random truths, and detections that find some of them, miss some and invent some."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import Detections
from standoff.labels import LabelledPicture

CLASSES = ("worker", "excavator", "vehicle")
SIZE_PX = (640, 480)


def picture(
    boxes_px: FloatArray | list[list[float]],
    class_id: list[int] | None = None,
    ignored: list[bool] | None = None,
    group: str = "scene",
) -> LabelledPicture:
    boxes = np.asarray(boxes_px, dtype=np.float64).reshape(-1, 4)
    return LabelledPicture(
        path=Path("picture.png"),
        size_px=SIZE_PX,
        xyxy_px=boxes,
        class_id=np.array(class_id if class_id is not None else [0] * len(boxes), dtype=np.int64),
        ignored=np.array(ignored if ignored is not None else [False] * len(boxes), dtype=np.bool_),
        group=group,
        source="drawn",
    )


def detections(
    boxes_px: FloatArray | list[list[float]], score: list[float], class_id: list[int] | None = None
) -> Detections:
    boxes = np.asarray(boxes_px, dtype=np.float64).reshape(-1, 4)
    return Detections(boxes, np.array(score), np.array(class_id if class_id is not None else [0] * len(boxes)))


def random_scenes(
    seed: int, pictures: int = 12, ignored_share: float = 0.15
) -> tuple[list[LabelledPicture], list[Detections]]:
    """Two pictures of each scene; scores are all different, or COCO's order among equals would matter."""
    rng = np.random.default_rng(seed)
    truth, found = [], []
    for number in range(pictures):
        count = int(rng.integers(0, 12))
        boxes = _boxes(rng, count)
        class_id = rng.integers(0, len(CLASSES), count)
        ignored = rng.random(count) < ignored_share
        truth.append(picture(boxes, class_id.tolist(), ignored.tolist(), f"scene {number // 2}"))
        near = np.repeat(boxes, 2, axis=0) + rng.normal(0.0, 5.0, (2 * count, 4))
        guessed = np.concatenate([near, _boxes(rng, 4)])
        guessed[:, 2:] = np.maximum(guessed[:, 2:], guessed[:, :2] + 2.0)
        names = np.concatenate([np.repeat(class_id, 2), rng.integers(0, len(CLASSES), 4)])
        wrong = rng.random(len(names)) < 0.15
        names = np.where(wrong, rng.integers(0, len(CLASSES), len(names)), names)
        kept = rng.random(len(names)) < 0.7
        found.append(Detections(guessed[kept], rng.random(int(kept.sum())), names[kept]))
    return truth, found


def _boxes(rng: np.random.Generator, count: int) -> FloatArray:
    """Sides from 6 to 200 px, as many small as large."""
    sides = np.exp(rng.uniform(np.log(6.0), np.log(200.0), (count, 2)))
    low = rng.uniform(0.0, 1.0, (count, 2)) * (np.array(SIZE_PX) - sides)
    return np.concatenate([low, low + sides], axis=1) - 0.5
