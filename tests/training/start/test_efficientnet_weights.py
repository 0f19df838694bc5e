"""The conversion against the computation that the package's own code does, written out here in plain torch calls."""

from __future__ import annotations

from pathlib import Path

import pytest
import tolerances
import torch
from pointers import POINTER
from torch import Tensor
from torch.nn import functional

from standoff.core.errors import ModelError, OutputError
from standoff.training import efficientnet_lite0_cfg, yolov3_tiny_cfg
from standoff.training.darknet.cfg import parse_cfg, read_cfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.start.efficientnet_weights import convert_efficientnet_lite0, fill_efficientnet_lite0
from standoff.training.start.transfer import transfer_weights

State = dict[str, Tensor]
PARTS = ("running_mean", "running_var", "weight", "bias")

# Kernel size, stride, expansion, channels of each block, as the TensorFlow original lists them.
BLOCKS = [
    (3, 1, 1, 16),
    *[(3, 2, 6, 24), (3, 1, 6, 24)],
    *[(5, 2, 6, 40), (5, 1, 6, 40)],
    *[(3, 2, 6, 80), (3, 1, 6, 80), (3, 1, 6, 80)],
    *[(5, 1, 6, 112), (5, 1, 6, 112), (5, 1, 6, 112)],
    *[(5, 2, 6, 192), (5, 1, 6, 192), (5, 1, 6, 192), (5, 1, 6, 192)],
    (3, 1, 6, 320),
]


def _add_convolution(state: State, kernel: str, norm: str, shape: tuple[int, int, int, int]) -> None:
    state[f"{kernel}.weight"] = torch.randn(shape)
    state[f"{norm}.weight"] = torch.rand(shape[0]) + 0.5
    state[f"{norm}.bias"] = 0.3 * torch.randn(shape[0])
    state[f"{norm}.running_mean"] = torch.zeros(shape[0])
    state[f"{norm}.running_var"] = torch.ones(shape[0])
    state[f"{norm}.num_batches_tracked"] = torch.tensor(7)


def _package_state(seed: int) -> State:
    """Return random parameters under the package's names, normalised as by a training: others amplify roundings."""
    torch.manual_seed(seed)
    state: State = {}
    _add_convolution(state, "_conv_stem", "_bn0", (32, 3, 3, 3))
    channels = 32
    for number, (size, _, expansion, filters) in enumerate(BLOCKS):
        block, inner = f"_blocks.{number}.", expansion * channels
        if expansion > 1:
            _add_convolution(state, f"{block}_expand_conv", f"{block}_bn0", (inner, channels, 1, 1))
        _add_convolution(state, f"{block}_depthwise_conv", f"{block}_bn1", (inner, 1, size, size))
        _add_convolution(state, f"{block}_project_conv", f"{block}_bn2", (filters, inner, 1, 1))
        channels = filters
    state["_fc.weight"] = torch.randn(1000, 1280)
    _reference(state, torch.rand(4, 3, 64, 96), measures=True)
    return state


