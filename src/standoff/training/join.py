"""Join detectors into one: several networks in one ONNX file, each answering for the classes that it knows best.

A network that learnt machines from rendered sites and one that still knows real people make one detector that knows
both. Each sees the same input; their boxes are put one after another, and the suppression of overlapping boxes of one
class, which follows every detector, merges what both have found. Where one gives no ground points, its boxes have none.
Scores of two networks mean different things: a factor for the one that is wrong more often lets the other be heard
first. The time a picture takes is the sum of theirs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import onnx

from standoff.core.errors import ConfigError, ModelError
from standoff.files.fingerprint import file_sha256
from standoff.files.whole import whole_file
from standoff.stages.detect import BOXES_OUTPUT, PICTURE_INPUT, POINTS_OUTPUT, ModelCard
from standoff.training.quantization.onnx_file import read_own_model

_BOX_COLUMNS = 5
"""Centre, sides and objectness, before the classes."""

_ALL = "all"

_Floats = npt.NDArray[np.float32]
_Model = tuple[onnx.ModelProto, ModelCard]


def join_models(parts: Sequence[tuple[Path, Mapping[str, float]]], out: Path) -> ModelCard:
    """Join detectors of the same classes and input size.

    Args:
        parts: Each file, made by `standoff export` or `standoff train`, and the classes that it answers for with the
            factor, over 0 to 1, of their scores; `all` is every class that is not named, and nothing means all.
        out: The ONNX file; appears only when complete, and replaces an older one.

    Returns:
        What the file says about itself.

    Raises:
        ConfigError: There are fewer than two parts, a part does not know a class, nobody answers for one, or a factor
            is out of its range.
        ModelError: A part is no such model, or differs in its classes, input size or operators from the first.
        OutputError: The file cannot be written.
    """
    if len(parts) < 2:
        raise ConfigError(
            expected="two models or more to join",
            found=str(len(parts)),
            fix="write for example machines.onnx=excavator,vehicle people.onnx=worker",
        )
    read = [read_own_model(path) for path, _ in parts]
    for (path, _), other in zip(parts[1:], read[1:], strict=True):
        _check_alike(parts[0][0], path, (read[0], other))
    models, cards = [model for model, _ in read], [card for _, card in read]
    classes = cards[0].classes
    factors = [_factors(path, named, classes) for path, named in parts]
    silent = [name for name, heard in zip(classes, np.max(factors, axis=0), strict=True) if not heard]
    if silent:
        raise ConfigError(
            expected="a model that answers for each class",
            found=f"none for {', '.join(silent)}",
            fix="name the class after one of the models, or name none to take all of its classes",
        )
    card = ModelCard(
        classes=classes,
        anchors_px=tuple(anchors for card in cards for anchors in card.anchors_px),
        input_size_px=cards[0].input_size_px,
        # Runs call their models alike: the folder tells them apart.
        sources={f"{path.resolve().parent.name}/{path.name}": file_sha256(path) for path, _ in parts},
    )
    joined = _joined(models, factors)
    onnx.helper.set_model_props(joined, card.to_metadata())
    with whole_file(out) as path:
        onnx.save(joined, str(path))
    return card


def _check_alike(first: Path, other: Path, read: tuple[_Model, _Model]) -> None:
    (model_a, card_a), (model_b, card_b) = read
    for what, wanted, found in (
        ("classes", card_a.classes, card_b.classes),
        ("input size", card_a.input_size_px, card_b.input_size_px),
        ("operators", _operators(model_a), _operators(model_b)),
    ):
        if wanted != found:
            raise ModelError(
                expected=f"the {what} of {first.name}, {_text(wanted)}, in {other.name}",
                found=_text(found),
                fix="export both with the same classes and --size, with one version of standoff",
            )


def _operators(model: onnx.ModelProto) -> tuple[str, ...]:
    return tuple(sorted(f"{entry.domain or 'onnx'} {entry.version}" for entry in _used_opsets(model)))


def _used_opsets(model: onnx.ModelProto) -> list[onnx.OperatorSetIdProto]:
    """Return the operator sets that a model uses; what quantised it lists others besides."""
    used = {node.domain for node in model.graph.node}
    return [entry for entry in model.opset_import if entry.domain in used]


def _text(values: tuple[object, ...]) -> str:
    return ", ".join(str(value) for value in values)


def _factors(path: Path, named: Mapping[str, float], classes: tuple[str, ...]) -> _Floats:
    """Return (C,) factors of a part's scores; 0 for classes that it does not answer for."""
    unknown = [name for name in named if name not in (*classes, _ALL)]
    if unknown:
        raise ConfigError(
            expected=f"classes of {path.name}: {', '.join(classes)}, or {_ALL}",
            found=", ".join(unknown),
            fix="name only those",
        )
    wrong = [f"{name}:{factor:g}" for name, factor in named.items() if not 0 < factor <= 1]
    if wrong:
        raise ConfigError(expected="factors over 0 to 1", found=", ".join(wrong), fix="write for example worker:0.5")
    others = named.get(_ALL, 0.0) if named else 1.0
    return np.array([named.get(name, others) for name in classes], dtype=np.float32)


