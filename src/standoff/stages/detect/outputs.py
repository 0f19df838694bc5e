"""From what a network of any family gives to boxes and the probability of each label.

    yolov3   rows    (1, N, 5 + C)  centre x, y, width, height in input pixels; objectness; C class probabilities
    yolox    rows    (1, N, 5 + C)  the same, or as its export leaves them: offsets from cells of 8, 16, 32 (and 64) px
    detr     labels  (1, N)         RT-DETR, D-FINE: integers, with
             scores  (1, N)         and
             boxes   (1, N, 4)      left, top, right, bottom in pixels of the size that the graph was told;
      or     logits  (1, N, C)      before the sigmoid (also Hugging Face's exports, and RF-DETR), with
             boxes   (1, N, 4)      centre x, y, width, height as parts of the input

Which output is which is seen from the shapes that a trial run gives, or said by the description.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.special import expit

from standoff.core.boxes import unknown_points
from standoff.core.homography import FloatArray
from standoff.stages.detect.interface import Interface

Output = npt.NDArray[Any]
_CLASSES_FROM: Final = 5
_STRIDES_PX: Final = ((8, 16, 32), (8, 16, 32, 64))
_NAMES_OF_BOXES: Final = ("box", "det")
_LARGEST_PART: Final = 10.0
"""Boxes as parts of the input may reach beyond it, but not by this much; boxes in pixels do."""

_LARGEST_PROBABILITY: Final = 1.05
"""8-bit networks may round 1 up by a step."""


class UnreadableOutputs(Exception):
    """The outputs are not those of the family.

    Args:
        expected: What would have been right.
        found: What is there.
    """

    def __init__(self, expected: str, found: str) -> None:
        super().__init__(expected, found)
        self.expected, self.found = expected, found


@dataclass(frozen=True, slots=True)
class Candidates:
    """Boxes that may be something.

    Attributes:
        xyxy_px: (N, 4) left, top, right, bottom in the network's input; 0 is the edge of its first pixel.
        probability: (N, C) of each label, 0 to 1.
        foot_px: (N, 2) ground points in the network's input; left out: the network gives none.
        foot_sigma_px: (N, 2) their standard errors across and down.
    """

    xyxy_px: FloatArray
    probability: npt.NDArray[np.floating]
    foot_px: FloatArray = field(default_factory=lambda: unknown_points(0))
    foot_sigma_px: FloatArray = field(default_factory=lambda: unknown_points(0))


@dataclass(frozen=True, slots=True)
class OutputReader:
    """How to read a network.

    Attributes:
        names: The outputs to compute.
        read: From them, and the least probability that matters, to candidates.
    """

    names: tuple[str, ...]
    read: Callable[[list[Output], float], Candidates]


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
    found = _candidates(rows[:, 0:2].astype(np.float64), rows[:, 2:4].astype(np.float64), _probability(rows))
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
    if interface.family != "detr":
        return _yolo_reader(interface, trial)
    if any(_is_integer_list(output) for output in trial.values()):
        return _labels_reader(interface, trial, knows_size)
    return _logits_reader(interface, trial)


def check_candidates(found: Candidates) -> None:
    """Refuse what cannot be boxes and probabilities.

    Raises:
        UnreadableOutputs: There is NaN, or a probability below 0 or above 1.
    """
    if np.isnan(found.xyxy_px).any():
        raise UnreadableOutputs("numbers", "NaN")
    _check_probability(found.probability)


def _check_probability(values: npt.NDArray[np.floating]) -> None:
    if not values.size:
        return
    least, most = values.min(), values.max()
    if np.isnan(most):
        raise UnreadableOutputs("numbers", "NaN")
    if least < 0 or most > _LARGEST_PROBABILITY:
        raise UnreadableOutputs("probabilities, 0 to 1,", f"{least:.3g} to {most:.3g}")


def _candidates(centre: FloatArray, size: FloatArray, probability: npt.NDArray[np.floating]) -> Candidates:
    half = size / 2.0
    return Candidates(np.concatenate([centre - half, centre + half], axis=1), probability)


def _probability(rows: Output) -> npt.NDArray[np.floating]:
    probability: npt.NDArray[np.floating] = rows[:, _CLASSES_FROM:] * rows[:, 4:_CLASSES_FROM]
    return probability


def _yolo_reader(interface: Interface, trial: Mapping[str, Output]) -> OutputReader:
    classes = len(interface.classes)
    name = _find("rows", lambda output: _is_table(output, _CLASSES_FROM + classes), interface, trial)
    rows = trial[name][0].astype(np.float64)
    _check_probability(rows[:, 4:])
    if interface.family == "yolov3":
        return OutputReader((name,), read_rows)
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
    return _candidates((rows[:, :2] + cells[:, :2]) * cells[:, 2:], size_px, _probability(rows))


def _labels_reader(interface: Interface, trial: Mapping[str, Output], knows_size: bool) -> OutputReader:
    if not knows_size:
        raise UnreadableOutputs("an integer input (1, 2) for the picture's size beside boxes in its pixels", "none")
    names = (
        _find("labels", _is_integer_list, interface, trial),
        _find("boxes", lambda output: _is_table(output, 4), interface, trial),
        _find("scores", lambda output: output.ndim == 2 and output.dtype.kind == "f", interface, trial),
    )
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
    boxes_name = _find("boxes", lambda output: _is_table(output, 4), interface, trial)
    others = {name: output for name, output in trial.items() if name != boxes_name}
    names = boxes_name, _find("logits", lambda output: _is_table(output, len(interface.classes)), interface, others)
    if trial[boxes_name].size and np.abs(trial[boxes_name]).max() > _LARGEST_PART:
        largest = np.abs(trial[boxes_name]).max()
        raise UnreadableOutputs(f"boxes as parts of the input, 0 to 1, in '{boxes_name}'", f"{largest:.4g}")
    whole_px = np.array([*interface.input_size_px], dtype=np.float64)

    def read(outputs: list[Output], least: float) -> Candidates:
        boxes, logits = (output[0].astype(np.float64) for output in outputs)
        probability = expit(logits)
        wanted = ~(probability.max(axis=1) < least)
        boxes = boxes[wanted]
        return _candidates(boxes[:, :2] * whole_px, boxes[:, 2:] * whole_px, probability[wanted])

    return OutputReader(names, read)


def _is_table(output: Output, columns: int) -> bool:
    return output.ndim == 3 and output.shape[2] == columns and output.dtype.kind == "f"


def _is_integer_list(output: Output) -> bool:
    return output.ndim == 2 and output.dtype.kind in "iu"


_SHAPES: Final = {
    "rows": "rows (1, N, 5 + classes)",
    "labels": "integer labels (1, N)",
    "scores": "scores (1, N)",
    "logits": "logits (1, N, classes)",
    "boxes": "boxes (1, N, 4)",
}


def _find(role: str, fits: Callable[[Output], bool], interface: Interface, trial: Mapping[str, Output]) -> str:
    """Return the name of the one output that can have a role."""
    said = interface.output_names.get(role)
    names = [name for name, output in trial.items() if fits(output) and said in (None, name)]
    if role == "boxes" and len(names) > 1:
        # The logits of four classes look like boxes, too.
        names = [name for name in names if any(word in name.lower() for word in _NAMES_OF_BOXES)]
    if len(names) != 1:
        found = ", ".join(f"{name} {output.shape} {output.dtype}" for name, output in trial.items())
        raise UnreadableOutputs(f"one output of {_SHAPES[role]} with {len(interface.classes)} classes", found)
    return names[0]