def _reference(state: State, pictures: Tensor, *, measures: bool = False) -> Tensor:
    """Compute the backbone; pictures from 0 to 1, black beyond their edges.

    With `measures`, normalisations take their means and variances from these pictures and keep them.
    """

    def convolve(kernel: str, norm: str, features: Tensor, stride: int = 1, pad: float = 0.0) -> Tensor:
        kernels = state[f"{kernel}.weight"]
        features = functional.pad(features, 4 * [kernels.shape[2] // 2], value=pad)
        features = functional.conv2d(features, kernels, stride=stride, groups=features.shape[1] // kernels.shape[1])
        mean, variance, scale, bias = (state[f"{norm}.{part}"] for part in PARTS)
        return functional.batch_norm(features, mean, variance, scale, bias, measures, 1.0, 1e-3)

    pictures = (255.0 * pictures - 127.0) / 128.0
    features = convolve("_conv_stem", "_bn0", pictures, 2, pad=-127.0 / 128.0).clamp(0, 6)
    for number, (_, stride, expansion, filters) in enumerate(BLOCKS):
        block, before = f"_blocks.{number}.", features
        if expansion > 1:
            features = convolve(f"{block}_expand_conv", f"{block}_bn0", features).clamp(0, 6)
        features = convolve(f"{block}_depthwise_conv", f"{block}_bn1", features, stride).clamp(0, 6)
        features = convolve(f"{block}_project_conv", f"{block}_bn2", features)
        if stride == 1 and before.shape[1] == filters:
            features = features + before
    return features


def _backbone(network: DarknetNetwork, pictures: Tensor) -> Tensor:
    """Return what the first convolution after the backbone gets."""
    seen: list[Tensor] = []
    (after, *_) = [block for _, block in network.convolutions() if block.convolution.in_channels == 320]
    hook = after.register_forward_hook(lambda _module, inputs, _output: seen.append(inputs[0]))
    with torch.no_grad():
        network.eval()(pictures)
    hook.remove()
    return seen[0]


@pytest.fixture
def package_file(tmp_path: Path) -> Path:
    torch.save(_package_state(0), tmp_path / "lite0.pth")
    return tmp_path / "lite0.pth"


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_filled_backbone_computes_what_the_package_computes(tmp_path: Path, seed: int) -> None:
    state = _package_state(seed)
    torch.save(state, tmp_path / "lite0.pth")
    network = DarknetNetwork(parse_cfg(efficientnet_lite0_cfg(2, 96, 64)))
    assert fill_efficientnet_lite0(network, tmp_path / "lite0.pth") == 48
    pictures = torch.rand(2, 3, 64, 96)
    expected, found = _reference(state, pictures), _backbone(network, pictures)
    assert expected.std() > 0.1, "a dead network would agree with anything"
    torch.testing.assert_close(found, expected, rtol=tolerances.ONNX_LOGIT, atol=tolerances.ONNX_LOGIT)


def test_converted_weights_start_a_network_of_any_classes_as_the_pth_file_does(
    package_file: Path, tmp_path: Path
) -> None:
    convert_efficientnet_lite0(package_file, tmp_path / "lite0.cfg", tmp_path / "lite0.weights")
    assert read_cfg(tmp_path / "lite0.cfg").name == "lite0.cfg"
    pictures = torch.rand(1, 3, 64, 64)
    outputs = []
    for weights in (tmp_path / "lite0.weights", package_file):
        network = DarknetNetwork(parse_cfg(efficientnet_lite0_cfg(5, 64, 64)))
        transferred = transfer_weights(network, weights)
        assert (len(transferred.copied), len(transferred.resized), len(transferred.fresh)) == (48, 0, 20)
        outputs.append(_backbone(network, pictures))
    assert torch.equal(*outputs)


def test_other_files_and_other_networks_are_refused_in_one_line(package_file: Path, tmp_path: Path) -> None:
    network = DarknetNetwork(parse_cfg(efficientnet_lite0_cfg(2, 64, 64)))
    (tmp_path / "noise.pth").write_bytes(b"not a pickle")
    torch.save({"conv": torch.zeros(1)}, tmp_path / "other.pth")
    torch.save({"model": torch.nn.Linear(1, 1)}, tmp_path / "ultralytics.pth")
    (tmp_path / "pointer.pth").write_text(POINTER)
    for name, found in (
        ("noise", "found"),
        ("none", "No such file"),
        ("other", "no _conv_stem.weight"),
        ("ultralytics", "no weights alone, but objects of the program"),
        ("pointer", "a Git LFS pointer"),
    ):
        with pytest.raises(ModelError, match=rf"package .* at .*{name}\.pth.*{found}") as caught:
            fill_efficientnet_lite0(network, tmp_path / f"{name}.pth")
        assert "\n" not in str(caught.value)
    with pytest.raises(
        ModelError, match=r"\(16, 3, 3, 3\) kernels for layer 0, .* found \(32, 3, 3, 3\) in _conv_stem"
    ):
        fill_efficientnet_lite0(DarknetNetwork(parse_cfg(yolov3_tiny_cfg(2, 64, 64), "tiny.cfg")), package_file)
    with pytest.raises(OutputError, match="No such file"):
        convert_efficientnet_lite0(package_file, tmp_path / "no" / "a.cfg", tmp_path / "no" / "a.weights")
