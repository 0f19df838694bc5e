"""The same network on the same pictures by every ONNX Runtime provider: do they agree, and how long does each take?

What is compared is what the network says, row by row, before overlapping boxes are suppressed: where two boxes are
nearly as sure, a last digit decides which one stays, and the one that is left may lie pixels away.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import Any, Final, get_args

import numpy as np
from scipy.optimize import linear_sum_assignment

from standoff.core.errors import DataError, MissingDependency, StandoffError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import Frame, ImageArray, IntArray
from standoff.evaluation.timing import Spread
from standoff.stages.detect import (
    ONNX_ERRORS,
    Candidates,
    DetectParams,
    Letterbox,
    Network,
    Provider,
    available_providers,
)
from standoff.stages.frames import open_source

TOLERANCE: Final = 1e-3
"""What two backends may differ by: of the picture's sides, and of a score of 1."""
_SURE: Final = 0.05
"""Boxes of cells in which there is nothing may lie anywhere: only those at least this sure are compared."""
_LOOKS_BEFORE: Final = 3
_FOLDER_FPS: Final = 1.0

OpenNetwork = Callable[[Path, Provider, int], Network]


@dataclass(frozen=True, slots=True)
class Agreement:
    """How far two answers to the same pictures are apart.

    Attributes:
        place: Largest difference of an edge of a box, or of a ground point, as a share of the picture's side.
        score: Largest difference of a class's probability.
        boxes: How many were compared, of all pictures.
    """

    place: float
    score: float
    boxes: int

    @property
    def is_close(self) -> bool:
        """Whether both differences are within the tolerance; never where one of them is no number."""
        return self.place <= TOLERANCE and self.score <= TOLERANCE


@dataclass(frozen=True, slots=True)
class ProviderTrial:
    """What became of one provider.

    Attributes:
        provider: As `DetectParams.provider` calls it.
        agreement: With the CPU; None where it did not compute.
        picture_ms: Times of a picture that is scaled already, from its levels to rows of boxes; likewise.
        absent: Why it is not there, or does not start; empty where it computes.
        is_installed: ONNX Runtime offers it, whether it starts or not.
        failure: Why it could not answer although it is there; empty where it could.
    """

    provider: Provider
    agreement: Agreement | None = None
    picture_ms: Spread | None = None
    absent: str = ""
    failure: str = ""
    is_installed: bool = True

    @property
    def is_good(self) -> bool:
        """Whether it does not compute here at all, or agrees with the CPU."""
        return bool(self.absent) or (self.agreement is not None and self.agreement.is_close)

    @property
    def verdict(self) -> str:
        """What to tell people, in a word or two."""
        if self.absent:
            return "no start" if self.is_installed else "absent"
        if self.failure:
            return "FAILS"
        return "OK" if self.is_good else "DIFFERS"

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        agreement = self.agreement
        return {
            "provider": self.provider,
            "verdict": self.verdict,
            "largest_difference_place": None if agreement is None else agreement.place,
            "largest_difference_score": None if agreement is None else agreement.score,
            "boxes": None if agreement is None else agreement.boxes,
            "picture_ms": None if self.picture_ms is None else self.picture_ms.to_dict(),
            "reason": self.absent or self.failure,
        }


