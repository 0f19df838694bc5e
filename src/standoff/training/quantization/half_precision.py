"""Store a detector's weights in half precision: half the file, the same speed.

Each weight becomes a float16 constant and a cast to float32, which ONNX Runtime computes once when it loads the
model. Nothing is computed in half precision, so that results differ by the rounding of the weights alone.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import onnx
import onnxruntime

from standoff.core.errors import ModelError
from standoff.files.whole import whole_file
from standoff.stages.detect import BOXES_OUTPUT, PICTURE_INPUT, ModelCard, open_session
from standoff.training.quantization.onnx_file import read_own_model

_WEIGHTED = frozenset({"Conv", "ConvTranspose", "Gemm", "MatMul"})
_LARGEST_BOX_SHIFT = 1e-2
"""In parts of the input's side, of boxes that somebody may look at."""
_SEEN_SCORE = 1e-2
"""Where nothing is, a box may be anything: a network was never told what it should be there."""
_LARGEST_SCORE_SHIFT = 3e-2
"""Measured: 0.015 for 80 classes on blotches, 0.003 on photographs."""
_TRIALS = 4
_BLOTCHES = (9, 16)

_Floats = npt.NDArray[np.float32]


def store_half(model_in: Path, model_out: Path) -> None:
    """Store the weights of a detector as float16; its input and output stay float32.

    Args:
        model_in: Made by `standoff export` or `standoff train`.
        model_out: The smaller file; appears only when complete, and replaces an older one.

    Raises:
        ModelError: It is no such model, has no float32 weights, or its boxes or scores would move too far.
        OutputError: The file cannot be written.
    """
    model, card = read_own_model(model_in)
    if not halve_weights(model.graph):
        raise ModelError(
            expected=f"float32 weights in {model_in.name}",
            found="none: they are stored smaller already",
            fix="give the model as `standoff export` made it",
        )
    with whole_file(model_out) as path:
        onnx.save(model, str(path))
        box_shift, score_shift = largest_shifts(model_in, path, card)
        if not (box_shift <= _LARGEST_BOX_SHIFT and score_shift <= _LARGEST_SCORE_SHIFT):
            raise ModelError(
                expected=f"boxes within {_LARGEST_BOX_SHIFT:g} of the input and scores within {_LARGEST_SCORE_SHIFT:g} "
                f"of {model_in.name}'s with weights in half precision",
                found=f"{box_shift:.3g} and {score_shift:.3g}",
                fix="keep its weights in float32",
            )


def halve_weights(graph: onnx.GraphProto) -> int:
    """Replace weights in place; return how many."""
    wanted = {name for node in graph.node if node.op_type in _WEIGHTED for name in node.input[1:]}
    tensors = [
        tensor
        for tensor in graph.initializer
        if tensor.name in wanted and tensor.data_type == onnx.TensorProto.FLOAT and len(tensor.dims) > 1
    ]
    casts = []
    for tensor in tensors:
        name = tensor.name
        half_name = f"{name}.half"
        with np.errstate(over="ignore"):  # what becomes infinite is noticed in the results
            half = onnx.numpy_helper.to_array(tensor).astype(np.float16)
        tensor.CopyFrom(onnx.numpy_helper.from_array(half, half_name))
        casts.append(onnx.helper.make_node("Cast", [half_name], [name], f"{name}.cast", to=onnx.TensorProto.FLOAT))
    nodes = [*casts, *graph.node]
    del graph.node[:]
    graph.node.extend(nodes)
    return len(casts)


def largest_shifts(model_a: Path, model_b: Path, card: ModelCard) -> tuple[float, float]:
    """Compare two networks of the same card on drawn pictures.

    Returns:
        How far boxes with a score of 0.01 and more in either lie apart at most, in parts of the input's sides, and how
        far all scores (objectness times probability); infinite where one of them is not a number.
    """
    sessions = [open_session(path, "cpu", 0) for path in (model_a, model_b)]
    shifts = [_shifts(sessions, picture) for picture in _drawn_inputs(card.input_size_px)]
    box_shift, score_shift = np.nan_to_num(shifts, nan=np.inf).max(axis=0)
    return float(box_shift), float(score_shift)


def _shifts(sessions: list[onnxruntime.InferenceSession], picture: _Floats) -> tuple[float, float]:
    rows_a, rows_b = (session.run([BOXES_OUTPUT], {PICTURE_INPUT: picture})[0][0] for session in sessions)
    height, width = picture.shape[2:]
    boxes = np.abs(rows_a[:, :4] - rows_b[:, :4]) / np.array([width, height, width, height])
    scores_a, scores_b = (rows[:, 4:5] * rows[:, 5:] for rows in (rows_a, rows_b))
    is_seen = ~(np.maximum(scores_a, scores_b).max(axis=1) < _SEEN_SCORE)
    return float(boxes[is_seen].max(initial=0.0)), float(np.abs(scores_a - scores_b).max())


def _drawn_inputs(size_px: tuple[int, int]) -> list[_Floats]:
    """Return inputs with soft blotches of all colours: what a picture of anything looks like to a network."""
    rng = np.random.default_rng(0)
    blotches = rng.random((_TRIALS, *_BLOTCHES, 3), dtype=np.float32)
    drawn = [np.clip(cv2.resize(one, size_px, interpolation=cv2.INTER_CUBIC), 0.0, 1.0) for one in blotches]
    return [np.ascontiguousarray(one.transpose(2, 0, 1)[None]) for one in drawn]
