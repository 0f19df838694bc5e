"""Start a network from weights that somebody trained, whatever their classes, anchors and heads were.

A head keeps what it knows: every new anchor starts from the rows of the old anchor nearest in shape, corrected so
that it says the same boxes, and every class from the classes that it is like.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor

from standoff.core.errors import ModelError
from standoff.training.darknet.cfg import DarknetCfg, read_cfg
from standoff.training.darknet.layers import POINT_VALUES, Yolo
from standoff.training.darknet.network import ConvolutionBlock, DarknetNetwork
from standoff.training.darknet.shapes import weights_numbers
from standoff.training.darknet.weights import fill_convolutions, read_numbers
from standoff.training.start.anchors import overlap_of_sizes
from standoff.training.start.class_rows import COCO_CLASSES, class_sources
from standoff.training.start.efficientnet_weights import fill_efficientnet_lite0
from standoff.training.start.exported_weights import EXPORTED_SUFFIX, read_exported
from standoff.training.start.initial_weights import head_convolutions, initialize_layers, set_point_prior
from standoff.training.start.weights_source import cfg_by_length, matching_layers

_TORCH_SUFFIXES: Final = (".pth", ".pt")


@dataclass(frozen=True, slots=True)
class Transferred:
    """Where a network's convolutions come from, by layer number.

    Attributes:
        source: What the weights were taken for, in a few words.
        copied: Filled as they were.
        resized: Heads filled row by row.
        fresh: Initialised.
        class_sources: Of each class, what it started from in the resized heads: names, or numbers where the source's
            classes have no names; empty for a class that starts afresh.
        folded: The source's batch normalisations were folded into its kernels: there are no statistics to go on with.
    """

    source: str
    copied: tuple[int, ...]
    resized: tuple[int, ...]
    fresh: tuple[int, ...]
    class_sources: tuple[tuple[str, ...], ...] = ()
    folded: bool = False


def transfer_weights(
    network: DarknetNetwork,
    weights: Path,
    source_cfg: Path | None = None,
    *,
    classes: Sequence[str] = (),
    source_classes: Sequence[str] = COCO_CLASSES,
    generator: torch.Generator | None = None,
) -> Transferred:
    """Fill a network from weights of its own cfg, of a part of it, or of another head.

    Args:
        network: Changed in place.
        weights: Darknet weights, of all layers or cut after any of them; or a `.pth` or `.pt` file, see
            `fill_efficientnet_lite0`; or an exported model, see `read_exported`.
        source_cfg: The cfg that they belong to. None: the network's own, a known architecture with another number
            of classes or with COCO's, or the network's first layers, whichever the length of the file fits.
        classes: Names of the network's classes; without them no class starts from one of another name.
        source_classes: Names of the source's classes; they count only where they are as many as it has.
        generator: For layers that the source lacks; None: torch's own.

    Raises:
        ModelError: The weights belong to another architecture; says the first layer that does not fit.
    """
    if weights.suffix == EXPORTED_SUFFIX:
        trained, names = read_exported(network.cfg, weights)
        started = _continued(network, trained, len(trained.convolutions()), (classes, names), generator)
        return replace(started, source=f"the detector in {weights.name}")
    if weights.suffix in _TORCH_SUFFIXES:
        filled = fill_efficientnet_lite0(network, weights)
        return _started(network, f"EfficientNet-lite0's backbone, in {weights.name}", filled, generator)
    _, numbers = read_numbers(weights)
    source = read_cfg(source_cfg) if source_cfg is not None else None
    if source is None:
        source = cfg_by_length(network.cfg, len(numbers))
        # What fits the network itself is its own, with its own anchors, unless it is what everybody publishes.
        if len(numbers) == weights_numbers(network.cfg) and not _is_published_for_coco(source):
            source = None
    if source is None:
        filled = fill_convolutions(network, numbers, weights.name, may_end_early=True)
        part = "all" if filled == len(network.convolutions()) else "the first"
        return _started(network, f"{part} {filled} convolutions, in {weights.name}", filled, generator)
    trained = DarknetNetwork(source)
    filled = fill_convolutions(trained, numbers, weights.name, may_end_early=True)
    started = _continued(network, trained, filled, (classes, source_classes), generator)
    return replace(started, source=f"{source.name} with {source.heads[0].classes} classes, in {weights.name}")


def _continued(
    network: DarknetNetwork,
    trained: DarknetNetwork,
    filled: int,
    classes: tuple[Sequence[str], Sequence[str]],
    generator: torch.Generator | None,
) -> Transferred:
    """Fill a network from the first convolutions of a trained one, given both networks' names of classes."""
    own_classes, source_classes = classes
    initialize_layers(network, [index for index, _ in network.convolutions()], generator)
    matches = _known_matches(network, trained, filled)
    count, source_count = network.cfg.heads[0].classes, trained.cfg.heads[0].classes
    names = source_classes if len(source_classes) == source_count else [str(n) for n in range(source_count)]
    rows = _class_rows(own_classes, source_classes, count, source_count)
    resized = _copy_layers(network, trained, matches, rows)
    return Transferred(
        source=trained.cfg.name,
        copied=tuple(index for index in matches if index not in resized),
        resized=resized,
        fresh=tuple(index for index, _ in network.convolutions() if index not in matches),
        class_sources=tuple(tuple(names[number] for number in sources) for sources in rows) if resized else (),
    )