def read_frames(source: Path, count: int) -> list[Frame]:
    """Read pictures, evenly spread over a video or a folder.

    Raises:
        SourceError: It cannot be read.
    """
    # A folder has no clock, and nothing here asks for the time.
    fps = _FOLDER_FPS if source.is_dir() else None
    with open_source(source, fps=fps) as opened:
        every = max(1, (opened.frame_count or count) // count)
    with open_source(source, fps=fps, every=every) as opened:
        return list(islice(opened, count))


def compare_providers(
    model: Path,
    frames: Sequence[Frame],
    *,
    intra_op_threads: int = 0,
    repeats: int = 3,
    open_network: OpenNetwork = Network,
) -> Iterator[ProviderTrial]:
    """Try a network by each provider; yield what became of it.

    The CPU comes first and is compared with itself, in a session of its own: whatever differs there is chance.

    Args:
        model: ONNX file.
        frames: Of one size.
        intra_op_threads: Threads on the CPU; 0: as many as cores.
        repeats: How often each picture is timed, after three looks at the first and one at each.
        open_network: Opens the model by a provider.

    Raises:
        ModelError: The CPU cannot use the model.
        DataError: It sees nothing in the pictures, so that there is nothing to compare.
    """
    network = open_network(model, "cpu", intra_op_threads)
    letterbox = network.letterbox(frames[0].size_px)
    pictures = [frame.picture.resized_bgr(*letterbox.inner_size_px) for frame in frames]
    reference = answers_of(network, pictures, letterbox)
    if not any(_is_sure(one).any() for one in reference):
        raise DataError(
            expected=f"pictures in which {model.name} sees something",
            found=f"no box surer than {_SURE:g} in {len(pictures)}",
            fix="give pictures of what it was trained for",
        )
    is_ordered = not network.interface.finds_once
    providers: tuple[Provider, ...] = tuple(name for name in get_args(Provider) if name != "auto")
    for provider in providers:
        try:
            network = open_network(model, provider, intra_op_threads)
            for _ in range(_LOOKS_BEFORE):
                answers_of(network, pictures[:1], letterbox)
            found = compare_answers(
                reference, answers_of(network, pictures, letterbox), letterbox.inner_size_px, is_ordered=is_ordered
            )
            times = Spread.of(_times_ms(network, pictures * repeats, letterbox))
            yield ProviderTrial(provider, found, times)
        except MissingDependency as error:
            is_installed = provider in available_providers()
            yield ProviderTrial(provider, absent=f"found {error.found}; {error.fix}", is_installed=is_installed)
        except (StandoffError, *ONNX_ERRORS) as error:
            yield ProviderTrial(provider, failure=" ".join(str(error).split())[:200])


def answers_of(network: Network, pictures: Iterable[ImageArray], letterbox: Letterbox) -> list[Candidates]:
    """Return all that a network says of pictures of the letterbox's inner size, however unsure."""
    return [network.candidates(picture, letterbox, 0.0) for picture in pictures]


def _times_ms(network: Network, pictures: Sequence[ImageArray], letterbox: Letterbox) -> Iterator[float]:
    least = DetectParams().score_threshold
    for picture in pictures:
        start_s = perf_counter()
        network.candidates(picture, letterbox, least)
        yield (perf_counter() - start_s) * 1e3


def compare_answers(
    reference: Sequence[Candidates],
    other: Sequence[Candidates],
    picture_size_px: tuple[int, int],
    *,
    is_ordered: bool = True,
) -> Agreement:
    """Compare what two backends say of the same pictures.

    Args:
        reference: Of each picture, by the one.
        other: By the other.
        picture_size_px: (width, height) of the pictures inside the network's input.
        is_ordered: Rows stand for cells. Otherwise the network sorts them, and those that lie nearest are compared.

    Returns:
        The largest differences; infinite where one has boxes, or points, that the other has not.
    """
    side_px = np.array(picture_size_px, dtype=np.float64)
    place = score = 0.0
    boxes = 0
    for one, two in zip(reference, other, strict=True):
        if is_ordered:
            if one.probability.shape != two.probability.shape:
                return Agreement(np.inf, np.inf, boxes)
            score = max(score, float(np.abs(one.probability - two.probability).max(initial=0.0)))
            sure = _is_sure(one) | _is_sure(two)
            one, two = _rows(one, sure), _rows(two, sure)
        else:
            one, two = _paired(one, two, side_px)
            score = max(score, float(np.abs(one.probability - two.probability).max(initial=0.0)))
        place = max(place, float(np.abs(_apart(_places(one, side_px), _places(two, side_px))).max(initial=0.0)))
        boxes += len(one.xyxy_px)
    return Agreement(place, score, boxes)


def _is_sure(found: Candidates) -> BoolArray:
    return np.asarray(found.probability.max(axis=1, initial=0.0) >= _SURE, dtype=np.bool_)


def _rows(found: Candidates, rows: BoolArray | IntArray) -> Candidates:
    has_points = len(found.foot_px) == len(found.xyxy_px)
    kept = replace(found, xyxy_px=found.xyxy_px[rows], probability=found.probability[rows])
    if not has_points:
        return kept
    return replace(kept, foot_px=found.foot_px[rows], foot_sigma_px=found.foot_sigma_px[rows])


def _places(found: Candidates, side_px: FloatArray) -> FloatArray:
    """Return (N, 6) edges and ground points as shares of the picture; NaN where there is no point."""
    points = found.foot_px if len(found.foot_px) == len(found.xyxy_px) else np.full((len(found.xyxy_px), 2), np.nan)
    places: FloatArray = np.hstack([found.xyxy_px, points]) / np.tile(side_px, 3)
    return places


def _apart(one: FloatArray, two: FloatArray) -> FloatArray:
    """Return differences: none where both have nothing, infinite ones where only one has."""
    nothing = np.isnan(one), np.isnan(two)
    with np.errstate(invalid="ignore"):
        known: FloatArray = np.where(one == two, 0.0, one - two)
    return np.where(nothing[0] & nothing[1], 0.0, np.where(nothing[0] | nothing[1], np.inf, known))


def _paired(one: Candidates, two: Candidates, side_px: FloatArray) -> tuple[Candidates, Candidates]:
    """Take the rows that are sure in either, as many of each, so that what lies nearest stands in the same row."""
    count = max(int(_is_sure(one).sum()), int(_is_sure(two).sum()))
    one, two = (_rows(found, np.argsort(-found.probability.max(axis=1))[:count]) for found in (one, two))
    apart = np.abs(_apart(_places(one, side_px)[:, None], _places(two, side_px)[None])).max(axis=2, initial=0.0)
    unlike = np.abs(one.probability[:, None] - two.probability[None]).max(axis=2, initial=0.0)
    # Finite, so that there is a best pairing whatever is missing.
    first, second = linear_sum_assignment(np.minimum(np.maximum(apart, unlike), 1e6))
    return _rows(one, first), _rows(two, second)
