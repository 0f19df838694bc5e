"""Batches of training samples from several processes, the same ones however many there are."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import cv2
import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset, Sampler

from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray
from standoff.labels import LabelledPicture, Problem, load_picture
from standoff.labels.types import UNREADABLE
from standoff.training.pictures.augment import AugmentParams, Sample, make_sample


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Samples of one size, stacked.

    Attributes:
        pictures: (B, 3, H, W) uint8, red first; in memory the channels are last.
        boxes: (M, 4) float32 left, top, right, bottom in input pixels; 0 is the left edge of the first pixel.
        class_id: (M,) int64.
        ignored: (M,) bool, as in `LabelledPicture`.
        feet: (M, 2) float32 ground points, counted as the boxes are; NaN where none is marked.
        picture: (M,) int64 position in the batch of the picture that the box is in, ascending.
        step: Which batch it is.
        problems: Pictures that could not be read and were replaced.
    """

    pictures: torch.Tensor
    boxes: torch.Tensor
    class_id: torch.Tensor
    ignored: torch.Tensor
    feet: torch.Tensor
    picture: torch.Tensor
    step: int = 0
    problems: tuple[Problem, ...] = ()

    def to(self, device: torch.device) -> Batch:
        """Return the batch on a device."""
        names = ("pictures", "boxes", "class_id", "ignored", "feet", "picture")
        return replace(self, **{name: getattr(self, name).to(device) for name in names})


def draw_chances(data: Sequence[LabelledPicture], rare_share: float) -> FloatArray:
    """Return the chance of each picture to be drawn: its weight, times a factor for the rarest class in it.

    The factor is max(1, sqrt(t / f)), where f is the weighted share of pictures that show the class and t the share
    below which it is rare.

    Source:
        Gupta, Dollar and Girshick, LVIS: A Dataset for Large Vocabulary Instance Segmentation, 2019, section 5.1
        (repeat factor sampling).
    """
    weight = np.array([picture.weight for picture in data], dtype=np.float64)
    shown = [np.unique(picture.class_id[~picture.ignored]) for picture in data]
    share_of = np.zeros(1 + max((int(ids.max()) for ids in shown if len(ids)), default=0))
    for ids, own in zip(shown, weight / weight.sum(), strict=True):
        share_of[ids] += own
    factor_of = np.sqrt(np.maximum(1.0, rare_share / np.where(share_of > 0.0, share_of, 1.0)))
    chances: FloatArray = weight * [factor_of[ids].max(initial=1.0) for ids in shown]
    chances /= chances.sum()
    return chances


def stack_samples(samples: Sequence[Sample]) -> Batch:
    """Stack samples of one size."""
    height, width = samples[0].image.shape[:2]
    pictures = np.empty((len(samples), height, width, 3), np.uint8)
    for sample, room in zip(samples, pictures, strict=True):
        cv2.cvtColor(sample.image, cv2.COLOR_BGR2RGB, dst=room)
    counts = [len(sample.class_id) for sample in samples]
    return Batch(
        pictures=torch.from_numpy(pictures).permute(0, 3, 1, 2),
        boxes=torch.from_numpy(np.concatenate([sample.xyxy_px for sample in samples]).astype(np.float32)),
        class_id=torch.from_numpy(np.concatenate([sample.class_id for sample in samples]).astype(np.int64)),
        ignored=torch.from_numpy(np.concatenate([sample.ignored for sample in samples]).astype(np.bool_)),
        feet=torch.from_numpy(np.concatenate([sample.foot_px for sample in samples]).astype(np.float32)),
        picture=torch.repeat_interleave(torch.arange(len(samples)), torch.tensor(counts)),
    )


@dataclass(frozen=True)
class _Steps(Dataset[Batch | DataError]):
    """Makes the batch of a step from nothing but the seed and the step."""

    data: Sequence[LabelledPicture]
    chances: FloatArray
    params: AugmentParams
    batch: int
    seed: int

    def __getitem__(self, step_and_size: tuple[int, tuple[int, int]]) -> Batch | DataError:
        step, size_px = step_and_size
        cumulative = np.cumsum(self.chances)
        problems: list[Problem] = []

        def pick(rng: np.random.Generator) -> int:
            return min(int(np.searchsorted(cumulative, rng.random(), side="right")), len(cumulative) - 1)

        def load(picture: LabelledPicture, reduction: int) -> ImageArray:
            try:
                return load_picture(picture, reduction)
            except DataError as error:
                problems.append(Problem(picture.path, error.found, UNREADABLE, skipped_picture=True))
                raise

        try:
            samples = [
                make_sample(
                    np.random.default_rng((self.seed, step, place)), self.data, pick, load, size_px, self.params
                )
                for place in range(self.batch)
            ]
        except DataError as error:
            # Raised in a worker it would lose its type: the caller's process raises it.
            return error
        return replace(stack_samples(samples), step=step, problems=tuple(problems))


@dataclass(frozen=True)
class _Plan(Sampler[tuple[int, tuple[int, int]]]):
    """Says in the caller's process what size each step has: workers get numbers, not the function."""

    steps: range
    sizes_px: Callable[[int], tuple[int, int]]

    def __iter__(self) -> Iterator[tuple[int, tuple[int, int]]]:
        return ((step, self.sizes_px(step)) for step in self.steps)

    def __len__(self) -> int:
        return len(self.steps)


def _calm_worker(_: int) -> None:
    """One thread for each process: there are as many processes as the machine has cores to spare."""
    cv2.setNumThreads(0)


@contextmanager
def open_batches(
    data: Sequence[LabelledPicture],
    *,
    params: AugmentParams,
    batch: int,
    sizes_px: Callable[[int], tuple[int, int]],
    seed: int,
    first_step: int,
    last_step: int,
    workers: int,
) -> Iterator[Iterator[Batch]]:
    """Make the batches of a range of steps, ahead of time where there are workers.

    A batch depends on the seed, its step, the data and the settings; not on the workers, nor on where the range begins:
    a run that is resumed sees what it would have seen.

    Args:
        data: Training pictures.
        params: What may happen to them.
        batch: Samples in a batch.
        sizes_px: (width, height) of the network's input by step.
        seed: Of everything that is drawn.
        first_step: The first batch's step.
        last_step: The last batch's step: it is made too.
        workers: Processes; 0 makes each batch when it is asked for.

    Raises:
        DataError: There are no pictures, or many in a row cannot be read.
    """
    if len(data) == 0:
        raise DataError(expected="training pictures", found="none", fix="check the data set and its split")
    steps = _Steps(data, draw_chances(data, params.rare_share), params, batch, seed)
    plan = _Plan(range(first_step, last_step + 1), sizes_px)
    loader = DataLoader(steps, batch_size=None, sampler=plan, num_workers=workers, worker_init_fn=_calm_worker)

    def made() -> Generator[Batch, None, None]:
        for found in loader:
            if isinstance(found, DataError):
                raise found
            yield found

    batches = made()
    try:
        yield batches
    finally:
        # Ends the workers now, rather than when somebody collects the generator.
        batches.close()
