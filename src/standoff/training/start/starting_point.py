"""The network that a run starts from: composed for the data, filled from somebody's weights."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from standoff.core.errors import ConfigError, ModelError
from standoff.core.homography import FloatArray
from standoff.files.plain_text import read_text
from standoff.labels import LabelledData
from standoff.training.architectures import ARCHITECTURES
from standoff.training.architectures.composer import Anchors
from standoff.training.architectures.refitted import pointed_cfg, refitted_cfg
from standoff.training.darknet.cfg import DarknetCfg, parse_cfg, read_cfg
from standoff.training.darknet.export import read_names
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.shapes import layer_strides
from standoff.training.pictures.batches import open_batches
from standoff.training.run.params import TrainParams
from standoff.training.start.anchors import cluster_anchors, spread_over_heads
from standoff.training.start.exported_weights import EXPORTED_SUFFIX, gives_points, is_folded
from standoff.training.start.initial_weights import head_convolutions, initialize_layers
from standoff.training.start.transfer import Transferred, transfer_weights

_ANCHORS_A_HEAD = 3
_ANCHOR_SAMPLES = 256
"""Augmented pictures whose boxes are clustered: some thousands of boxes."""


def backbone_of(network: DarknetNetwork, transferred: Transferred) -> int:
    """Return how many layers before the first head the weights filled without a gap; 0 if they filled none."""
    first_other = min((*transferred.fresh, *transferred.resized, *head_convolutions(network)))
    return first_other if transferred.copied else 0


def boxes_in_training(data: LabelledData, params: TrainParams) -> FloatArray:
    """Return (N, 2) width and height of boxes as training shows them: of augmented pictures, in input pixels."""
    count = -(-_ANCHOR_SAMPLES // params.batch)
    batches = open_batches(
        data.splits["train"], params=params.augment.for_classes(data.classes), batch=params.batch,
        sizes_px=lambda _: params.size_px, seed=params.seed + 1, first_step=0, last_step=count - 1,
        workers=params.workers,
    )  # fmt: skip
    with batches as stream:
        sizes = [(batch.boxes[:, 2:] - batch.boxes[:, :2])[~batch.ignored].numpy() for batch in stream]
    return np.concatenate(sizes).astype(np.float64)


def compose_cfg(arch: str, data: LabelledData, params: TrainParams, weights: Path | None = None) -> str:
    """Compose the network for the data: its classes, the run's input size, anchors by k-means.

    Its heads give ground points if some are marked in the training split, or if the network that it starts from has
    them: where a site's own labels have none, what was learnt elsewhere is not thrown away.

    Args:
        arch: Name in `ARCHITECTURES`, or a Darknet cfg file.
        data: Gives classes and boxes.
        params: Gives the size, the augmentation and the seed.
        weights: That it is to start from.

    Raises:
        ConfigError: There is no such architecture or file.
        ModelError: The cfg file is not one with YOLO heads.
        DataError: There is no box to find anchors from.
    """
    strides = _strides(arch)
    rng = np.random.default_rng([params.seed, 32452843])
    found = cluster_anchors(boxes_in_training(data, params), _ANCHORS_A_HEAD * len(strides), rng)
    fine_to_coarse = spread_over_heads(found, len(strides))
    if arch in ARCHITECTURES:
        text = ARCHITECTURES[arch].compose(len(data.classes), *params.size_px, fine_to_coarse)
    else:
        by_stride = dict(zip(sorted(strides), fine_to_coarse, strict=True))
        anchors_px: Anchors = [by_stride[stride] for stride in strides]
        text = refitted_cfg(
            read_text(Path(arch), "a Darknet cfg", ModelError), len(data.classes), params.size_px, anchors_px
        )
    return pointed_cfg(text) if _marks_points(data) or _gives_points(weights) else text


def _marks_points(data: LabelledData) -> bool:
    return any(np.isfinite(picture.foot_px[~picture.ignored]).any() for picture in data.splits["train"])


def _gives_points(weights: Path | None) -> bool:
    """Tell whether weights belong to heads with ground points, as far as the cfg beside them says."""
    if weights is None:
        return False
    if weights.suffix == EXPORTED_SUFFIX:
        return gives_points(weights)
    cfg = _beside(weights)[0]
    return cfg.is_file() and read_cfg(cfg).heads[0].has_point


def _beside(weights: Path) -> tuple[Path, Path]:
    """Return where the cfg and the names of weights are, in the folder of a run."""
    cfg, names = (weights.resolve().with_name(name) for name in ("network.cfg", "classes.names"))
    return cfg, names


def _strides(arch: str) -> tuple[int, ...]:
    """Return input pixels per cell of each head, in the order of the cfg."""
    if arch in ARCHITECTURES:
        return ARCHITECTURES[arch].strides
    path = Path(arch)
    if not path.is_file():
        raise ConfigError(
            expected=f"an architecture ({', '.join(ARCHITECTURES)}) or a Darknet cfg file",
            found=f"'{arch}'",
            fix="correct --arch",
        )
    cfg = parse_cfg(read_text(path, "a Darknet cfg", ModelError), path.name)
    heads = {id(head) for head in cfg.heads}
    return tuple(
        int(stride) for layer, stride in zip(cfg.layers, layer_strides(cfg), strict=True) if id(layer) in heads
    )


def fill_network(
    cfg: DarknetCfg, classes: tuple[str, ...], weights: Path | None, seed: int
) -> tuple[DarknetNetwork, Transferred]:
    """Make a network and fill it.

    Args:
        cfg: The network.
        classes: Names of its classes.
        weights: Darknet weights, whole or cut, of this or another number of classes; or EfficientNet-lite0's torch
            file; or an ONNX file that `standoff export` or `standoff join` made; or None: from scratch. `network.cfg`
            and `classes.names` beside Darknet weights, as in the folder of a run, say what they are.
        seed: For what the weights leave open.

    Raises:
        ModelError: The weights belong to another architecture.
    """
    network = DarknetNetwork(cfg)
    generator = torch.Generator().manual_seed(seed)
    layers = tuple(index for index, _ in network.convolutions())
    if weights is None:
        initialize_layers(network, layers, generator)
        return network, Transferred("nothing", (), (), layers)
    source_cfg, source_names = _beside(weights)
    if weights.suffix == EXPORTED_SUFFIX or not (source_cfg.is_file() and source_names.is_file()):
        transferred = transfer_weights(network, weights, classes=classes, generator=generator)
    else:
        source_classes = read_names(source_names, read_cfg(source_cfg))
        transferred = transfer_weights(
            network, weights, source_cfg, classes=classes, source_classes=source_classes, generator=generator
        )
    # Also what went on from an export, in Darknet's format since, is still without statistics.
    return network, replace(transferred, folded=is_folded(network))
