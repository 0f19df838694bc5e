"""Tiny ONNX models in the layouts that Ultralytics documents for its exports, with the metadata that these have."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
from stages.detect.onnx_models import Array, save_constant

from standoff.core.types import Frame
from standoff.stages.detect import DetectParams
from standoff.stages.frames import frame_from_array

NAMES = ("person", "car", "kite")
EVERYTHING = DetectParams(score_threshold=0.0, nms_iou=1.0, max_detections=10**6)
MASKS, KEYPOINTS = 4, 17


def metadata(size_px: tuple[int, int] | None, names: tuple[str, ...] = NAMES, /, **more: str) -> dict[str, str]:
    """What an export writes; sizes are height and width."""
    said = {"description": "a model", "stride": "32", "names": str(dict(enumerate(names))), "task": "detect"}
    if size_px is not None:
        said["imgsz"] = str([size_px[1], size_px[0]])
    return said | more


def tell(model: Path, texts: dict[str, str]) -> Path:
    """Put texts into a model's metadata."""
    loaded = onnx.load(str(model))
    onnx.helper.set_model_props(loaded, texts)
    onnx.save(loaded, str(model))
    return model


def random_boxes(random: np.random.Generator, count: int, size_px: tuple[int, int]) -> Array:
    """(count, 4) centre and size of boxes inside the input."""
    centre = random.uniform(0.3, 0.7, (count, 2)) * size_px
    return np.concatenate([centre, random.uniform(4, 16, (count, 2))], axis=1)


def random_chances(random: np.random.Generator, count: int, columns: int = len(NAMES)) -> Array:
    return random.uniform(0.01, 1, (count, columns))


def empty(size_px: tuple[int, int]) -> Frame:
    return frame_from_array(np.zeros((size_px[1], size_px[0], 3), np.uint8))


def save_exported(path: Path, rows: Array, size_px: Any, task: str = "detect", **more: str) -> Path:
    """Write a network that says the same of every picture, with an export's metadata; open sizes are not told."""
    outputs = {"output0": rows.astype(np.float32)}
    if task == "segment":
        outputs["output1"] = np.zeros((1, MASKS, 8, 8), np.float32)
    told = {"kpt_shape": f"[{KEYPOINTS}, 3]"} if task == "pose" else {}
    told_px = None if isinstance(size_px[0], str) else size_px
    return tell(save_constant(path, outputs, size_px), metadata(told_px, NAMES, task=task, **told, **more))


def even_rows(columns: int, count: int) -> Array:
    """(1, count, columns) of boxes in the middle of 64 x 64 px, all as likely."""
    rows = np.zeros((1, count, columns), np.float32)
    rows[..., :4] = [30, 30, 50, 50]
    rows[..., 4:] = 0.5
    return rows
