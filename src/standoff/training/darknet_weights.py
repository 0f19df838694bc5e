"""Read and write Darknet `.weights` files.

A file is a header and then float32 numbers, layer by layer: for each convolution its biases, then with
batch normalisation the scales, means and variances, then the kernels (filters, channels / groups, rows,
columns). Nothing in it says which layer a number is for: only the cfg does.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from standoff.core.errors import ModelError
from standoff.training.darknet_network import ConvolutionBlock, DarknetNetwork


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


def _split(content: bytes, path: Path) -> tuple[WeightsHeader, np.ndarray[tuple[int], np.dtype[np.float32]]]:
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


def load_weights(network: DarknetNetwork, path: Path) -> WeightsHeader:
    """Read a weights file into a network.

    Args:
        network: Built from the cfg that belongs to the file; changed in place.
        path: The file.

    Raises:
        ModelError: It cannot be read, is too short (says at which layer), too long, or holds numbers
            that are not finite.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ModelError(
            expected=f"a Darknet weights file at {path}", found=error.strerror or "no file", fix="check the path"
        ) from error
    header, numbers = _split(content, path)
    position = 0
    for index, block in network.convolutions():
        parameters = _parameters(block)
        needed = sum(parameter.numel() for parameter in parameters)
        own = numbers[position : position + needed]
        if len(own) < needed:
            raise ModelError(
                expected=f"{needed} numbers in {path} for {network.cfg.section(index)}",
                found=f"{len(own)} left",
                fix="give the weights that belong to this cfg",
            )
        if not np.isfinite(own).all():
            raise ModelError(
                expected=f"finite numbers in {path} for {network.cfg.section(index)}",
                found="NaN or infinity",
                fix="give the weights that belong to this cfg, from a training that did not diverge",
            )
        _fill(parameters, own)
        position += needed
    if position < len(numbers):
        raise ModelError(
            expected=f"{position} numbers in {path} for all layers of {network.cfg.name}",
            found=f"{len(numbers)}, {len(numbers) - position} too many",
            fix="give the weights that belong to this cfg",
        )
    return header


def _fill(parameters: list[Tensor], numbers: np.ndarray[tuple[int], np.dtype[np.float32]]) -> None:
    position = 0
    with torch.no_grad():
        for parameter in parameters:
            own = numbers[position : position + parameter.numel()].astype(np.float32)
            parameter.copy_(torch.from_numpy(own).reshape(parameter.shape))
            position += parameter.numel()


def save_weights(network: DarknetNetwork, path: Path, header: WeightsHeader | None = None) -> None:
    """Write a network's parameters as a weights file that Darknet reads.

    Args:
        network: The network.
        path: Written, or overwritten.
        header: By default version 0.2.5, no picture seen.
    """
    header = header or WeightsHeader()
    with path.open("wb") as file:
        file.write(struct.pack("<iii", header.major, header.minor, header.revision))
        file.write(struct.pack(header.seen_format, header.seen))
        for _, block in network.convolutions():
            for parameter in _parameters(block):
                file.write(parameter.detach().cpu().numpy().astype("<f4").tobytes())
