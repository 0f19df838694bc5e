"""Settings of a training run."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Interval
from typing_extensions import Doc

from standoff.training.pictures.augment import AugmentParams
from standoff.training.run.loss import LossParams

Share = Annotated[float, Interval(ge=0, le=1)]


@dataclass(frozen=True, slots=True)
class TrainParams:
    """Settings of a training run. A step is one change of the weights."""

    steps: Annotated[int, Ge(1), Doc("Steps in all; 20,000 in the paper.")] = 20_000
    batch: Annotated[int, Ge(1), Doc("Pictures that go through the network at once.")] = 16
    accumulate: Annotated[
        int, Ge(1), Doc("Batches of one step: their gradients are added before the weights move.")
    ] = 1
    size_px: Annotated[tuple[int, int], Doc("Width and height of the network's input.")] = (416, 416)
    export_size_px: Annotated[
        tuple[int, int] | None,
        Doc("Width and height of the exported network's input, larger for small people; None: size_px."),
    ] = None
    scales: Annotated[
        tuple[float, ...], Doc("Multi-scale: factors of the size, one drawn for each ten steps; (1,) is none.")
    ] = (1.0,)
    optimizer: Annotated[Literal["sgd", "adamw"], Doc("SGD with momentum as Darknet, or AdamW.")] = "adamw"
    learning_rate: Annotated[float, Gt(0), Doc("At its highest; 0.001 in Darknet for SGD.")] = 1e-3
    final_share: Annotated[Share, Doc("Of the learning rate that is left at the end of the cosine.")] = 0.02
    warmup_steps: Annotated[int, Ge(0), Doc("Over which the learning rate rises.")] = 500
    momentum: Annotated[float, Interval(ge=0, lt=1), Doc("Of SGD; the first beta of AdamW.")] = 0.9
    weight_decay: Annotated[float, Ge(0), Doc("Of convolution kernels only.")] = 5e-4
    clip_norm: Annotated[float, Gt(0), Doc("Largest norm of the gradient.")] = 20.0
    backbone_layers: Annotated[
        int, Ge(0), Doc("Layers that count as backbone, from the first; 0: those that the starting weights filled.")
    ] = 0
    backbone_rate: Annotated[Share, Doc("Learning rate of the backbone relative to the rest.")] = 1.0
    freeze_steps: Annotated[int, Ge(0), Doc("First steps, in which the backbone does not move.")] = 0
    frozen_layers: Annotated[int, Ge(0), Doc("Layers, from the first, that never move.")] = 0
    frozen_norm: Annotated[bool, Doc("Keep the batch normalisation statistics of the backbone as they came.")] = False
    ema: Annotated[float, Interval(ge=0, lt=1), Doc("Decay of the averaged weights that are kept; 0 is none.")] = 0.999
    bf16: Annotated[
        bool, Doc("Compute in bfloat16 where that is safe and processor or GPU have instructions for it.")
    ] = True
    seed: Annotated[int, Ge(0), Doc("Of everything random.")] = 0
    workers: Annotated[int, Ge(0), Doc("Processes that prepare pictures.")] = 1
    validate_every: Annotated[int, Ge(1), Doc("Steps between validations; each is a row of the table.")] = 500
    validate_pictures: Annotated[int, Ge(1), Doc("Of the validation split, evenly spread, that are used.")] = 300
    patience: Annotated[int, Ge(0), Doc("Validations without a better mAP before an early stop; 0: never.")] = 0
    checkpoint_every: Annotated[int, Ge(1), Doc("Steps between checkpoints.")] = 500
    loss: Annotated[LossParams, Doc("The loss.")] = field(default_factory=LossParams)
    augment: Annotated[AugmentParams, Doc("What is done to pictures.")] = field(default_factory=AugmentParams)

    def __post_init__(self) -> None:
        if min(self.size_px) < 32:
            raise ValueError(f"size_px must be at least 32 each, not {self.size_px}")
        if self.export_size_px is not None and min(self.export_size_px) < 32:
            raise ValueError(f"export_size_px must be at least 32 each, not {self.export_size_px}")
        if not self.scales or min(self.scales) <= 0:
            raise ValueError(f"scales must be positive factors, not {self.scales}")
        if self.warmup_steps >= self.steps:
            raise ValueError(f"warmup_steps ({self.warmup_steps}) must be fewer than steps ({self.steps})")
