"""What an ONNX graph takes, read off its declared inputs and outputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import onnxruntime

from standoff.core.errors import ModelError
from standoff.stages.detect.interface import Family
from standoff.stages.detect.model_card import BOXES_OUTPUT, PICTURE_INPUT, POINTS_OUTPUT, ModelCard

_PICTURE_TYPES: Final[dict[str, type[np.generic]]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(uint8)": np.uint8,
}
_SIZE_TYPES: Final[dict[str, type[np.generic]]] = {"tensor(int64)": np.int64, "tensor(int32)": np.int32}
_YOLO_COLUMNS: Final = 5
_POINT_COLUMNS: Final = 4
_YOLOX_STRIDES_PX: Final = (8, 16, 32)
_ANCHORS: Final = 3
_CHOSEN_COLUMNS: Final = 6
_MOST_CHOSEN: Final = 1000
"""Networks that choose by themselves give a few hundred boxes, those that do not some thousand."""


@dataclass(frozen=True, slots=True)
class GraphInputs:
    """What a graph takes.

    Attributes:
        picture: Name of the input (1, 3, height, width).
        dtype: Its type: float32, float16, or uint8, which takes the levels themselves.
        size_px: (width, height) if the graph fixes it.
        told_size: Name of the input (1, 2) that is told the picture's width and height, with its type, if any.
    """

    picture: str
    dtype: type[np.generic]
    size_px: tuple[int, int] | None
    told_size: tuple[str, type[np.generic]] | None

    @classmethod
    def of(cls, session: onnxruntime.InferenceSession, name: str) -> GraphInputs:
        """Tell the inputs apart by shape and type.

        Args:
            session: The loaded model.
            name: The model, for messages.

        Raises:
            ModelError: There is not one picture, or something else is asked for.
        """
        nodes = session.get_inputs()
        pictures = [node for node in nodes if _is_picture(node)]
        sizes = [node for node in nodes if node.type in _SIZE_TYPES and len(node.shape) == 2 and node.shape[1] == 2]
        if len(pictures) != 1 or len(sizes) > 1 or len(nodes) != len(pictures) + len(sizes):
            raise ModelError(
                expected=f"one input (1, 3, height, width) in {name}, float32, float16 or uint8, beside it at most an "
                "integer (1, 2) for the picture's size",
                found=", ".join(f"{node.name} {node.shape} {node.type}" for node in nodes) or "no input",
                fix="export the model for single pictures in this layout",
            )
        height_px, width_px = pictures[0].shape[2:]
        fixed = isinstance(height_px, int) and isinstance(width_px, int)
        return cls(
            picture=pictures[0].name,
            dtype=_PICTURE_TYPES[pictures[0].type],
            size_px=(width_px, height_px) if fixed else None,
            told_size=(sizes[0].name, _SIZE_TYPES[sizes[0].type]) if sizes else None,
        )

    def constant_feed(self, input_size_px: tuple[int, int]) -> dict[str, npt.NDArray[Any]]:
        """Return what is told besides the picture: the *input's* size, so that boxes come back in its pixels."""
        if self.told_size is None:
            return {}
        name, dtype = self.told_size
        return {name: np.array([input_size_px], dtype=dtype)}


def _is_picture(node: onnxruntime.NodeArg) -> bool:
    shape = node.shape
    return (
        node.type in _PICTURE_TYPES
        and len(shape) == 4
        and shape[1] == 3
        and (shape[0] == 1 or not isinstance(shape[0], int))
    )


def check_own_graph(session: onnxruntime.InferenceSession, card: ModelCard, name: str) -> None:
    """Check that a graph is what its metadata says.

    Raises:
        ModelError: Its tensors are others.
    """
    width_px, height_px = card.input_size_px
    found = {node.name: node.shape for node in (*session.get_inputs(), *session.get_outputs())}
    rows = next(iter(found.get(BOXES_OUTPUT, [])[1:2]), "N")
    expected = {PICTURE_INPUT: [1, 3, height_px, width_px], BOXES_OUTPUT: [1, rows, _YOLO_COLUMNS + len(card.classes)]}
    if POINTS_OUTPUT in found:
        expected[POINTS_OUTPUT] = [1, rows, _POINT_COLUMNS]
    if found != expected:
        raise ModelError(
            expected=f"the tensors {expected} in {name}, as its metadata says",
            found=f"{found}",
            fix="make the file with `standoff export`",
        )


def suggested_description(session: onnxruntime.InferenceSession, inputs: GraphInputs) -> str:
    """Write the YAML that a graph seems to need, in one line."""
    size = "" if inputs.size_px else ", input_size: 640x640"
    return f"{{family: {_likely_family(session, inputs)}, classes: labels.txt{size}}}"


def _likely_family(session: onnxruntime.InferenceSession, inputs: GraphInputs) -> Family:
    shapes = [output.shape for output in session.get_outputs()]
    tables = [shape for shape in shapes if len(shape) == 3]
    if len(tables) != 1 or any(len(shape) < 3 for shape in shapes):
        return "detr"
    rows, columns = tables[0][1:]
    if not isinstance(rows, int):
        return "yolox"
    if isinstance(columns, int) and rows < columns:
        return "yolov8"
    if columns == _CHOSEN_COLUMNS and rows <= _MOST_CHOSEN:
        return "yolov10"
    if inputs.size_px is None:
        return "yolox"
    width_px, height_px = inputs.size_px
    cells = sum((width_px // stride_px) * (height_px // stride_px) for stride_px in _YOLOX_STRIDES_PX)
    if rows == cells:
        return "yolox"
    return "yolov5" if rows == _ANCHORS * cells else "yolov3"
