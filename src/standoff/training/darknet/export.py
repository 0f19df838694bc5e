"""Turn a Darknet cfg, its weights and its names file into one self-describing ONNX file.

See `standoff.stages.detect.model_card` for the file's input, output and metadata.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

from standoff.core.classes import names_by_line
from standoff.core.errors import ModelError
from standoff.files.fingerprint import file_sha256
from standoff.files.whole import whole_file
from standoff.stages.detect import BOXES_OUTPUT, PICTURE_INPUT, POINTS_OUTPUT, ModelCard
from standoff.training.darknet.cfg import DarknetCfg, read_cfg
from standoff.training.darknet.sections import read_names_text
from standoff.training.darknet.shapes import check_input
from standoff.training.required import require_packages

OPSET = 17


def export_darknet(
    cfg: Path, weights: Path, names: Path, size_px: tuple[int, int] | None, out: Path, *, half: bool = False
) -> ModelCard:
    """Export a Darknet detector to ONNX.

    Args:
        cfg: Darknet cfg file.
        weights: The weights that belong to it.
        names: One class name a line, in the cfg's order.
        size_px: (width, height) of the network's input; None: the cfg's own.
        out: The ONNX file; appears only when complete, and replaces an older one.
        half: Store the weights in half precision (see `standoff.training.quantization.half_precision`).

    Returns:
        What the file says about itself.

    Raises:
        ModelError: A file does not fit the others, or the size does not fit the network.
        MissingDependency: torch or onnx is not installed.
        OutputError: The file cannot be written.
    """
    require_packages("torch", "onnx", purpose="export a model")
    network = read_cfg(cfg)
    if size_px is not None:
        network = replace(network, width_px=size_px[0], height_px=size_px[1])
    check_input(network)
    card = ModelCard(
        classes=read_names(names, network),
        anchors_px=tuple(head.anchors_px for head in network.heads),
        input_size_px=(network.width_px, network.height_px),
        sources={path.name: file_sha256(path) for path in (cfg, weights, names) if path.is_file()},
    )
    with whole_file(out) as path:
        _write_onnx(network, weights, card, path)
        if half:
            from standoff.training.quantization.half_precision import store_half

            store_half(path, path)
    return card


def read_names(path: Path, network: DarknetCfg) -> tuple[str, ...]:
    """Read a names file, one class a line.

    Raises:
        ModelError: It cannot be read, has an empty line between names, or another number of names than the network has
            classes.
    """
    text = read_names_text(path)
    try:
        names = names_by_line(text)
    except ValueError as error:
        expected = f"a name a line in {path.name}"
        raise ModelError(expected=expected, found=str(error), fix="correct the file") from error
    classes = network.heads[0].classes
    if len(names) != classes:
        raise ModelError(
            expected=f"{classes} names, as many as classes in {network.name}",
            found=f"{len(names)} in {path.name}",
            fix="give the names file that belongs to the cfg, one name a line",
        )
    return names


def _write_onnx(cfg: DarknetCfg, weights: Path, card: ModelCard, path: Path) -> None:
    import onnx
    import torch

    from standoff.training.darknet.network import DecodedNetwork, DecodedPoints
    from standoff.training.darknet.weights import load_network

    decoded = DecodedNetwork(load_network(cfg, weights)).eval()
    has_point = cfg.heads[0].has_point
    picture = torch.zeros(1, cfg.channels, cfg.height_px, cfg.width_px)
    with torch.no_grad(), warnings.catch_warnings():
        # The TorchScript exporter is chosen on purpose: the other one needs onnxscript.
        warnings.filterwarnings("ignore", category=DeprecationWarning)
        torch.onnx.export(
            DecodedPoints(decoded).eval() if has_point else decoded,
            (picture,),
            str(path),
            dynamo=False,
            opset_version=OPSET,
            input_names=[PICTURE_INPUT],
            output_names=[BOXES_OUTPUT, POINTS_OUTPUT] if has_point else [BOXES_OUTPUT],
        )
    model = onnx.load(str(path))
    onnx.helper.set_model_props(model, card.to_metadata())
    onnx.save(model, str(path))
