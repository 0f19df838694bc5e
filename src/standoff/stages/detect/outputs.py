"""From what a network of any family gives to boxes and the probability of each label.

    yolov3   rows    (1, N, 5 + C)  centre x, y, width, height in input pixels; objectness; C class probabilities
    yolov5   rows    (1, N, 5 + C)  the same
    yolov8   rows    (1, 4 + C, N)  centre x, y, width, height; C class probabilities (also YOLOv9, 11, 12)
    yolov10  rows    (1, N, 6)      left, top, right, bottom; score; label (also YOLO26, and what suppresses by itself)
    yolox    rows    (1, N, 5 + C)  as yolov3, or as its export leaves them: offsets from cells of 8, 16, 32 (and 64) px
    detr     labels  (1, N)         RT-DETR, D-FINE: integers, with
             scores  (1, N)         and
             boxes   (1, N, 4)      left, top, right, bottom in pixels of the size that the graph was told;
      or     logits  (1, N, C)      before the sigmoid (also Hugging Face's exports, and RF-DETR), with
             boxes   (1, N, 4)      centre x, y, width, height as parts of the input;
      or     rows    (1, N, 4 + C)  all in one, after the sigmoid (Ultralytics' RT-DETR)

What more stands in a row, for masks, key points or an angle, is in `standoff.stages.detect.exported_yolo`. The first
three may have their boxes as parts of the input, too: the trial run shows it.
Which output is which is seen from the shapes that a trial run gives, or said by the description.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import expit

from standoff.core.homography import FloatArray
from standoff.stages.detect.candidates import (
    LARGEST_PART,
    Candidates,
    Output,
    OutputReader,
    UnreadableOutputs,
    candidates_from_centres,
    check_probability,
    find_output,
    is_table,
    listed_outputs,
)
from standoff.stages.detect.exported_yolo import columns_reader, ends_reader, probabilities_reader, rows_reader
from standoff.stages.detect.interface import Interface

_CLASSES_FROM: Final = 5
_STRIDES_PX: Final = ((8, 16, 32), (8, 16, 32, 64))


def read_rows(outputs: list[Output], least: float) -> Candidates:
    """Read rows of centre, size, objectness and class probabilities, and their ground points.

    Args:
        outputs: (1, N, 5 + C) in input pixels; and of networks with points (1, N, 4), see `model_card`.
        least: Rows whose objectness is smaller are left out: no class can be surer than the object itself.
    """
    rows = outputs[0][0]
    # NaN stays in, to be noticed.
    wanted = ~(rows[:, 4] < least)
    rows = rows[wanted].astype(np.float32, copy=False)
    found = candidates_from_centres(
        rows[:, 0:2].astype(np.float64), rows[:, 2:4].astype(np.float64), _probability(rows)
    )
    if len(outputs) == 1:
        return found
    points = outputs[1][0][wanted].astype(np.float64)
    return replace(found, foot_px=points[:, :2], foot_sigma_px=points[:, 2:])


def find_reader(interface: Interface, trial: Mapping[str, Output], knows_size: bool) -> OutputReader:
    """Decide how to read a network.

    Args:
        interface: What is known of it.
        trial: What it gave for an empty picture, by name.
        knows_size: It is told the size of its input, in pixels of which it gives boxes.

    Raises:
        UnreadableOutputs: This is not what the family gives.
    """
    nan = [name for name, output in trial.items() if output.dtype.kind == "f" and np.isnan(output).any()]
    if nan:
        raise UnreadableOutputs("numbers", f"NaN in {', '.join(nan)}")
    match interface.family:
        case "yolov3" | "yolov5":
            return rows_reader(interface, trial)
        case "yolov8":
            return columns_reader(interface, trial)
        case "yolov10":
            return ends_reader(interface, trial)
        case "yolox":
            return _yolox_reader(interface, trial)
        case "detr" if any(_is_integer_list(output) for output in trial.values()):
            return _labels_reader(interface, trial, knows_size)
        case "detr" if len(trial) == 1:
            return probabilities_reader(interface, trial)
        case "detr":
            return _logits_reader(interface, trial)


def _probability(rows: Output) -> npt.NDArray[np.floating]:
    probability: npt.NDArray[np.floating] = rows[:, _CLASSES_FROM:] * rows[:, 4:_CLASSES_FROM]
    return probability


def _yolox_reader(interface: Interface, trial: Mapping[str, Output]) -> OutputReader:
    shape, columns = "rows (1, N, 5 + classes)", _CLASSES_FROM + len(interface.classes)
    name = find_output("rows", shape, lambda output: is_table(output, columns), interface, trial)
    rows = trial[name][0].astype(np.float64)
    check_probability(rows[:, 4:])
    cells = _cells(len(rows), interface.input_size_px)
    if _is_decoded(rows[:, :2], cells):
        return OutputReader((name,), read_rows)
    return OutputReader((name,), lambda outputs, least: _read_offsets(outputs[0][0], cells, least))


def _cells(count: int, input_size_px: tuple[int, int]) -> FloatArray:
    """Column, row and side in pixels of each of YOLOX's cells: finest first, row by row."""
    grids = []
    for stride_px in _STRIDES_PX[-1]:
        column, row = np.meshgrid(*(np.arange(side_px // stride_px, dtype=np.float64) for side_px in input_size_px))
        grids.append(np.stack([column.ravel(), row.ravel(), np.full(column.size, float(stride_px))], axis=1))
    known = [np.concatenate(grids[: len(strides_px)]) for strides_px in _STRIDES_PX]
    for cells in known:
        if len(cells) == count:
            return cells
    size = "x".join(map(str, input_size_px))
    raise UnreadableOutputs(f"{len(known[0])} or {len(known[1])} rows of a YOLOX with input {size}", f"{count}")


def _is_decoded(centre: FloatArray, cells: FloatArray) -> bool:
    """Tell centres in pixels from offsets: they lie near their cells' centres, offsets near half a cell."""
    from_cell = np.abs(centre / cells[:, 2:] - cells[:, :2] - 0.5)
    return bool(np.median(from_cell) < np.median(np.abs(centre - 0.5)))


def _read_offsets(rows: Output, cells: FloatArray, least: float) -> Candidates:
    """Decode as YOLOX does: centre = (offset + cell) stride, size = exp(.) stride."""
    wanted = ~(rows[:, 4] < least)
    rows, cells = rows[wanted].astype(np.float64), cells[wanted]
    with np.errstate(over="ignore"):  # an infinite box ends where the picture does
        size_px = np.exp(rows[:, 2:4]) * cells[:, 2:]
    return candidates_from_centres((rows[:, :2] + cells[:, :2]) * cells[:, 2:], size_px, _probability(rows))


def _labels_reader(interface: Interface, trial: Mapping[str, Output], knows_size: bool) -> OutputReader:
    if not knows_size:
        raise UnreadableOutputs("an integer input (1, 2) for the picture's size beside boxes in its pixels", "none")
    names = (
        find_output("labels", "integer labels (1, N)", _is_integer_list, interface, trial),
        find_output("boxes", "boxes (1, N, 4)", lambda output: is_table(output, 4), interface, trial),
        find_output("scores", "scores (1, N)", _is_score_list, interface, trial),
    )
    _check_same_count(trial, *names)
    classes = len(interface.classes)

    def read(outputs: list[Output], least: float) -> Candidates:
        labels, boxes, scores = (output[0] for output in outputs)
        if labels.size and not (labels.min() >= 0 and labels.max() < classes):
            raise UnreadableOutputs(
                f"labels 0 to {classes - 1}, of {classes} classes", f"{labels.min()} to {labels.max()}"
            )
        wanted = ~(scores < least)
        probability = np.zeros((int(wanted.sum()), classes))
        probability[np.arange(len(probability)), labels[wanted]] = scores[wanted]
        return Candidates(boxes[wanted].astype(np.float64), probability)

    read([trial[name] for name in names], 0.0)
    return OutputReader(names, read)


def _logits_reader(interface: Interface, trial: Mapping[str, Output]) -> OutputReader:
    boxes_name = find_output("boxes", "boxes (1, N, 4)", lambda output: is_table(output, 4), interface, trial)
    others = {name: output for name, output in trial.items() if name != boxes_name}
    shape, classes = "logits (1, N, classes)", len(interface.classes)
    logits_name = find_output("logits", shape, lambda output: is_table(output, classes), interface, others)
    _check_same_count(trial, boxes_name, logits_name)
    if trial[boxes_name].size and np.abs(trial[boxes_name]).max() > LARGEST_PART:
        largest = np.abs(trial[boxes_name]).max()
        raise UnreadableOutputs(f"boxes as parts of the input, 0 to 1, in '{boxes_name}'", f"{largest:.4g}")
    whole_px = np.array([*interface.input_size_px], dtype=np.float64)

    def read(outputs: list[Output], least: float) -> Candidates:
        boxes, logits = (output[0].astype(np.float64) for output in outputs)
        probability = expit(logits)
        wanted = ~(probability.max(axis=1) < least)
        boxes = boxes[wanted]
        return candidates_from_centres(boxes[:, :2] * whole_px, boxes[:, 2:] * whole_px, probability[wanted])

    return OutputReader((boxes_name, logits_name), read)


def _is_integer_list(output: Output) -> bool:
    return output.ndim == 2 and output.shape[0] == 1 and output.dtype.kind in "iu"


def _is_score_list(output: Output) -> bool:
    return output.ndim == 2 and output.shape[0] == 1 and output.dtype.kind == "f"


def _check_same_count(trial: Mapping[str, Output], *names: str) -> None:
    chosen = {name: trial[name] for name in names}
    if len({output.shape[1] for output in chosen.values()}) != 1:
        raise UnreadableOutputs("as many boxes as there is said of each,", listed_outputs(chosen))
