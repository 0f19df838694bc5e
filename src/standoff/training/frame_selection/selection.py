"""Choose frames: unsure ones first, each unlike those chosen before it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Interval
from typing_extensions import Doc

from standoff.core.homography import FloatArray
from standoff.core.types import Detections
from standoff.training.frame_selection.appearance import blurred

_LEAST_WEIGHT = 0.25
"""Of the surest frame against the most doubtful: also what a detector is sure of may be wrong."""
_SAME_LOOK = 1e-3
"""In standard deviations: nearer than this, two frames show the same."""


@dataclass(frozen=True, slots=True)
class SelectionParams:
    """Settings of the selection."""

    frames: Annotated[int, Ge(1), Doc("How many to choose, at most.")] = 100
    threshold: Annotated[
        float, Interval(gt=0, lt=1), Doc("Score from which a box counts and is proposed to whoever labels.")
    ] = 0.3
    least_gap_s: Annotated[float, Ge(0), Doc("Time between two chosen frames.")] = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class CandidateFrame:
    """One frame that was looked at.

    Attributes:
        index: In the source.
        time_s: From the start of the source.
        detections: All, unsure ones included.
        doubt: Sum of the boxes' doubts.
        flicker: How many boxes that count have no counterpart in the next frame.
        sharpness: See `appearance.sharpness`.
        look: (D,) see `appearance.describe`.
        wanted: Why somebody asks for this very frame; empty: nobody does.
    """

    index: int
    time_s: float
    detections: Detections
    doubt: float
    flicker: int
    sharpness: float
    look: FloatArray
    wanted: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """A frame that is worth labelling.

    Attributes:
        candidate: The frame.
        reason: Why, in a few words.
    """

    candidate: CandidateFrame
    reason: str


def choose(candidates: Sequence[CandidateFrame], params: SelectionParams) -> list[Choice]:
    """Choose frames, in the order of time.

    Greedy k-centre with weights: the most doubtful frame first, then again and again the one with the largest
    product of its distance from all that are chosen and a weight that grows with its rank in doubt. Blurred frames
    are left out, and none is nearer in time to another than `least_gap_s`. The result depends on nothing random. What
    somebody asks for comes before all that, however it looks.

    Args:
        candidates: In the order of time.
        params: Settings.

    Returns:
        As many as asked for, or fewer when no other frame is far enough in time or looks any different.

    Source:
        Sener and Savarese, Active Learning for Convolutional Neural Networks: A Core-Set Approach (2018), algorithm 1.
    """
    if not candidates:
        return []
    sharp = ~blurred(np.array([one.sharpness for one in candidates]))
    time_s = np.array([one.time_s for one in candidates])
    unsure = np.array([one.doubt + one.flicker for one in candidates])
    looks = _standardised(np.stack([one.look for one in candidates]))
    weight = _LEAST_WEIGHT + (1.0 - _LEAST_WEIGHT) * _ranks(unsure)
    distance = np.full(len(candidates), np.inf)
    free = sharp.copy()
    chosen: list[int] = [i for i, one in enumerate(candidates) if one.wanted][: params.frames]
    for i in chosen:
        distance = np.minimum(distance, np.linalg.norm(looks - looks[i], axis=1))
        free &= np.abs(time_s - time_s[i]) >= params.least_gap_s
        free[i] = False
    while free.any() and len(chosen) < params.frames:
        gain = np.where(free, weight * (distance if chosen else 1.0), -1.0)
        best = int(gain.argmax())
        if distance[best] <= _SAME_LOOK:
            break
        chosen.append(best)
        distance = np.minimum(distance, np.linalg.norm(looks - looks[best], axis=1))
        free &= np.abs(time_s - time_s[best]) >= params.least_gap_s
        free[best] = False
    doubtful_from = float(np.median(unsure))
    return [Choice(candidates[i], _reason(candidates[i], params.threshold, doubtful_from)) for i in sorted(chosen)]


def _standardised(looks: FloatArray) -> FloatArray:
    """Scale each number to what changes in this video; the length of the whole does not depend on how many change."""
    spread = looks.std(axis=0)
    changing = spread > 1e-6
    if not changing.any():
        return np.zeros((len(looks), 1))
    scaled = (looks[:, changing] - looks[:, changing].mean(axis=0)) / spread[changing]
    return np.asarray(scaled / np.sqrt(changing.sum()))


def _ranks(values: FloatArray) -> FloatArray:
    """Return 0 for the smallest to 1 for the largest; equal values have equal ranks.

    >>> _ranks(np.array([5.0, 1.0, 5.0, 7.0])).tolist()
    [0.5, 0.0, 0.5, 1.0]
    """
    levels, level = np.unique(values, return_inverse=True)
    return np.asarray(level / max(1, len(levels) - 1), dtype=np.float64)


def _reason(candidate: CandidateFrame, threshold: float, doubtful_from: float) -> str:
    if candidate.wanted:
        return candidate.wanted
    flicker = f"{candidate.flicker} that flicker{'s' * (candidate.flicker == 1)}"
    score = candidate.detections.score
    near = int(((score >= 0.5 * threshold) & (score < 0.5 * (1 + threshold))).sum())
    doubtful = f"{near} doubtful box{'es' * (near != 1)}"
    if candidate.doubt + candidate.flicker <= doubtful_from:
        return "unlike the others"
    return ", ".join(text for text, count in ((doubtful, near), (flicker, candidate.flicker)) if count) or "doubtful"
