"""Read and write the ONNX files of our own detectors."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import onnx

from standoff.core.errors import DataError
from standoff.core.finding import WorkerFinding
from standoff.files.fingerprint import file_sha256
from standoff.files.whole import whole_file
from standoff.stages.detect import ModelCard, open_session

_QUANTIZED = frozenset({"QuantizeLinear", "DequantizeLinear", "QLinearConv", "ConvInteger"})


def read_own_model(path: Path) -> tuple[onnx.ModelProto, ModelCard]:
    """Load a model that describes itself.

    Raises:
        ModelError: There is no such file, it is no ONNX model, or it has no card.
    """
    metadata = open_session(path, "cpu", 1).get_modelmeta().custom_metadata_map
    return onnx.load(str(path)), ModelCard.from_metadata(metadata, path.name)


def is_quantized(model: onnx.ModelProto) -> bool:
    """Tell whether a model computes in integers already."""
    return any(node.op_type in _QUANTIZED for node in model.graph.node)


def describe_as_made_from(model: onnx.ModelProto, source: Path, **facts: object) -> None:
    """Give a model the metadata of the file that it was made from, and name that file among its sources.

    Args:
        model: Changed in place.
        source: A model of ours.
        facts: More to say, by key, of plain values.
    """
    original, card = read_own_model(source)
    texts = {entry.key: entry.value for entry in original.metadata_props}
    texts |= replace(card, sources={**card.sources, source.name: file_sha256(source)}).to_metadata()
    texts |= {key: json.dumps(value) for key, value in facts.items()}
    del model.metadata_props[:]
    onnx.helper.set_model_props(model, texts)


def tell_finding(path: Path, finding: WorkerFinding) -> None:
    """Write into a model's file how small a worker it finds.

    Args:
        path: A model of ours; replaced as a whole.
        finding: As measured.

    Raises:
        DataError: It was not measured.
        ModelError: It is no model of ours.
        OutputError: It cannot be written.
    """
    if not finding.measured:
        raise DataError(
            expected="at least 20 workers of about the same height, to know how many are found",
            found="fewer",
            fix="score more pictures",
        )
    model, card = read_own_model(path)
    texts = {entry.key: entry.value for entry in model.metadata_props}
    del model.metadata_props[:]
    onnx.helper.set_model_props(model, texts | replace(card, finds_workers=finding.to_dict()).to_metadata())
    with whole_file(path) as half_written:
        onnx.save(model, str(half_written))
