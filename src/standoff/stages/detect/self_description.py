"""What Ultralytics' exports say of themselves in an ONNX file's metadata, and which layout they chose.

The texts are `names` (a Python literal: id to name, or a list), and, newer than YOLOv5: `task`, `imgsz` ([height,
width]), `stride`, `kpt_shape` ([points, values]) and `end2end`. Which of its layouts a file has is not among them: the
shapes of a trial run tell, and where two layouts have one shape, its numbers.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, cast, get_args

import numpy as np

from standoff.core.errors import ModelError
from standoff.stages.detect.candidates import Output, UnreadableOutputs, are_parts, is_table, listed_outputs
from standoff.stages.detect.exported_yolo import is_columns, more_columns
from standoff.stages.detect.interface import Family, Interface, Task

_NAMES: Final = "names"
_STRIDES_PX: Final = ((8, 16, 32), (8, 16, 32, 64), (16, 32), (4, 8, 16, 32))
_LONGEST_TEXT: Final = 1_000_000
_BYTE_ORDER_MARK: Final = "\ufeff"


@dataclass(frozen=True, slots=True)
class SelfDescription:
    """What a file says of itself.

    Attributes:
        classes: Labels in the order of its outputs.
        input_size_px: (width, height), if it says so.
        task: What it was trained for; "detect" where it does not say.
        keypoint_values: Numbers for the key points of one box.
        chooses: It says that it suppresses duplicates by itself.
    """

    classes: tuple[str, ...]
    input_size_px: tuple[int, int] | None
    task: Task
    keypoint_values: int
    chooses: bool

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str], name: str) -> SelfDescription | None:
        """Read the file's texts.

        Args:
            metadata: Of the ONNX file.
            name: The file, for messages.

        Returns:
            None where it says nothing of the kind.

        Raises:
            ModelError: It does, but not in a form that can be read; or its task has no boxes.

        >>> SelfDescription.from_metadata({"names": "{0: 'person', 1: 'car'}", "imgsz": "[384, 640]"}, "m.onnx").classes
        ('person', 'car')
        """
        if _NAMES not in metadata:
            return None
        try:
            size = _literal(metadata.get("imgsz", "None"))
            return cls(
                classes=_classes(_literal(metadata[_NAMES])),
                input_size_px=None if size is None else _size(size),
                task=_task(metadata.get("task", "detect")),
                keypoint_values=int(np.prod(_integers(_literal(metadata.get("kpt_shape", "[0, 0]"))))),
                chooses=metadata.get("end2end") == "True",
            )
        except ValueError as error:
            raise ModelError(
                expected=f"names, task and size in the metadata of {name} as Ultralytics' exports have them",
                found=str(error),
                fix="write a description beside it, see 'Detectors from elsewhere' in the documentation; "
                "or export the model again",
            ) from error

    def family(self, known: Interface, trial: Mapping[str, Output]) -> Family:
        """Tell the layout from what the network gave for an empty picture.

        Raises:
            UnreadableOutputs: It is none of those known, or may be two of them.
        """
        possible = _possible(known, trial)
        if len(possible) > 1:
            in_grid = {family: rows for family, rows in possible.items() if _fits_grid(family, len(rows), known)}
            possible = in_grid or {family: possible[family] for family in possible.keys() & {"yolov10", "detr"}}
        if possible.keys() == {"yolov10", "detr"}:
            return "yolov10" if self.chooses or _is_choice(possible["yolov10"]) else "detr"
        if len(possible) != 1:
            count, more = len(self.classes), more_columns(known, trial)
            raise UnreadableOutputs(
                f"an output of {4 + count + more} columns, or rows of {5 + count + more}, {6 + more} or {4 + count}, "
                f"for the {count} names and the task '{self.task}' of its metadata,",
                listed_outputs(trial),
            )
        return next(iter(possible))


def _possible(known: Interface, trial: Mapping[str, Output]) -> dict[Family, Output]:
    """Return the layouts that an output has the shape of, with its (N, ...) boxes."""
    count, more = len(known.classes), more_columns(known, trial)
    found: dict[Family, Output] = {}
    for output in trial.values():
        if is_columns(output, 4 + count + more):
            found["yolov8"] = output[0].T
        if is_table(output, 5 + count + more):
            found["yolov5"] = output[0]
        if is_table(output, 6 + more):
            found["yolov10"] = output[0]
        if is_table(output, 4 + count + more):
            # Some tools turn the table over; of boxes that the network has chosen there are far fewer than cells.
            boxes = output[0][:, :4]
            if _fits_grid("yolov8", len(boxes), known) or (boxes.any() and not are_parts(boxes)):
                found["yolov8"] = output[0]
            elif known.task == "detect" and not more:
                found["detr"] = output[0]
    return found


def _fits_grid(family: Family, rows: int, known: Interface) -> bool:
    """Tell whether there are as many rows as cells, or three times as many in the layout that has anchors."""
    if family not in ("yolov5", "yolov8"):
        return False
    width_px, height_px = known.input_size_px
    cells = {sum(-(-width_px // side) * -(-height_px // side) for side in sides) for sides in _STRIDES_PX}
    return (rows / 3 if family == "yolov5" else rows) in cells


def _is_choice(rows: Output) -> bool:
    """Tell corners, score and label from a box as parts of the input and two probabilities."""
    if not rows[:, :4].any() or not are_parts(rows[:, :4]):
        return True
    if np.array_equal(rows[:, 5], np.floor(rows[:, 5])):
        raise UnreadableOutputs(
            "rows that tell whether they end in score and label or in two probabilities", "ones that may be either"
        )
    return False


def _literal(text: str) -> Any:  # noqa: ANN401 - whatever the file says
    if len(text) > _LONGEST_TEXT:
        raise ValueError(f"{len(text)} characters")
    try:
        return ast.literal_eval(text.strip().lstrip(_BYTE_ORDER_MARK))
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError) as error:
        raise ValueError(f"'{text[:60]}'") from error


def _classes(names: object) -> tuple[str, ...]:
    if isinstance(names, list | tuple):
        names = dict(enumerate(names))
    if not isinstance(names, dict) or not names:
        raise ValueError("names that are neither a list nor ids with names")
    pairs = list(names.items())
    # JSON's keys are texts.
    names = {int(key) if isinstance(key, str) and key.isdecimal() else key: name for key, name in pairs}
    ids = [number for number in names if type(number) is int]
    if sorted(ids) != list(range(len(pairs))):
        raise ValueError(f"ids other than 0 to {len(pairs) - 1} in names")
    return tuple(str(names[number]).strip().lstrip(_BYTE_ORDER_MARK).strip() for number in range(len(names)))


def _integers(values: object) -> tuple[int, ...]:
    if not isinstance(values, list | tuple) or any(type(value) is not int or value < 0 for value in values):
        raise ValueError(f"'{str(values)[:60]}', which are not whole numbers")
    return tuple(values)


def _size(value: object) -> tuple[int, int]:
    sides = _integers([value, value] if isinstance(value, int) else value)
    if len(sides) != 2 or not all(1 <= side <= 8192 for side in sides):
        raise ValueError(f"imgsz {str(value)[:60]}, which is no height and width in pixels")
    return sides[1], sides[0]


def _task(text: str) -> Task:
    if text not in get_args(Task):
        raise ValueError(f"task '{text[:60]}', which gives no boxes (known: {', '.join(get_args(Task))})")
    return cast(Task, text)
