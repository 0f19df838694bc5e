"""The training loop: steps, validations, checkpoints, and going on where a run stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from standoff.core.errors import DataError
from standoff.evaluation.detection import DetectionScore
from standoff.labels import LabelledData, Problem
from standoff.labels.splits import spread
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.shapes import largest_stride
from standoff.training.pictures.batches import Batch, open_batches
from standoff.training.run.checkpoint import load_checkpoint, save_checkpoint
from standoff.training.run.distributed import Crew
from standoff.training.run.loss import LossTerms, yolo_loss
from standoff.training.run.memory import saying_what_fits
from standoff.training.run.optimization import (
    AveragedWeights,
    learning_rate,
    make_optimizer,
    set_learning_rate,
    set_trainable,
)
from standoff.training.run.params import TrainParams
from standoff.training.run.precision import autocast
from standoff.training.run.validation import validate

_STEPS_OF_ONE_SCALE = 10
_SEEDS_BETWEEN = 1_000_003
"""Of two processes of a crew: each draws its own pictures."""
_TERMS = ("total", "box", "objectness", "classes", "points")


@dataclass(slots=True)
class Progress:
    """Where a run stands: what a checkpoint holds besides the weights.

    Attributes:
        step: Steps done.
        seen: Pictures shown.
        best_map: Best mean average precision so far, -1 before the first validation.
        best_step: Where it was.
        rows: One of the history for each validation: step, learning rate, mean losses since the last, figures.
        losses: Sums of the loss terms since the last validation, and their number.
    """

    step: int = 0
    seen: int = 0
    best_map: float = -1.0
    best_step: int = 0
    rows: list[dict[str, Any]] = field(default_factory=list)
    losses: list[float] = field(default_factory=lambda: [0.0] * (len(_TERMS) + 1))


@dataclass(frozen=True, slots=True)
class Watcher:
    """Who is told of a run's progress.

    Attributes:
        on_step: After each step: its number and its loss.
        on_validation: After each validation: the history so far, the score and the averaged network.
        on_bad_picture: For each time that a picture could not be decoded.
    """

    on_step: Callable[[int, float], None]
    on_validation: Callable[[Progress, DetectionScore, DarknetNetwork], None]
    on_bad_picture: Callable[[Problem], None]


class Trainer:
    """One run.

    Args:
        network: Starting point; its cfg has the size of the input.
        data: To train on and validate with; neither split is empty.
        params: Settings.
        checkpoints: Folder of checkpoints.
        backbone_layers: Layers that count as backbone.
        folded: No layer's batch normalisation has statistics of its own: they stay as they are.
    """

    def __init__(
        self,
        network: DarknetNetwork,
        data: LabelledData,
        params: TrainParams,
        checkpoints: Path,
        backbone_layers: int,
        *,
        folded: bool = False,
    ) -> None:
        self._crew = Crew.join()
        self._stride = largest_stride(network.cfg)
        self._data, self._params, self._checkpoints = data, params, checkpoints
        self._backbone_layers = backbone_layers
        own_norm = len(network.blocks) if folded else 0
        self._frozen_norm = max(own_norm, backbone_layers if params.frozen_norm else 0)
        self._network = _on(self._crew.device, network)
        self._optimizer = make_optimizer(self._network, backbone_layers, params)
        self._average = AveragedWeights(self._network, params.ema)
        self._shown = _on(self._crew.device, DarknetNetwork(network.cfg))
        self._validation = spread(data.splits["val"], params.validate_pictures)
        self.progress = Progress()

    def resume(self) -> tuple[str, ...]:
        """Go on from the newest checkpoint that is whole.

        Returns:
            Names of newer checkpoints that were cut short.

        Raises:
            DataError: There is none.
        """
        state, damaged = load_checkpoint(self._checkpoints)
        self._network.load_state_dict(state["network"])
        self._optimizer.load_state_dict(state["optimizer"])
        self._average.state = {name: value.to(self._crew.device) for name, value in state["average"].items()}
        self._average.updates = state["updates"]
        self.progress = Progress(**state["progress"])
        return damaged

    def run(self, watcher: Watcher) -> Progress:
        """Train to the end, or to the early stop.

        Raises:
            DataError: The loss is no longer a number.
        """
        params, first = self._params, self.progress.step
        batches = open_batches(
            self._data.splits["train"],
            params=params.augment.for_classes(self._data.classes),
            batch=params.batch,
            sizes_px=lambda number: self._size_px(number // params.accumulate),
            seed=params.seed + _SEEDS_BETWEEN * self._crew.rank,
            first_step=first * params.accumulate,
            last_step=params.steps * params.accumulate - 1,
            workers=params.workers,
        )
        with batches as stream:
            model = self._crew.wrap(self._network)
            for step in range(first, params.steps):
                terms = self._step(model, step, stream, watcher)
                self._note(step, terms)
                watcher.on_step(self.progress.step, float(terms[0]))
                is_last = self.progress.step == params.steps
                if is_last or self.progress.step % params.validate_every == 0:
                    self._validate(watcher)
                stops = self._crew.agree(is_last or self._is_stale())
                if stops or self.progress.step % params.checkpoint_every == 0:
                    self._save()
                if stops:
                    break
        return self.progress

    def _step(self, model: nn.Module, step: int, stream: Iterator[Batch], watcher: Watcher) -> list[float]:
        params = self._params
        is_frozen = step < params.freeze_steps
        frozen = max(params.frozen_layers, self._backbone_layers if is_frozen else 0)
        set_trainable(self._network, frozen, self._frozen_norm)
        set_learning_rate(self._optimizer, learning_rate(step, params))
        self._optimizer.zero_grad(set_to_none=True)
        sums = np.zeros(len(_TERMS))
        for part in range(params.accumulate):
            batch = next(stream).to(self._crew.device)
            # Dropout draws from here: the same in a resumed run, whatever the loader drew for itself.
            seed = np.random.SeedSequence([params.seed, step, part, self._crew.rank])
            torch.manual_seed(seed.generate_state(1)[0].item())
            for problem in batch.problems:
                watcher.on_bad_picture(problem)
            with saying_what_fits(params.batch, params.accumulate, self._try):
                sums += self._add_gradients(model, batch)
        if not np.isfinite(sums).all():
            raise DataError(
                expected="a finite loss",
                found=f"{sums[0]} at step {step + 1}",
                fix="go on from the last checkpoint with a lower rate: --resume --set learning_rate=...",
            )
        torch.nn.utils.clip_grad_norm_([p for p in self._network.parameters() if p.grad is not None], params.clip_norm)
        self._optimizer.step()
        self._average.update(self._network)
        return [float(value) for value in sums]

    def _add_gradients(self, model: nn.Module, batch: Batch) -> list[float]:
        """Go forth and back with a batch; by itself, so that a failure lets go of the activations with the frame."""
        terms, share = self._loss(model, batch), self._params.accumulate
        torch.autograd.backward(terms.total / share)
        return [float(getattr(terms, name).detach()) / share for name in _TERMS]

    def _try(self, pictures: int) -> None:
        """Go forth and back with empty pictures of the largest size, to see whether the memory suffices."""
        width_px, height_px = (
            max(1, round(side * max(self._params.scales) / self._stride)) * self._stride
            for side in self._params.size_px
        )
        pixels = torch.zeros(pictures, 3, height_px, width_px, device=self._crew.device)
        with autocast(self._crew.device, bf16=self._params.bf16):
            heads = self._network(pixels.contiguous(memory_format=torch.channels_last))
        torch.autograd.backward([head.float().sum() for head in heads])
        self._optimizer.zero_grad(set_to_none=True)

    def _loss(self, model: nn.Module, batch: Batch) -> LossTerms:
        pixels = batch.pictures.to(memory_format=torch.channels_last).float() / 255.0
        with autocast(self._crew.device, bf16=self._params.bf16):
            heads: tuple[Tensor, ...] = model(pixels)
        return yolo_loss(heads, self._network.cfg.heads, batch, self._params.loss)

    def _size_px(self, step: int) -> tuple[int, int]:
        """Return the input's size in a step: the same for ten steps, then drawn again."""
        params = self._params
        rng = np.random.default_rng([params.seed, 611953, step // _STEPS_OF_ONE_SCALE])
        scale = float(rng.choice(params.scales))
        width_px, height_px = (max(1, round(side * scale / self._stride)) * self._stride for side in params.size_px)
        return width_px, height_px

    def _note(self, step: int, terms: list[float]) -> None:
        self.progress.step = step + 1
        self.progress.seen += self._params.batch * self._params.accumulate * self._crew.size
        self.progress.losses = [
            before + value for before, value in zip(self.progress.losses, [*terms, 1.0], strict=True)
        ]

    def _validate(self, watcher: Watcher) -> None:
        progress = self.progress
        if not self._crew.leads:
            return
        started_s = monotonic()
        self._shown.load_state_dict(self._average.state if self._params.ema else self._network.state_dict())
        self._shown.eval()
        score = validate(self._shown, self._validation, self._data.classes, bf16=self._params.bf16)
        *sums, count = progress.losses
        row: dict[str, Any] = {"step": progress.step, "learning_rate": learning_rate(progress.step - 1, self._params)}
        row |= {f"loss_{name}": value / count for name, value in zip(_TERMS, sums, strict=True)}
        row |= {"map": score.mean_ap11, "average_iou": score.average_iou}
        row |= {f"ap_{each.name}": each.ap11 for each in score.classes}
        row["validation_s"] = monotonic() - started_s
        progress.rows.append(row)
        progress.losses = [0.0] * len(progress.losses)
        # Without any truth the mean is NaN, which is never better.
        if score.mean_ap11 > progress.best_map:
            progress.best_map, progress.best_step = score.mean_ap11, progress.step
        watcher.on_validation(progress, score, self._shown)

    def _is_stale(self) -> bool:
        """Tell whether the patience is used up; only the leader knows."""
        params, progress = self._params, self.progress
        if not params.patience or not progress.rows:
            return False
        later = sum(row["step"] > progress.best_step for row in progress.rows)
        return bool(later >= params.patience)

    def _save(self) -> None:
        if not self._crew.leads:
            return
        state = {
            "network": self._network.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "average": self._average.state,
            "updates": self._average.updates,
            "progress": {name: getattr(self.progress, name) for name in Progress.__slots__},
        }
        save_checkpoint(self._checkpoints, self.progress.step, state)


def _on(device: torch.device, network: DarknetNetwork) -> DarknetNetwork:
    """Move a network; its kernels lie channels last, as the pictures do."""
    moved: DarknetNetwork = network.to(device)
    for parameter in moved.parameters():
        if parameter.ndim == 4:
            parameter.data = parameter.data.contiguous(memory_format=torch.channels_last)
    return moved
