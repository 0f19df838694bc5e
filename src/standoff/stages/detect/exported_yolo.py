"""Read the outputs that Ultralytics documents for its exports, and what others export in the same layouts.

A row ends with what its task needs besides boxes, which is not read: the coefficients of a mask (as many as the other,
four-dimensional output has channels), key points, or an angle. With an angle, the box is the one around the turned one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from standoff.core.homography import FloatArray
from standoff.stages.detect.candidates import (
    Candidates,
    Output,
    OutputReader,
    UnreadableOutputs,
    are_parts,
    candidates_from_centres,
    check_probability,
    find_output,
    is_table,
)
from standoff.stages.detect.interface import Interface

_BOX: Final = 4
_LEAST_BOX_PX: Final = 2.0
"""What ends before this is no thing in the corner of the picture, but a box as parts of the input."""


def more_columns(interface: Interface, trial: Mapping[str, Output]) -> int:
    """Return how many columns a row has besides its box and its classes, for the network's task."""
    match interface.task:
        case "pose":
            return interface.keypoint_values
        case "obb":
            return 1
        case _:
            masks = [output for output in trial.values() if output.ndim == 4]
            return masks[0].shape[1] if len(masks) == 1 else 0


def rows_reader(interface: Interface, trial: Mapping[str, Output]) -> OutputReader:
    """Read (1, N, 5 + C): centre, size, objectness, class probabilities.

    Raises:
        UnreadableOutputs: There is no such output, or its numbers cannot be those.
    """
    classes = len(interface.classes)
    columns = 1 + _BOX + classes + more_columns(interface, trial)
    name = find_output("rows", "rows (1, N, 5 + classes)", lambda output: is_table(output, columns), interface, trial)
    check_probability(trial[name][0][:, _BOX : _BOX + 1 + classes])
    scale, is_parts = _scale(trial[name][0][:, :_BOX], interface)

    def read(outputs: list[Output], least: float) -> Candidates:
        rows = outputs[0][0]
        # NaN stays in, to be noticed; no class can be surer than the object itself.
        rows = rows[~(rows[:, _BOX] < least)]
        probability = rows[:, _BOX + 1 : _BOX + 1 + classes] * rows[:, _BOX : _BOX + 1]
        return _upright(rows, probability, scale, interface)

    return OutputReader((name,), read, is_parts)


def columns_reader(interface: Interface, trial: Mapping[str, Output]) -> OutputReader:
    """Read (1, 4 + C, N): centre and size, class probabilities; a box is a column, or a row after some conversions.

    Raises:
        UnreadableOutputs: There is no such output, or its numbers cannot be those.
    """
    classes = len(interface.classes)
    shape, count = "rows (1, 4 + classes, N)", _BOX + classes + more_columns(interface, trial)

    def is_either(output: Output) -> bool:
        return is_columns(output, count) or is_table(output, count)

    name = find_output("rows", shape, is_either, interface, trial)
    if is_columns(trial[name], count):
        return _probabilities_reader(name, trial[name][0].T, lambda outputs: outputs[0][0].T, interface)
    return _probabilities_reader(name, trial[name][0], lambda outputs: outputs[0][0], interface)


def probabilities_reader(interface: Interface, trial: Mapping[str, Output]) -> OutputReader:
    """Read (1, N, 4 + C): centre and size as parts of the input, class probabilities.

    Raises:
        UnreadableOutputs: There is no such output, or its numbers cannot be those.
    """
    count = _BOX + len(interface.classes)
    name = find_output("rows", "rows (1, N, 4 + classes)", lambda output: is_table(output, count), interface, trial)
    return _probabilities_reader(name, trial[name][0], lambda outputs: outputs[0][0], interface)