def _is_published_for_coco(source: DarknetCfg | None) -> bool:
    return source is not None and source.heads[0].classes == len(COCO_CLASSES)


def _started(network: DarknetNetwork, source: str, filled: int, generator: torch.Generator | None) -> Transferred:
    layers = tuple(index for index, _ in network.convolutions())
    initialize_layers(network, layers[filled:], generator)
    return Transferred(source, layers[:filled], (), layers[filled:])


def _known_matches(network: DarknetNetwork, trained: DarknetNetwork, filled: int) -> dict[int, int]:
    """Match the layers of which the source's weights are known."""
    known = [index for index, _ in trained.convolutions()][:filled]
    all_matches = matching_layers(network.cfg, trained.cfg)
    matches = {own: other for own, other in all_matches.items() if other in known}
    if len(matches) <= len(known) // 2:
        misfit = next(index for index, _ in network.convolutions() if index not in matches)
        raise ModelError(
            expected=f"weights that fit {network.cfg.section(misfit)}",
            found=f"{trained.cfg.name}, {len(matches)} of whose {len(known)} convolutions fit",
            fix="give weights of the same architecture",
        )
    return matches


def _copy_layers(
    network: DarknetNetwork, trained: DarknetNetwork, matches: dict[int, int], rows: Sequence[Sequence[int]]
) -> tuple[int, ...]:
    """Fill layers from those that match them; return the heads that were resized."""
    blocks, sources = dict(network.convolutions()), dict(trained.convolutions())
    heads, source_heads = head_convolutions(network), head_convolutions(trained)
    resized = []
    for own, other in matches.items():
        if own not in heads:
            blocks[own].load_state_dict(sources[other].state_dict())
            continue
        head, source_head = heads[own], source_heads[other]
        _fill_head(blocks[own], head, sources[other], source_head, rows)
        is_same = head.anchors_px == source_head.anchors_px and head.values == source_head.values
        if not (is_same and [*rows] == [(number,) for number in range(head.classes)]):
            resized.append(own)
    return tuple(resized)


def _class_rows(
    classes: Sequence[str], source_classes: Sequence[str], count: int, source_count: int
) -> tuple[tuple[int, ...], ...]:
    """Return for each class the source's classes that it starts from."""
    if len(classes) == count and len(source_classes) == source_count:
        return class_sources(classes, source_classes)
    return tuple((number,) if count == source_count else () for number in range(count))


def _fill_head(
    block: ConvolutionBlock, head: Yolo, source: ConvolutionBlock, source_head: Yolo, rows: Sequence[Sequence[int]]
) -> None:
    set_point_prior(block, head)
    anchors_px, source_px = np.array(head.anchors_px), np.array(source_head.anchors_px)
    nearest = overlap_of_sizes(anchors_px, source_px).argmax(axis=1)
    with torch.no_grad():
        for own, others in zip(_head_rows(block, head), _head_rows(source, source_head), strict=True):
            others = others[torch.from_numpy(nearest)]
            own[:, :5] = others[:, :5]
            for number, sources in enumerate(rows):
                if sources:
                    own[:, 5 + number] = others[:, [5 + source for source in sources]].mean(dim=1)
        # width = anchor * exp(raw): with this the new anchor says the width that the old one said
        kernels, bias = _head_rows(block, head)
        factor = torch.from_numpy(source_px[nearest] / anchors_px).float()
        bias[:, 2:4] += factor.log()
        if head.has_point and source_head.has_point:
            source_kernels, source_bias = _head_rows(source, source_head)
            kernels[:, -POINT_VALUES:] = source_kernels[nearest, -POINT_VALUES:]
            bias[:, -POINT_VALUES:] = source_bias[nearest, -POINT_VALUES:]


def _head_rows(block: ConvolutionBlock, head: Yolo) -> tuple[Tensor, Tensor]:
    """Return kernels (A, values, channels) and biases (A, values), views of the block's own."""
    bias = block.convolution.bias
    assert bias is not None
    shape = len(head.anchors_px), head.values
    return block.convolution.weight.view(*shape, -1), bias.view(shape)
