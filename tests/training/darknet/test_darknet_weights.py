from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import torch
from pointers import POINTER

from standoff.core.errors import ModelError, OutputError
from standoff.training.darknet import weights
from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.weights import (
    WeightsHeader,
    fill_convolutions,
    load_network,
    load_weights,
    read_numbers,
    save_weights,
)

CFG = """[net]
width=8
height=8
[convolutional]
filters=4
size=3
pad=1
batch_normalize=1
activation=leaky
[convolutional]
filters=6
activation=linear
[yolo]
anchors=2,2
classes=1
"""
FIRST = 4 + 4 + 4 + 4 + 4 * 3 * 3 * 3
SECOND = 6 + 6 * 4


def _network(seed: int = 0) -> DarknetNetwork:
    torch.manual_seed(seed)
    network = DarknetNetwork(parse_cfg(CFG, "a.cfg"))
    for parameter in [*network.parameters(), *network.buffers()]:
        if parameter.is_floating_point():
            torch.nn.init.uniform_(parameter, 0.1, 1.0)
    return network


def _write(path: Path, numbers: int, *, nan_at: int | None = None) -> Path:
    content = np.arange(numbers, dtype="<f4")
    if nan_at is not None:
        content[nan_at] = np.nan
    path.write_bytes(struct.pack("<iiiq", 0, 2, 5, 0) + content.tobytes())
    return path


@pytest.mark.parametrize(
    ("header", "header_bytes"), [(WeightsHeader(0, 2, 5, 2**40), 20), (WeightsHeader(0, 1, 0, 77), 16)]
)
def test_what_is_written_is_read_back_bit_by_bit(tmp_path: Path, header: WeightsHeader, header_bytes: int) -> None:
    source, target = _network(0), _network(1)
    save_weights(source, tmp_path / "a.weights", header)
    assert (tmp_path / "a.weights").stat().st_size == header_bytes + 4 * (FIRST + SECOND)
    assert load_weights(target, tmp_path / "a.weights") == header
    expected = source.state_dict()
    assert all(torch.equal(value, expected[name]) for name, value in target.state_dict().items())
    save_weights(target, tmp_path / "b.weights", header)
    assert (tmp_path / "a.weights").read_bytes() == (tmp_path / "b.weights").read_bytes()


def test_numbers_lie_in_darknets_order(tmp_path: Path) -> None:
    network = _network()
    load_weights(network, _write(tmp_path / "a.weights", FIRST + SECOND))
    (_, first), (_, second) = network.convolutions()
    normalization = first.normalization
    assert normalization is not None
    assert normalization.running_mean is not None
    assert normalization.bias.tolist() == [0, 1, 2, 3]
    assert normalization.weight.tolist() == [4, 5, 6, 7]
    assert normalization.running_mean.tolist() == [8, 9, 10, 11]
    assert first.convolution.weight[0, 0, 0].tolist() == [16, 17, 18]
    assert second.convolution.bias is not None
    assert second.convolution.bias.tolist() == list(range(FIRST, FIRST + 6))


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        (
            FIRST - 1,
            rf"{FIRST} numbers in .* for layer 0, \[convolutional\] at line 4 of a\.cfg, found {FIRST - 1} left",
        ),
        (FIRST + 3, rf"{SECOND} numbers in .* for layer 1, \[convolutional\] at line 10 of a\.cfg, found 3 left"),
        (FIRST + SECOND + 2, rf"{FIRST + SECOND} numbers in .* all layers of a\.cfg, found .* 2 too many"),
    ],
)
def test_weights_that_do_not_fit_say_at_which_layer(tmp_path: Path, numbers: int, message: str) -> None:
    with pytest.raises(ModelError, match=message) as caught:
        load_weights(_network(), _write(tmp_path / "a.weights", numbers))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("missing", [1, SECOND, SECOND + 1, -1])
def test_no_network_is_built_unless_the_file_holds_all_of_it(
    tmp_path: Path, missing: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = _write(tmp_path / "a.weights", FIRST + SECOND)
    assert load_network(parse_cfg(CFG, "a.cfg"), path).convolutions()[1][1].convolution.weight.numel() == 6 * 4
    monkeypatch.setattr(weights, "DarknetNetwork", None)
    with pytest.raises(ModelError, match=r"numbers in a\.weights"):
        load_network(parse_cfg(CFG, "a.cfg"), _write(path, FIRST + SECOND - missing))


def test_a_pointer_of_git_lfs_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.weights"
    path.write_text(POINTER)
    with pytest.raises(ModelError, match=r"found a Git LFS pointer, not the file\. Run `git lfs pull`"):
        read_numbers(path)


def test_numbers_that_are_not_finite_say_in_which_layer(tmp_path: Path) -> None:
    path = _write(tmp_path / "a.weights", FIRST + SECOND, nan_at=FIRST + 1)
    with pytest.raises(ModelError, match=r"finite numbers in .* for layer 1"):
        load_weights(_network(), path)


def test_a_negative_variance_says_that_the_weights_are_of_another_architecture(tmp_path: Path) -> None:
    path = _write(tmp_path / "a.weights", FIRST + SECOND)
    content = bytearray(path.read_bytes())
    content[20 + 4 * 13 : 20 + 4 * 14] = struct.pack("<f", -0.5)
    path.write_bytes(content)
    with pytest.raises(ModelError, match=r"variances .* for layer 0, .*found -0\.5\. .*another architecture"):
        load_weights(_network(), path)


def test_weights_can_be_cut_after_a_layer_and_then_fill_a_part(tmp_path: Path) -> None:
    source, target = _network(0), _network(1)
    save_weights(source, tmp_path / "a.conv.0", cut_after_layer=0)
    assert (tmp_path / "a.conv.0").stat().st_size == 20 + 4 * FIRST
    with pytest.raises(ModelError, match=r"for layer 1, .*found 0 left"):
        load_weights(target, tmp_path / "a.conv.0")
    _, numbers = read_numbers(tmp_path / "a.conv.0")
    assert fill_convolutions(target, numbers, "a.conv.0", may_end_early=True) == 1
    (_, filled), _ = target.convolutions()
    (_, expected), _ = source.convolutions()
    assert torch.equal(filled.convolution.weight, expected.convolution.weight)


def test_a_file_that_cannot_be_written_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="No such file"):
        save_weights(_network(), tmp_path / "nowhere" / "a.weights")
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError, match="found"):
        save_weights(_network(), tmp_path / "folder")
    assert list(tmp_path.iterdir()) == [tmp_path / "folder"]


def test_a_missing_an_empty_and_a_cut_file_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.weights"
    with pytest.raises(ModelError, match="found No such file"):
        load_weights(_network(), path)
    path.write_bytes(b"")
    with pytest.raises(ModelError, match="0 bytes, less than its header"):
        load_weights(_network(), path)
    path.write_bytes(_write(path, FIRST + SECOND).read_bytes()[:-3])
    with pytest.raises(ModelError, match="1 bytes after the last one"):
        load_weights(_network(), path)
