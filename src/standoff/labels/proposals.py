"""Boxes that a detector proposes, for people to correct in CVAT (COCO's layout) or in Label Studio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from standoff.core.types import Detections
from standoff.files.json_text import json_text
from standoff.files.whole import whole_file
from standoff.labels.coco_document import CocoDocument

_LOCAL_FILES: Final = "/data/local-files/?d="
"""How Label Studio names files of a folder that it is allowed to serve."""


@dataclass(frozen=True, slots=True, eq=False)
class ProposedPicture:
    """One picture, and what a detector sees in it.

    Attributes:
        file_name: Of the picture, relative to the folder that the labelling program is given.
        size_px: (width, height).
        boxes: `class_id` is a position in the list of classes that goes with it.
    """

    file_name: str
    size_px: tuple[int, int]
    boxes: Detections


def write_coco(pictures: Sequence[ProposedPicture], classes: Sequence[str], out: Path) -> None:
    """Write a COCO file, as CVAT imports it; each box has its `score`.

    Args:
        pictures: With their boxes.
        classes: Names by class id.
        out: The file; appears whole or not at all.

    Raises:
        OutputError: It cannot be written.
    """
    document = CocoDocument([{"name": name} for name in classes])
    for picture in pictures:
        document.add_picture(picture.size_px, {"file_name": picture.file_name})
        boxes = picture.boxes
        for xyxy_px, score, class_id in zip(
            boxes.xyxy_px.tolist(), boxes.score.tolist(), boxes.class_id.tolist(), strict=True
        ):
            area_px = (xyxy_px[2] - xyxy_px[0]) * (xyxy_px[3] - xyxy_px[1])
            document.add_box(class_id, xyxy_px, area_px, {"score": round(score, 4)})
    _write_whole(document.to_dict("proposed by a detector, to be corrected"), out)


def write_label_studio(
    pictures: Sequence[ProposedPicture], classes: Sequence[str], out: Path, *, url_prefix: str = _LOCAL_FILES
) -> None:
    """Write Label Studio's tasks, with the boxes as predictions.

    They fit its template for object detection: a `RectangleLabels` named `label` on an `Image` named `image`.

    Args:
        pictures: With their boxes.
        classes: Names by class id.
        out: The file; appears whole or not at all.
        url_prefix: Goes before each file name; the default is for a folder that Label Studio serves itself.

    Raises:
        OutputError: It cannot be written.
    """
    tasks = [
        {
            "data": {"image": url_prefix + quote(picture.file_name)},
            "predictions": [
                {
                    "model_version": "standoff",
                    "score": round(float(picture.boxes.score.mean()), 4) if len(picture.boxes) else 0.0,
                    "result": _rectangles(picture, classes),
                }
            ],
        }
        for picture in pictures
    ]
    _write_whole(tasks, out)


def _rectangles(picture: ProposedPicture, classes: Sequence[str]) -> list[dict[str, Any]]:
    """Return boxes in per cent of the picture, counted from the corner of its first pixel."""
    width_px, height_px = picture.size_px
    percent = 100.0 / width_px, 100.0 / height_px
    corners_px = picture.boxes.xyxy_px + 0.5
    starts, extents = corners_px[:, :2] * percent, (corners_px[:, 2:] - corners_px[:, :2]) * percent
    return [
        {
            "id": f"box{number}",
            "type": "rectanglelabels",
            "from_name": "label",
            "to_name": "image",
            "original_width": width_px,
            "original_height": height_px,
            "image_rotation": 0,
            "score": round(score, 4),
            "value": {
                "x": left,
                "y": top,
                "width": width,
                "height": height,
                "rotation": 0,
                "rectanglelabels": [classes[class_id]],
            },
        }
        for number, ((left, top), (width, height), score, class_id) in enumerate(
            zip(
                starts.tolist(),
                extents.tolist(),
                picture.boxes.score.tolist(),
                picture.boxes.class_id.tolist(),
                strict=True,
            )
        )
    ]


def _write_whole(content: object, out: Path) -> None:
    with whole_file(out) as path:
        path.write_text(json_text(content), encoding="utf-8")