def ends_reader(interface: Interface, trial: Mapping[str, Output]) -> OutputReader:
    """Read (1, N, 6): corners, score, label of what the network itself has chosen; rows of zeros are none.

    With an angle the first four are centre and size.

    Raises:
        UnreadableOutputs: There is no such output, or its numbers cannot be those.
    """
    classes = len(interface.classes)
    columns = _BOX + 2 + more_columns(interface, trial)
    name = find_output("rows", "rows (1, N, 6)", lambda output: is_table(output, columns), interface, trial)
    scale, is_parts = _scale(trial[name][0][:, :_BOX], interface)
    is_sure_of_unit = bool(np.any(trial[name][0][:, :_BOX]))

    def read(outputs: list[Output], least: float) -> Candidates:
        rows = outputs[0][0]
        score, label = rows[:, _BOX], rows[:, _BOX + 1]
        if not np.all((label >= 0) & (label < classes) & (label == np.floor(label))):
            expected = f"labels 0 to {classes - 1} in the sixth column, of {classes} classes"
            raise UnreadableOutputs(expected, f"{np.min(label):.4g} to {np.max(label):.4g}")
        wanted = ~(score < least) & (score != 0)
        rows = rows[wanted]
        probability = np.zeros((len(rows), classes))
        probability[np.arange(len(rows)), rows[:, _BOX + 1].astype(np.int64)] = rows[:, _BOX]
        if interface.task == "obb":
            found = _upright(rows, probability, scale, interface)
        else:
            found = Candidates(rows[:, :_BOX].astype(np.float64) * scale, probability)
        if not is_sure_of_unit and len(rows) and np.abs(found.xyxy_px).max() <= _LEAST_BOX_PX:
            raise UnreadableOutputs("boxes in pixels of the input", f"none beyond {np.abs(found.xyxy_px).max():.3g}")
        return found

    read([trial[name]], 0.0)
    return OutputReader((name,), read, is_parts)


def is_columns(output: Output, count: int) -> bool:
    """Tell whether an output is (1, count, N) of floats."""
    return output.ndim == 3 and output.shape[0] == 1 and output.shape[1] == count and output.dtype.kind == "f"


def _probabilities_reader(
    name: str, trial_rows: Output, rows_of: Callable[[list[Output]], Output], interface: Interface
) -> OutputReader:
    classes = slice(_BOX, _BOX + len(interface.classes))
    check_probability(trial_rows[:, classes])
    scale, is_parts = _scale(trial_rows[:, :_BOX], interface)

    def read(outputs: list[Output], least: float) -> Candidates:
        rows = rows_of(outputs)
        # NaN stays in, to be noticed.
        rows = rows[~(rows[:, classes].max(axis=1) < least)]
        return _upright(rows, rows[:, classes], scale, interface)

    return OutputReader((name,), read, is_parts and interface.family != "detr")


def _scale(boxes: Output, interface: Interface) -> tuple[FloatArray, bool]:
    """Return (4,) what boxes are multiplied by to be in input pixels, and whether they are parts of the input."""
    is_parts = are_parts(boxes)
    if interface.family == "detr" and not is_parts:
        if boxes.any():
            raise UnreadableOutputs("boxes as parts of the input, 0 to 1,", f"{np.abs(boxes).max():.4g}")
        is_parts = True
    return np.tile(np.array(interface.input_size_px if is_parts else (1, 1), dtype=np.float64), 2), is_parts


def _upright(rows: Output, probability: Output, scale: FloatArray, interface: Interface) -> Candidates:
    """Return candidates of rows of centre and size; around turned boxes where the last column is their angle."""
    boxes = rows[:, :_BOX].astype(np.float64) * scale
    centre, size = boxes[:, :2], boxes[:, 2:]
    if interface.task == "obb":
        cosine, sine = (np.abs(turn(rows[:, -1].astype(np.float64))) for turn in (np.cos, np.sin))
        size = np.stack([size[:, 0] * cosine + size[:, 1] * sine, size[:, 0] * sine + size[:, 1] * cosine], axis=1)
    return candidates_from_centres(centre, size, probability)
