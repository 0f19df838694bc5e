"""Pictures of a run: its curves, and what the network sees."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from standoff.core.types import Detections, ImageArray
from standoff.drawing.file_charts import GRID, INK, SERIES_COLOURS
from standoff.labels import LabelledPicture, load_picture
from standoff.stages.detect import resize

_LOSSES: Final = {
    "loss_total": "total",
    "loss_objectness": "objectness",
    "loss_box": "box",
    "loss_classes": "classes",
    "loss_points": "points",
}
_CELL_WIDTH_PX, _COLUMNS = 800, 2
_SURE = 0.3
"""Boxes drawn: less sure ones would hide the picture."""


def draw_curves(rows: Sequence[dict[str, Any]], classes: Sequence[str], path: Path) -> None:
    """Draw the losses, and the accuracy on the validation split, by step.

    Args:
        rows: `Progress.rows`, at least one.
        classes: Names.
        path: PNG to write.
    """
    figure = Figure(figsize=(12.0, 4.8), dpi=130, layout="constrained", facecolor="white")
    losses, accuracy = figure.subplots(1, 2)
    steps = [row["step"] for row in rows]
    for colour, (name, label) in zip(SERIES_COLOURS, _LOSSES.items(), strict=False):
        _line(losses, steps, [row[name] for row in rows], label, colour, width=2.0 if label == "total" else 1.2)
    losses.set(yscale="log", title="Loss on training pictures", xlabel="step")
    for index, name in enumerate(classes):
        colour = SERIES_COLOURS[(index + 1) % len(SERIES_COLOURS)]
        values = [100.0 * row[f"ap_{name}"] for row in rows]
        if np.isfinite(values).any():
            _line(accuracy, steps, values, name.replace("_", " "), colour, width=1.0)
    _line(accuracy, steps, [100.0 * row["map"] for row in rows], "mAP", INK, width=2.4)
    _line(accuracy, steps, [100.0 * row["average_iou"] for row in rows], "average IoU", INK, width=1.2, style="--")
    accuracy.set(ylim=(0, 100), title="11-point AP and average IoU on validation pictures, %", xlabel="step")
    accuracy.legend(loc="lower right", fontsize=8, frameon=False, ncols=2)
    losses.legend(loc="upper right", fontsize=8, frameon=False)
    for axes in (losses, accuracy):
        axes.grid(color=GRID)
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, format="png")


def _line(
    axes: Axes, steps: Sequence[int], values: Sequence[float], label: str, colour: str, width: float, style: str = "-"
) -> None:
    marker = "o" if len(steps) < 2 else None
    axes.plot(steps, values, style, color=colour, linewidth=width, label=label, marker=marker)


def draw_predictions(
    pictures: Sequence[LabelledPicture], found: Sequence[Detections], classes: Sequence[str], path: Path
) -> None:
    """Draw what was found (coloured, with its score) over what is true (thin white) as one sheet.

    Args:
        pictures: To show; at least one.
        found: In each.
        classes: Names.
        path: JPEG to write.
    """
    cells = [_draw_cell(picture, own, classes) for picture, own in zip(pictures, found, strict=True)]
    height_px = max(cell.shape[0] for cell in cells)
    blank = np.full((height_px, _CELL_WIDTH_PX, 3), 255, np.uint8)
    padded = [np.concatenate([cell, blank[cell.shape[0] :]]) for cell in cells]
    padded += [blank] * (-len(padded) % _COLUMNS)
    rows = [np.concatenate(padded[start : start + _COLUMNS], axis=1) for start in range(0, len(padded), _COLUMNS)]
    coded, content = cv2.imencode(".jpg", np.concatenate(rows), [cv2.IMWRITE_JPEG_QUALITY, 88])
    assert coded
    path.write_bytes(content.tobytes())


def _draw_cell(picture: LabelledPicture, found: Detections, classes: Sequence[str]) -> ImageArray:
    scale = _CELL_WIDTH_PX / picture.size_px[0]
    cell = np.ascontiguousarray(resize(load_picture(picture), (_CELL_WIDTH_PX, round(picture.size_px[1] * scale))))
    for box in picture.xyxy_px[~picture.ignored]:
        _rectangle(cell, box * scale, (255, 255, 255))
    for box, score, class_id in zip(found.xyxy_px, found.score, found.class_id, strict=True):
        if score < _SURE:
            continue
        colour = _bgr(SERIES_COLOURS[int(class_id) % len(SERIES_COLOURS)])
        left, top = _rectangle(cell, box * scale, colour)
        label = f"{classes[int(class_id)].replace('_', ' ')} {score:.2f}"
        cv2.putText(cell, label, (left, max(10, top - 3)), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (0, 0, 0), 3, cv2.LINE_AA)
        cv2.putText(
            cell, label, (left, max(10, top - 3)), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (255, 255, 255), 1, cv2.LINE_AA
        )
    return cell


def _rectangle(
    cell: ImageArray, box: np.ndarray[tuple[int], np.dtype[np.float64]], colour: tuple[int, int, int]
) -> tuple[int, int]:
    left, top, right, bottom = (round(float(value)) for value in box)
    thickness = 1 if colour == (255, 255, 255) else 2
    cv2.rectangle(cell, (left, top), (right, bottom), colour, thickness, cv2.LINE_AA)
    return left, top


def _bgr(colour: str) -> tuple[int, int, int]:
    return int(colour[5:7], 16), int(colour[3:5], 16), int(colour[1:3], 16)
