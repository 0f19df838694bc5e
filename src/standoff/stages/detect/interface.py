"""What must be known of a network to use it, and the YAML file that says it of a foreign one.

A model that `standoff export` or `standoff train` made says it all itself (`standoff.stages.detect.model_card`), and so
does one that Ultralytics exported (`standoff.stages.detect.self_description`). Beside another `M.onnx` lies `M.yaml`:

    family: yolox            # yolov3, yolov5, yolov8, yolov10, yolox or detr; see standoff.stages.detect.outputs
    classes: coco.names      # a list, or a file with one label a line, beside this one; in the order of the outputs
    input_size: 640x640      # width x height; only where the graph leaves it open
    # What follows has the family's usual value where it is not given:
    colour: bgr              # order of the channels: rgb or bgr
    white: 255               # value of the brightest level: 1 or 255
    mean: [0, 0, 0]          # subtracted from each channel, on that scale; then divided by std
    std: [1, 1, 1]
    placement: top-left      # of the scaled picture: centre, top-left, or stretch: fill the input
    pad: 114                 # level around it, 0 to 255
    outputs: {rows: output}  # only where shapes do not tell: rows, or boxes and logits, or boxes, labels and scores

Where the model says of itself what it is, everything may be left out, and what is said here goes before.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal, get_args

from standoff.core.classes import names_by_line, names_in_list
from standoff.core.errors import ModelError
from standoff.files.plain_text import read_text
from standoff.files.yaml_text import read_yaml
from standoff.stages.detect.letterbox import DARKNET, Colour, Placement, Preprocessing

Family = Literal["yolov3", "yolov5", "yolov8", "yolov10", "yolox", "detr"]
Task = Literal["detect", "segment", "pose", "obb"]

ROLES: Final = ("rows", "boxes", "logits", "labels", "scores")
_GREY_AROUND: Final = Preprocessing(pad=114.0)
USUAL: Final[Mapping[Family, Preprocessing]] = {
    "yolov3": DARKNET,
    "yolov5": _GREY_AROUND,
    "yolov8": _GREY_AROUND,
    "yolov10": _GREY_AROUND,
    "yolox": Preprocessing(colour="bgr", white=255.0, placement="top-left", pad=114.0),
    "detr": Preprocessing(placement="stretch"),
}
"""YOLOX: `preproc` of its repository, since version 0.1.1; RT-DETR and D-FINE: their training's Resize and ToTensor."""


@dataclass(frozen=True, slots=True)
class Interface:
    """How to talk to a network.

    Attributes:
        family: What its outputs mean.
        classes: Labels in the order of its outputs.
        input_size_px: (width, height).
        preprocessing: What it wants of a picture.
        output_names: Role to name, where shapes do not tell.
        task: What else than boxes its rows end with.
        keypoint_values: Numbers for the key points of a box, if that is the task.
        finds_workers: As in `standoff.stages.detect.model_card.ModelCard`.
    """

    family: Family
    classes: tuple[str, ...]
    input_size_px: tuple[int, int]
    preprocessing: Preprocessing = DARKNET
    output_names: Mapping[str, str] = field(default_factory=dict)
    task: Task = "detect"
    keypoint_values: int = 0
    finds_workers: Mapping[str, Sequence[float]] = field(default_factory=dict)

    @property
    def finds_once(self) -> bool:
        """Whether the network gives each thing once, surest first, and not once for each cell that sees it."""
        return self.family in ("detr", "yolov10")


@dataclass(frozen=True, slots=True)
class Description:
    """What is said of a model beside it; whatever is None or empty is not said.

    Attributes:
        family: What its outputs mean.
        classes: Labels in the order of its outputs.
        input_size_px: (width, height).
        preprocessing: Fields of `Preprocessing` that differ from the family's usual ones.
        output_names: Role to name.
    """

    family: Family | None = None
    classes: tuple[str, ...] = ()
    input_size_px: tuple[int, int] | None = None
    preprocessing: Mapping[str, Any] = field(default_factory=dict)
    output_names: Mapping[str, str] = field(default_factory=dict)

    def over(self, known: Interface) -> Interface:
        """Return an interface with what is said here put before what it says."""
        return replace(
            known,
            classes=self.classes or known.classes,
            preprocessing=replace(USUAL[known.family], **self.preprocessing),
            output_names=self.output_names or known.output_names,
        )


