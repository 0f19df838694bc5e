"""Darknet's files after a bad copy: a network only from what is whole, and never a traceback."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from mutations import mutated

from standoff.core.errors import ModelError
from standoff.training.darknet.cfg import parse_cfg, read_cfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.shapes import check_input, weights_numbers
from standoff.training.darknet.weights import load_network

CFG = """[net]
batch=64
width=32
height=32
channels=3
[convolutional]
batch_normalize=1
filters=4
size=3
stride=2
pad=1
activation=mish
[route]
layers=-1
groups=2
group_id=1
[maxpool]
size=2
stride=2
[convolutional]
filters=14
activation=logistic
[yolo]
mask = 0,1
anchors = 10,14,  23,27
classes=2
num=2
scale_x_y = 1.05
new_coords=1
"""
_NUMBERS = weights_numbers(parse_cfg(CFG))
_WEIGHTS = struct.pack("<iiiq", 0, 2, 5, 64) + np.full(_NUMBERS, 0.25, "<f4").tobytes()


def _file(factory: pytest.TempPathFactory, name: str, content: bytes) -> Path:
    path = factory.getbasetemp() / name
    path.write_bytes(content)
    return path


@given(mutated(st.just(CFG.encode())))
@examples(200)
def test_a_damaged_cfg_is_read_or_refused_in_one_line(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    weights = _file(tmp_path_factory, "whole.weights", _WEIGHTS)
    try:
        cfg = read_cfg(_file(tmp_path_factory, "damaged.cfg", content))
        check_input(cfg)
        load_network(cfg, weights)
    except ModelError as error:
        assert "\n" not in str(error)
    else:
        assert weights_numbers(cfg) == _NUMBERS


@given(mutated(st.just(_WEIGHTS)))
@examples(200)
def test_damaged_weights_make_a_network_only_if_no_number_is_missing(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    path = _file(tmp_path_factory, "damaged.weights", content)
    try:
        network = load_network(parse_cfg(CFG), path)
    except ModelError as error:
        assert "\n" not in str(error)
        return
    assert len(content) - 4 * _NUMBERS in (16, 20), "after the header of one of the two versions"
    assert _is_finite(network)


def _is_finite(network: DarknetNetwork) -> bool:
    return all(bool(torch.isfinite(value).all()) for value in network.state_dict().values())


@pytest.mark.parametrize("bytes_missing", [-4, -1, 1, 4, 4 * (14 + 14 * 2), 4 * _NUMBERS])
def test_a_file_of_any_other_length_makes_no_network(tmp_path: Path, bytes_missing: int) -> None:
    path = tmp_path / "cut.weights"
    path.write_bytes((_WEIGHTS + bytes(8))[: len(_WEIGHTS) - bytes_missing])
    with pytest.raises(ModelError):
        load_network(parse_cfg(CFG), path)