def _joined(models: Sequence[onnx.ModelProto], factors: Sequence[_Floats]) -> onnx.ModelProto:
    """Return one graph of all: one input, and the rows of the outputs one after another."""
    nodes: list[onnx.NodeProto] = []
    tensors: list[onnx.TensorProto] = []
    outputs: list[str] = []
    for index, (model, factor) in enumerate(zip(models, factors, strict=True)):
        prefix = f"part{index}_"
        graph = onnx.compose.add_prefix_graph(model.graph, prefix)
        for node in graph.node:
            node.input[:] = [PICTURE_INPUT if name == prefix + PICTURE_INPUT else name for name in node.input]
        nodes += graph.node
        tensors += graph.initializer
        boxes = prefix + BOXES_OUTPUT
        if (factor != 1).any():
            columns = np.concatenate([np.ones(_BOX_COLUMNS, np.float32), factor]).reshape(1, 1, -1)
            tensors.append(onnx.numpy_helper.from_array(columns, f"{prefix}factors"))
            nodes.append(onnx.helper.make_node("Mul", [boxes, f"{prefix}factors"], [f"{boxes}_scaled"]))
            boxes += "_scaled"
        outputs.append(boxes)
    nodes.append(onnx.helper.make_node("Concat", outputs, [BOXES_OUTPUT], axis=1))
    first = models[0].graph
    rows = [_output(model, BOXES_OUTPUT)[1] for model in models]
    results = [_result(BOXES_OUTPUT, sum(rows), _output(models[0], BOXES_OUTPUT)[2])]
    widths = [_output(model, POINTS_OUTPUT)[2:] for model in models]
    if any(widths):
        points = [f"part{index}_{POINTS_OUTPUT}" for index in range(len(models))]
        missing = [index for index, width in enumerate(widths) if not width]
        point_columns = max(widths)[0]
        tensors += [
            onnx.numpy_helper.from_array(np.full((1, rows[index], point_columns), np.nan, np.float32), points[index])
            for index in missing
        ]
        nodes.append(onnx.helper.make_node("Concat", points, [POINTS_OUTPUT], axis=1))
        results.append(_result(POINTS_OUTPUT, sum(rows), point_columns))
    graph = onnx.helper.make_graph(nodes, "joined", list(first.input), results, tensors)
    return onnx.helper.make_model(graph, opset_imports=_used_opsets(models[0]), ir_version=models[0].ir_version)


def _output(model: onnx.ModelProto, name: str) -> tuple[int, ...]:
    """Return the shape of an output; () where there is none of the name."""
    found = (output for output in model.graph.output if output.name == name)
    return next((tuple(dim.dim_value for dim in output.type.tensor_type.shape.dim) for output in found), ())


def _result(name: str, rows: int, columns: int) -> onnx.ValueInfoProto:
    return onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [1, rows, columns])