def read_description(path: Path) -> Description:
    """Read the description that lies beside a model.

    Raises:
        ModelError: The file cannot be read.
    """
    try:
        return _description(_parsed(path), path)
    except ValueError as error:
        raise undescribed(path, str(error)) from error


def undescribed(path: Path, found: str) -> ModelError:
    """Return the error of a description that does not do."""
    fix = "see 'Detectors from elsewhere' in the documentation"
    return ModelError(expected=f"the description of a detector in {path}", found=found, fix=fix)


def _parsed(path: Path) -> dict[str, Any]:
    content = read_yaml(path, "the description of a detector", ModelError)
    if not isinstance(content, dict):
        raise ValueError("no `key: value` lines")
    unknown = [str(key) for key in content if key not in _READERS]
    if unknown:
        raise ValueError(f"unknown {', '.join(unknown)} (known: {', '.join(_READERS)})")
    return {key: _READERS[key](key, value) for key, value in content.items()}


def _description(said: dict[str, Any], path: Path) -> Description:
    classes = said.pop("classes", ())
    return Description(
        family=said.pop("family", None),
        classes=_labels(path.parent / classes) if isinstance(classes, str) else classes,
        input_size_px=said.pop("input_size", None),
        output_names=said.pop("outputs", {}),
        preprocessing=said,
    )


def _labels(path: Path) -> tuple[str, ...]:
    labels = names_by_line(read_text(path, "a file of labels", ModelError))
    if not labels:
        raise ValueError(f"no label in {path.name}")
    return labels


def times(size_px: tuple[int, int]) -> str:
    """Write a size as descriptions do.

    >>> times((640, 384))
    '640x384'
    """
    return f"{size_px[0]}x{size_px[1]}"


def _classes(key: str, value: object) -> str | tuple[str, ...]:
    if isinstance(value, str):
        return value
    if not isinstance(value, list) or not value:
        raise ValueError(f"{key} that are neither a list of labels nor a file's name")
    return names_in_list(value)


def _size(key: str, value: object) -> tuple[int, int]:
    sides = re.fullmatch(r"([1-9]\d*)\s*x\s*([1-9]\d*)", str(value))
    if sides is None:
        raise ValueError(f"{key} {value}, which is not like 640x640")
    return int(sides[1]), int(sides[2])


def _one_of(*allowed: object) -> Callable[[str, object], object]:
    def read(key: str, value: object) -> object:
        if value not in allowed:
            raise ValueError(f"{key} {value}, which is none of {', '.join(map(str, allowed))}")
        return value

    return read


def _level(key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 255:
        raise ValueError(f"{key} {value}, which is not a level from 0 to 255")
    return float(value)


def _three(key: str, value: object) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != 3:
        raise ValueError(f"{key} {value}, which are not three numbers")
    return tuple(_level(key, part) for part in value)


def _spread(key: str, value: object) -> tuple[float, ...]:
    numbers = _three(key, value)
    if min(numbers) <= 0:
        raise ValueError(f"{key} {value}, which are not all above 0")
    return numbers


def _outputs(key: str, value: object) -> dict[str, str]:
    if not isinstance(value, dict) or not set(value) <= set(ROLES):
        raise ValueError(f"{key} {value}, which do not give names to some of {', '.join(ROLES)}")
    return {role: str(name) for role, name in value.items()}


_READERS: Final[Mapping[str, Callable[[str, object], Any]]] = {
    "family": _one_of(*get_args(Family)),
    "classes": _classes,
    "input_size": _size,
    "colour": _one_of(*get_args(Colour)),
    "white": _one_of(1, 255),
    "mean": _three,
    "std": _spread,
    "placement": _one_of(*get_args(Placement)),
    "pad": _level,
    "outputs": _outputs,
}
