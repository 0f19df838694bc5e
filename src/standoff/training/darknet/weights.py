"""Read and write Darknet `.weights` files.

A file is a header and then float32 numbers, layer by layer: for each convolution its biases, then with
batch normalisation the scales, means and variances, then the kernels (filters, channels / groups, rows,
columns). Nothing in it says which layer a number is for: only the cfg does.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
import torch
from torch import Tensor

from standoff.core.errors import ModelError
from standoff.files.lfs import refuse_pointer
from standoff.files.whole import whole_file
from standoff.training.darknet.cfg import DarknetCfg
from standoff.training.darknet.network import ConvolutionBlock, DarknetNetwork
from standoff.training.darknet.shapes import numbers_by_layer

Numbers: TypeAlias = np.ndarray[tuple[int], np.dtype[np.float32]]


@dataclass(frozen=True, slots=True)
class WeightsHeader:
    """Head of a weights file.

    Attributes:
        major: Format version.
        minor: Format version.
        revision: Format version.
        seen: Pictures that the network was trained on.
    """

    major: int = 0
    minor: int = 2
    revision: int = 5
    seen: int = 0

    @property
    def seen_format(self) -> str:
        """`struct` format of `seen`: 64 bits from version 0.2 on, 32 before.

        >>> WeightsHeader(0, 1, 0).seen_format
        '<i'
        """
        is_wide = self.major * 10 + self.minor >= 2 and self.major < 1000 and self.minor < 1000
        return "<q" if is_wide else "<i"


def _parameters(block: ConvolutionBlock) -> list[Tensor]:
    """Return the tensors of a block in the order of the file."""
    normalization = block.normalization
    if normalization is None:
        bias = block.convolution.bias
        assert bias is not None
        return [bias, block.convolution.weight]
    mean, variance = normalization.running_mean, normalization.running_var
    assert mean is not None and variance is not None
    return [normalization.bias, normalization.weight, mean, variance, block.convolution.weight]


def _split(content: bytes, path: Path) -> tuple[WeightsHeader, Numbers]:
    try:
        major, minor, revision = struct.unpack_from("<iii", content)
        header = WeightsHeader(major, minor, revision)
        (seen,) = struct.unpack_from(header.seen_format, content, 12)
    except struct.error:
        raise ModelError(
            expected=f"a Darknet weights file at {path}",
            found=f"{len(content)} bytes, less than its header",
            fix="download or copy the file again",
        ) from None
    start = 12 + struct.calcsize(header.seen_format)
    count, left_over = divmod(len(content) - start, 4)
    if left_over:
        raise ModelError(
            expected=f"whole float32 numbers in {path}",
            found=f"{left_over} bytes after the last one",
            fix="download or copy the file again, it is cut short or not a weights file",
        )
    return replace(header, seen=seen), np.frombuffer(content, "<f4", count, start)


def read_numbers(path: Path) -> tuple[WeightsHeader, Numbers]:
    """Read a weights file without knowing what network it belongs to.

    Raises:
        ModelError: It cannot be read, is a Git LFS pointer, or is cut within its header or a number.
    """
    refuse_pointer(path, f"a Darknet weights file at {path}", ModelError)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ModelError(
            expected=f"a Darknet weights file at {path}", found=error.strerror or "no file", fix="check the path"
        ) from error
    return _split(content, path)


def load_network(cfg: DarknetCfg, path: Path) -> DarknetNetwork:
    """Build a network from its cfg and its weights; nothing is built unless the file holds what the cfg asks for.

    Raises:
        ModelError: As `load_weights`; or layers do not fit each other.
    """
    _, numbers = read_numbers(path)
    _check_length(cfg, len(numbers), path.name)
    network = DarknetNetwork(cfg)
    fill_convolutions(network, numbers, path.name)
    return network


def load_weights(network: DarknetNetwork, path: Path) -> WeightsHeader:
    """Read a weights file into a network.

    Args:
        network: Built from the cfg that belongs to the file; changed in place.
        path: The file.

    Raises:
        ModelError: It cannot be read, is too short (says at which layer), too long, or holds numbers
            that cannot be weights.
    """
    header, numbers = read_numbers(path)
    fill_convolutions(network, numbers, path.name)
    return header


def fill_convolutions(network: DarknetNetwork, numbers: Numbers, file_name: str, *, may_end_early: bool = False) -> int:
    """Fill convolutions one after another with the numbers of a weights file.

    Args:
        network: Changed in place.
        numbers: The file's content after its header.
        file_name: For messages.
        may_end_early: True if the numbers may end between two layers; the network's remaining layers stay as they are.

    Returns:
        Number of convolutions filled.

    Raises:
        ModelError: The numbers do not fit; says at which layer.
    """
    if not may_end_early:
        _check_length(network.cfg, len(numbers), file_name)
    position = 0
    for filled, (index, block) in enumerate(network.convolutions()):
        parameters = _parameters(block)
        needed = sum(parameter.numel() for parameter in parameters)
        own = numbers[position : position + needed]
        if len(own) == 0 and may_end_early and filled:
            return filled
        if len(own) < needed:
            raise _too_few(network.cfg, index, needed, len(own), file_name)
        _refuse_impossible(own, block, f"{file_name} for {network.cfg.section(index)}")
        _fill(parameters, own)
        position += needed
    if position < len(numbers):
        raise _too_many(network.cfg, position, len(numbers), file_name)
    return len(network.convolutions())


def _check_length(cfg: DarknetCfg, count: int, file_name: str) -> None:
    left = count
    for index, needed in numbers_by_layer(cfg).items():
        if left < needed:
            raise _too_few(cfg, index, needed, left, file_name)
        left -= needed
    if left:
        raise _too_many(cfg, count - left, count, file_name)


def _too_few(cfg: DarknetCfg, index: int, needed: int, left: int, file_name: str) -> ModelError:
    return ModelError(
        expected=f"{needed} numbers in {file_name} for {cfg.section(index)}",
        found=f"{left} left",
        fix="give the weights that belong to this cfg",
    )


def _too_many(cfg: DarknetCfg, needed: int, count: int, file_name: str) -> ModelError:
    return ModelError(
        expected=f"{needed} numbers in {file_name} for all layers of {cfg.name}",
        found=f"{count}, {count - needed} too many",
        fix="give the weights that belong to this cfg",
    )


def _refuse_impossible(numbers: Numbers, block: ConvolutionBlock, where: str) -> None:
    if not np.isfinite(numbers).all():
        raise ModelError(
            expected=f"finite numbers in {where}",
            found="NaN or infinity",
            fix="give the weights that belong to this cfg, from a training that did not diverge",
        )
    filters = block.convolution.out_channels
    if block.normalization is not None and (lowest := numbers[3 * filters : 4 * filters].min()) < 0:
        raise ModelError(
            expected=f"variances that are not negative in {where}",
            found=f"{lowest:g}",
            fix="give the weights that belong to this cfg, these are of another architecture",
        )


def _fill(parameters: list[Tensor], numbers: Numbers) -> None:
    position = 0
    with torch.no_grad():
        for parameter in parameters:
            own = numbers[position : position + parameter.numel()].astype(np.float32)
            parameter.copy_(torch.from_numpy(own).reshape(parameter.shape))
            position += parameter.numel()


def save_weights(
    network: DarknetNetwork, path: Path, header: WeightsHeader | None = None, cut_after_layer: int | None = None
) -> None:
    """Write a network's parameters as a weights file that Darknet reads.

    Args:
        network: The network.
        path: Appears only when complete, and replaces an older one.
        header: By default version 0.2.5, no picture seen.
        cut_after_layer: Number of the last layer whose parameters are written (74 gives a `darknet53.conv.74`);
            None: all of them.

    Raises:
        OutputError: The file cannot be written.
    """
    header = header or WeightsHeader()
    with whole_file(path) as half_written, half_written.open("wb") as file:
        file.write(struct.pack("<iii", header.major, header.minor, header.revision))
        file.write(struct.pack(header.seen_format, header.seen))
        for index, block in network.convolutions():
            if cut_after_layer is None or index <= cut_after_layer:
                for parameter in _parameters(block):
                    file.write(parameter.detach().cpu().numpy().astype("<f4").tobytes())
