"""Tiny ONNX models in the formats of other projects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import onnx
from onnx import TensorProto, helper, numpy_helper

Array = npt.NDArray[Any]
PICTURE, SIZE = "images", "orig_target_sizes"
_TYPES = {np.dtype(np.float32): TensorProto.FLOAT, np.dtype(np.float16): TensorProto.FLOAT16}
_TYPES |= {np.dtype(np.uint8): TensorProto.UINT8, np.dtype(np.int64): TensorProto.INT64}
Shape = tuple[int | str, ...]


def save_graph(
    path: Path, nodes: list[Any], inputs: dict[str, Any], outputs: dict[str, Any], constants: dict[str, Array]
) -> Path:
    """Write a graph; inputs and outputs are names to (type, shape)."""
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info(name, _TYPES[np.dtype(kind)], shape) for name, (kind, shape) in inputs.items()],
        [helper.make_tensor_value_info(name, _TYPES[np.dtype(kind)], shape) for name, (kind, shape) in outputs.items()],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path


def save_constant(
    path: Path,
    outputs: dict[str, Array],
    size_px: tuple[int | str, int | str],
    picture_type: type[np.generic] = np.float32,
) -> Path:
    """Write a network that says the same of every picture; batch and output shapes are open, as exports leave them."""
    nodes = [helper.make_node("Identity", [f"{name}_value"], [name]) for name in outputs]
    return save_graph(
        path,
        nodes,
        {PICTURE: (picture_type, ("N", 3, size_px[1], size_px[0]))},
        {name: (value.dtype, tuple(f"{name}_{axis}" for axis in range(value.ndim))) for name, value in outputs.items()},
        {f"{name}_value": value for name, value in outputs.items()},
    )


def save_rtdetr(path: Path, labels: Array, parts_cxcywh: Array, scores: Array, size_px: tuple[int, int]) -> Path:
    """Write what RT-DETR's and D-FINE's export makes: boxes times the size that it is told, as corners."""
    corners = np.array([[1, 0, 1, 0], [0, 1, 0, 1], [-0.5, 0, 0.5, 0], [0, -0.5, 0, 0.5]], np.float32)
    nodes = [
        helper.make_node("Identity", ["labels_value"], ["labels"]),
        helper.make_node("Identity", ["scores_value"], ["scores"]),
        helper.make_node("MatMul", ["parts", "corners"], ["parts_xyxy"]),
        helper.make_node("Cast", [SIZE], ["size"], to=TensorProto.FLOAT),
        helper.make_node("Tile", ["size", "twice"], ["size_twice"]),
        helper.make_node("Unsqueeze", ["size_twice", "axis"], ["scale"]),
        helper.make_node("Mul", ["parts_xyxy", "scale"], ["boxes"]),
    ]
    count = scores.shape[1]
    return save_graph(
        path,
        nodes,
        {PICTURE: (np.float32, ("N", 3, size_px[1], size_px[0])), SIZE: (np.int64, ("N", 2))},
        {"labels": (np.int64, (1, count)), "boxes": (np.float32, ("N", count, 4)), "scores": (np.float32, (1, count))},
        {
            "labels_value": labels.astype(np.int64),
            "scores_value": scores.astype(np.float32),
            "parts": parts_cxcywh.astype(np.float32),
            "corners": corners,
            "twice": np.array([1, 2], np.int64),
            "axis": np.array([1], np.int64),
        },
    )


def save_bright_cells(path: Path, size_px: tuple[int, int], channel: int, picture_type: type[np.generic]) -> Path:
    """Write a raw YOLOX of one class: each cell holds a box of its own size, as sure as its first pixel is bright."""
    strides_px = (8, 16, 32)
    nodes, constants = [], {"starts": np.array([channel], np.int64), "ends": np.array([channel + 1], np.int64)}
    constants |= {"channels": np.array([1], np.int64), "flat": np.array([1, -1, 1], np.int64)}
    constants |= {"white": np.array(255, np.float32)}
    nodes.append(helper.make_node("Cast", [PICTURE], ["floats"], to=TensorProto.FLOAT))
    nodes.append(helper.make_node("Slice", ["floats", "starts", "ends", "channels"], ["one"]))
    nodes.append(helper.make_node("Div", ["one", "white"], ["bright"]))
    for side in strides_px:
        nodes.append(
            helper.make_node(
                "AveragePool", ["bright"], [f"mean{side}"], kernel_shape=[side, side], strides=[side, side]
            )
        )
        nodes.append(helper.make_node("Reshape", [f"mean{side}", "flat"], [f"flat{side}"]))
    nodes.append(helper.make_node("Concat", [f"flat{side}" for side in strides_px], ["objectness"], axis=1))
    nodes.append(helper.make_node("Concat", ["offsets", "objectness", "classes"], ["output"], axis=2))
    count = sum((size_px[0] // side) * (size_px[1] // side) for side in strides_px)
    constants["offsets"] = np.tile(np.array([0.5, 0.5, 0.0, 0.0], np.float32), (1, count, 1))
    constants["classes"] = np.ones((1, count, 1), np.float32)
    return save_graph(
        path,
        nodes,
        {PICTURE: (picture_type, (1, 3, size_px[1], size_px[0]))},
        {"output": (np.float32, (1, count, 6))},
        constants,
    )


def describe(model: Path, text: str) -> Path:
    """Put a description beside a model."""
    model.with_suffix(".yaml").write_text(text)
    return model
