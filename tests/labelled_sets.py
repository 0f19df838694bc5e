"""Small data sets on disk, for tests that read labelled pictures."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from standoff.labels import LabelledData, LabelledPicture


def write_picture(path: Path, size_px: tuple[int, int] = (40, 30), seed: int = 0) -> Path:
    """Write a picture of noise, and the folders above it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pixels = np.random.default_rng(seed).integers(0, 256, (size_px[1], size_px[0], 3), dtype=np.uint8)
    assert cv2.imwrite(str(path), pixels)
    return path


def write_yolo(folder: Path, lines: Mapping[str, str | bytes], names: Sequence[str] = ("worker", "excavator")) -> Path:
    """Write a YOLO folder without splits: the label file of each stem."""
    for number, (stem, content) in enumerate(lines.items()):
        write_picture(folder / "images" / f"{stem}.png", seed=number)
        label = folder / "labels" / f"{stem}.txt"
        label.parent.mkdir(parents=True, exist_ok=True)
        label.write_bytes(content.encode() if isinstance(content, str) else content)
    (folder / "classes.txt").write_text("\n".join(names) + "\n")
    return folder


def write_coco(folder: Path, boxes: Sequence[Mapping[str, Any]], count: int = 4, **more: object) -> Path:
    """Write a COCO file of so many pictures of 64x48 with these annotations; `more` replaces what is in it."""
    images = []
    for number in range(1, count + 1):
        write_picture(folder / f"{number}.png", (64, 48), seed=number)
        images.append({"id": number, "file_name": f"{number}.png", "width": 64, "height": 48})
    categories = [{"id": 1, "name": "worker"}, {"id": 2, "name": "excavator"}, {"id": 3, "name": "lorry"}]
    path = folder / "labels.json"
    path.write_text(json.dumps({"images": images, "annotations": list(boxes), "categories": categories} | more))
    return path


def write_mixture(path: Path, *sources: Mapping[str, object], **rest: object) -> Path:
    """Write a mixture file."""
    path.write_text(yaml.safe_dump({"sources": [dict(source) for source in sources], **rest}))
    return path


def by_stem(data: LabelledData) -> dict[str, LabelledPicture]:
    """Return all pictures by the stem of their file."""
    return {picture.path.stem: picture for pictures in data.splits.values() for picture in pictures}


def kinds(data: LabelledData) -> list[str]:
    """Return the kinds of the problems, in the order found."""
    return [problem.kind for problem in data.problems]
