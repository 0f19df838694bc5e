"""Turn a Darknet cfg, its weights and its names file into one self-describing ONNX file.

See `standoff.stages.detect.model_card` for the file's input, output and metadata.
"""

from __future__ import annotations

import importlib.util
import warnings
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from standoff.core.errors import MissingDependency, ModelError, OutputError
from standoff.stages.detect.model_card import INPUT_NAME, OUTPUT_NAME, ModelCard, file_sha256
from standoff.training.darknet_cfg import DarknetCfg, read_cfg, read_text
from standoff.training.darknet_shapes import largest_stride

_OPSET = 17


def export_darknet(cfg: Path, weights: Path, names: Path, size_px: tuple[int, int] | None, out: Path) -> ModelCard:
    """Export a Darknet detector to ONNX.

    Args:
        cfg: Darknet cfg file.
        weights: The weights that belong to it.
        names: One class name a line, in the cfg's order.
        size_px: (width, height) of the network's input; None: the cfg's own.
        out: The ONNX file; appears only when complete, and replaces an older one.

    Returns:
        What the file says about itself.

    Raises:
        ModelError: A file does not fit the others, or the size does not fit the network.
        MissingDependency: torch or onnx is not installed.
        OutputError: The file cannot be written.
    """
    _require("torch", "onnx")
    network = read_cfg(cfg)
    if size_px is not None:
        network = replace(network, width_px=size_px[0], height_px=size_px[1])
    _check_input(network)
    card = ModelCard(
        classes=_read_names(names, network),
        anchors_px=tuple(head.anchors_px for head in network.heads),
        input_size_px=(network.width_px, network.height_px),
        sources={path.name: file_sha256(path) for path in (cfg, weights, names) if path.is_file()},
    )
    try:
        with TemporaryDirectory(dir=out.parent, prefix=".export-") as folder:
            half_written = Path(folder) / out.name
            _write_onnx(network, weights, card, half_written)
            half_written.replace(out)
    except OSError as error:
        raise OutputError(
            expected=f"a place to write {out}",
            found=error.strerror or type(error).__name__,
            fix="choose a file in an existing folder that you may write to",
        ) from error
    return card


def _require(*packages: str) -> None:
    missing = [package for package in packages if importlib.util.find_spec(package) is None]
    if missing:
        raise MissingDependency(
            expected="torch and onnx to export a model",
            found=f"no {' and no '.join(missing)}",
            fix="run pip install 'standoff[train]'",
        )


def _check_input(network: DarknetCfg) -> None:
    if network.channels != 3:
        raise ModelError(
            expected=f"3 input channels, red, green and blue, in {network.name}",
            found=f"{network.channels}",
            fix="give a cfg for colour pictures",
        )
    stride = largest_stride(network)
    size_px = network.width_px, network.height_px
    if min(size_px) < stride or size_px[0] % stride or size_px[1] % stride:
        width_px, height_px = (max(stride, round(side / stride) * stride) for side in size_px)
        raise ModelError(
            expected=f"an input width and height that are multiples of {stride} px",
            found=f"{size_px[0]}x{size_px[1]}",
            fix=f"take {width_px}x{height_px}",
        )


def _read_names(path: Path, network: DarknetCfg) -> tuple[str, ...]:
    lines = read_text(path, "a names file").splitlines()
    names = tuple(line.strip() for line in lines if line.strip())
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

    from standoff.training.darknet_network import DarknetNetwork, DecodedNetwork
    from standoff.training.darknet_weights import load_weights

    network = DarknetNetwork(cfg)
    load_weights(network, weights)
    decoded = DecodedNetwork(network).eval()
    picture = torch.zeros(1, cfg.channels, cfg.height_px, cfg.width_px)
    with torch.no_grad(), warnings.catch_warnings():
        # The TorchScript exporter is chosen on purpose: the other one needs onnxscript.
        warnings.filterwarnings("ignore", category=DeprecationWarning)
        torch.onnx.export(
            decoded,
            (picture,),
            str(path),
            dynamo=False,
            opset_version=_OPSET,
            input_names=[INPUT_NAME],
            output_names=[OUTPUT_NAME],
        )
    model = onnx.load(str(path))
    onnx.helper.set_model_props(model, card.to_metadata())
    onnx.save(model, str(path))
