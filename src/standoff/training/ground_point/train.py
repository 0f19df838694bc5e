"""Train the network of ground points, and write it with errors that hold on what it did not learn from."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import onnx
import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel
from torch.utils.data import DataLoader, Dataset

from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray, IntArray
from standoff.files.whole import whole_file
from standoff.stages.detect import (
    CLASS_INPUT,
    CROPS_INPUT,
    POINT_CLASSES,
    POINT_CROP_AROUND,
    POINT_CROP_PX,
    POINTS_OUTPUT,
    point_metadata,
)
from standoff.training.darknet.export import OPSET
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.ground_point.crops import PATCH_PX, Patches, boxed_crop, drawn_crop
from standoff.training.ground_point.network import LOG_SIGMA, GroundPointNetwork, ToldPoints
from standoff.training.pictures.augment_params import AugmentParams
from standoff.training.quantization.half_precision import halve_weights
from standoff.training.run.point_loss import point_loss

_PULL: Final = 5.0
_EYES_RATE: Final = 0.3
"""Of the learning rate: what a detector has learnt is not to be forgotten."""
_ELLIPSE_95: Final = math.sqrt(-2.0 * math.log(0.05))
"""How many standard errors the ellipse about a point reaches that holds 95 of 100."""


@dataclass(frozen=True, slots=True)
class PointTraining:
    """How long and how fast.

    Attributes:
        steps: Batches.
        batch: Crops in each.
        learning_rate: Largest, after a fiftieth of the steps; falls as a cosine to a hundredth.
        decay: Of weights.
        ema: Share of the running mean of the weights that a step leaves.
        rare: Crops of a class are drawn as often as its number to this power: 0 all alike, 1 as they come.
        seed: Of everything random.
        workers: Processes that draw crops.
    """

    steps: int = 3_000
    batch: int = 64
    learning_rate: float = 1e-3
    decay: float = 0.01
    ema: float = 0.999
    rare: float = 0.3
    seed: int = 0
    workers: int = 1


@dataclass(frozen=True, slots=True)
class PointError:
    """One class on crops that nothing was learnt from.

    Attributes:
        name: Of the class.
        count: Crops.
        median: Distance from the true point, in longer sides of the box.
        p95: 95th percentile.
        inside_95: Share of the true points that are in the stated ellipse of 95 %, as the network states it.
        stretch: By what its standard errors are multiplied so that 95 of 100 are.
    """

    name: str
    count: int
    median: float
    p95: float
    inside_95: float
    stretch: float


class _Drawn(Dataset[tuple[Tensor, Tensor, int]]):
    """Crops by number: the same number gives the same crop."""

    def __init__(self, patches: Patches, plan: PointTraining) -> None:
        self._patches, self._plan, self._params = patches, plan, AugmentParams()
        counts = np.bincount(patches.class_index, minlength=len(POINT_CLASSES)).astype(np.float64)
        chances = np.where(counts > 0, np.maximum(counts, 1.0) ** (plan.rare - 1.0), 0.0)[patches.class_index]
        self._chances = np.cumsum(chances / chances.sum())

    def __len__(self) -> int:
        return self._plan.steps * self._plan.batch

    def __getitem__(self, number: int) -> tuple[Tensor, Tensor, int]:
        rng = np.random.default_rng([self._plan.seed, number])
        row = min(int(np.searchsorted(self._chances, rng.random())), len(self._patches) - 1)
        seen, point = drawn_crop(rng, self._patches.images[row], self._patches.point[row], self._params)
        # Red first, as the network sees them.
        return torch.from_numpy(seen[:, :, ::-1].copy()), torch.from_numpy(point), int(self._patches.class_index[row])


def train_points(
    patches: Patches, eyes: DarknetNetwork, plan: PointTraining, on_step: Callable[[], None] | None = None
) -> GroundPointNetwork:
    """Train a network of ground points.

    Args:
        patches: To learn from.
        eyes: The detector that it starts from; its first layers become the network's own.
        plan: How long and how fast.
        on_step: Called after each.

    Raises:
        DataError: There is nothing to learn from.
    """
    if not len(patches):
        raise DataError(
            expected="things with ground points",
            found="none",
            fix="render some with `standoff simulate dataset`, or mark them",
        )
    torch.manual_seed(plan.seed)
    network = GroundPointNetwork(eyes)
    network.begin_at(_usual_points(patches))
    mean = AveragedModel(network, avg_fn=_running_mean(plan.ema), use_buffers=True)
    own = [one for name, one in network.named_parameters() if not name.startswith("eyes.")]
    seeing = [one for one in network.eyes.parameters() if one.requires_grad]
    rates = [plan.learning_rate, plan.learning_rate * _EYES_RATE]
    groups = [{"params": own}, {"params": seeing}]
    optimizer = torch.optim.AdamW(groups, lr=plan.learning_rate, weight_decay=plan.decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, rates, plan.steps, pct_start=0.02, final_div_factor=4.0)
    for crops, points, class_index in _batches(patches, plan):
        told = _of_class(network(_as_input(crops)), class_index)
        residual = told[:, :2] - points.float()
        # What the likelihood forgives a wide error, the distance itself does not: it learns sooner.
        loss = (point_loss(residual, told[:, 2:], LOG_SIGMA[0]) + _PULL * residual.abs().sum()) / len(points)
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        optimizer.step()
        schedule.step()
        mean.update_parameters(network)
        if on_step is not None:
            on_step()
    trained = mean.module
    assert isinstance(trained, GroundPointNetwork)
    return trained.eval()


def _running_mean(left: float) -> Callable[[Tensor, Tensor, Tensor | int], Tensor]:
    """Return how the mean goes on with a step; the first ones leave less of what was before, which knew nothing."""

    def goes_on(mean: Tensor, now: Tensor, steps: Tensor | int) -> Tensor:
        if not mean.is_floating_point():
            return now
        count = float(steps)
        return mean.lerp(now, max(1.0 - left, 9.0 / (10.0 + count)))

    return goes_on


def _usual_points(patches: Patches) -> Tensor:
    """Return (C, 2) where things of each class stand in the middle, in crops."""
    crops = (patches.point * PATCH_PX - (PATCH_PX - POINT_CROP_PX) / 2.0) / POINT_CROP_PX
    usual = [
        np.median(crops[patches.class_index == k], axis=0) if (patches.class_index == k).any() else np.full(2, 0.5)
        for k in range(len(POINT_CLASSES))
    ]
    return torch.tensor(np.array(usual), dtype=torch.float32)


def _batches(patches: Patches, plan: PointTraining) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
    yield from DataLoader(_Drawn(patches, plan), batch_size=plan.batch, num_workers=plan.workers)


def _as_input(crops: Tensor) -> Tensor:
    return crops.permute(0, 3, 1, 2).float().div(255.0).contiguous(memory_format=torch.channels_last)


def _of_class(told: Tensor, class_index: Tensor) -> Tensor:
    return told.gather(1, class_index.reshape(-1, 1, 1).expand(-1, 1, 4)).squeeze(1)


def measure_points(network: GroundPointNetwork, patches: Patches) -> list[PointError]:
    """Say how far off the network is on crops that it did not learn from, class by class.

    Args:
        network: Trained.
        patches: Not learnt from, in boxes as a detector finds them (`as_found`).
    """
    off, sigmas = np.zeros(len(patches)), np.zeros(len(patches))
    for start in range(0, len(patches), 256):
        rows = np.arange(start, min(start + 256, len(patches)))
        crops, true = zip(*(boxed_crop(patches.images[k], patches.point[k]) for k in rows), strict=True)
        told = _told(network, np.array(crops)[..., ::-1], patches.class_index[rows])
        away = told[:, :2] - np.array(true)
        off[rows] = POINT_CROP_AROUND * np.linalg.norm(away, axis=1)
        sigmas[rows] = np.linalg.norm(away / np.exp(told[:, 2:]), axis=1)
    return [
        _error(name, off[patches.class_index == k], sigmas[patches.class_index == k])
        for k, name in enumerate(POINT_CLASSES)
    ]


def _error(name: str, off: FloatArray, sigmas: FloatArray) -> PointError:
    if not len(off):
        return PointError(name, 0, math.nan, math.nan, math.nan, 1.0)
    stretch = float(np.quantile(sigmas, 0.95)) / _ELLIPSE_95
    inside = float((sigmas <= _ELLIPSE_95).mean())
    return PointError(name, len(off), float(np.median(off)), float(np.quantile(off, 0.95)), inside, stretch)


def _told(network: GroundPointNetwork, crops: ImageArray, class_index: IntArray) -> FloatArray:
    """Return (N, 4) of (N, S, S, 3) crops, red first: points and logarithms of their standard errors."""
    with torch.no_grad():
        told = _of_class(network(_as_input(torch.from_numpy(crops.copy()))), torch.from_numpy(class_index))
    return told.numpy().astype(np.float64)


def write_points(
    network: GroundPointNetwork,
    errors: list[PointError],
    out: Path,
    facts: dict[str, object],
    tells: Sequence[str] = (),
) -> None:
    """Write the ONNX file; it appears only when complete.

    Args:
        network: Trained.
        errors: On what it did not learn from: its standard errors are stretched by them.
        out: The file.
        facts: What else its metadata say.
        tells: Classes of which it will be asked; empty: all.

    Raises:
        OutputError: The file cannot be written.
    """
    stretch = torch.tensor([[one.stretch] * 2 for one in errors], dtype=torch.float32)
    example = torch.zeros(2, 3, POINT_CROP_PX, POINT_CROP_PX), torch.zeros(2, dtype=torch.int64)
    with whole_file(out) as path:
        with torch.no_grad(), warnings.catch_warnings():
            # The TorchScript exporter is chosen on purpose: the other one needs onnxscript.
            warnings.filterwarnings("ignore", category=DeprecationWarning)
            torch.onnx.export(
                ToldPoints(network, stretch).eval(),
                example,
                str(path),
                dynamo=False,
                opset_version=OPSET,
                input_names=[CROPS_INPUT, CLASS_INPUT],
                output_names=[POINTS_OUTPUT],
                dynamic_axes={name: {0: "count"} for name in (CROPS_INPUT, CLASS_INPUT, POINTS_OUTPUT)},
            )
        model = onnx.load(str(path))
        onnx.helper.set_model_props(
            model, point_metadata(tells) | {key: json.dumps(value) for key, value in facts.items()}
        )
        halve_weights(model.graph)
        onnx.save(model, str(path))
