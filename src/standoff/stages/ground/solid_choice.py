"""Which of several fits of a reference object is believed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import IntArray, NoGroundMap
from standoff.stages.ground.projection import project
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid import SolidState
from standoff.stages.ground.solid_fit import Belief, SolidFit
from standoff.stages.ground.solid_poses import AROUND, ground_around_px

AMBIGUOUS = "the reference could lie in two ways; its height (square:2.89,height=0.4) or a camera file would tell"
NOT_THERE = "no solid of the reference's shape fits the edges in its box"

_RIVAL_SCORE, _RIVAL_PX = 0.9, 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """The reference in one picture.

    Attributes:
        fit: Where, from all edges.
        prior: What was known beforehand, to which `fit.information` adds.
        alternatives: What else explains the picture nearly as well, a few pixels from it.
    """

    fit: SolidFit
    prior: Belief
    alternatives: tuple[Belief, ...] = ()

    def belief(self) -> Belief:
        """Return what is known now."""
        return Belief(self.fit.state, self.prior.information + self.fit.information)


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A fit and what the picture says of it.

    Attributes:
        score: px of outline that the picture has, less what is bare of it.
        found: The fit.
        believable: Whether that is enough.
    """

    score: float
    found: Found
    believable: bool

    @property
    def state(self) -> SolidState:
        """Where it puts the solid."""
        return self.found.fit.state


def best_of(
    candidates: Sequence[Candidate], shape: ReferenceShape, agrees: Callable[[Belief], bool] | None
) -> Found | NoGroundMap:
    """Return the candidate with the best score that can be believed, unless another one elsewhere is as good.

    The other one need not be believable: where the picture has too little of what is there, it has less of what is not.
    """
    candidates = sorted(candidates, key=lambda one: -one.score)
    best = next((one for one in candidates if one.believable), None)
    if best is None:
        return NoGroundMap(NOT_THERE)
    good = [one for one in candidates if one.score >= _RIVAL_SCORE * best.score]
    if any(_apart_px(best.state, one.state, shape) > _RIVAL_PX for one in good):
        good = [] if agrees is None else [one for one in good if agrees(one.found.belief())]
        if not (good and good[0].believable):
            return NoGroundMap(AMBIGUOUS)
        best = good[0]
        if any(_apart_px(best.state, one.state, shape) > _RIVAL_PX for one in good):
            return NoGroundMap(AMBIGUOUS)
    others = tuple(one.found.belief() for one in good if one is not best and one.believable)
    return replace(best.found, alternatives=others)


def _apart_px(one: SolidState, other: SolidState, shape: ReferenceShape) -> float:
    """Return how far apart two states put the corner that they agree on least."""
    orders = _orders(shape)
    apart = np.linalg.norm(upper_px(other, shape)[orders] - upper_px(one, shape), axis=-1).max(axis=-1)
    if len(shape.corners_m) == 3:
        # Up to four cameras see a triangle in the same place. What they disagree on is the ground around it.
        around = np.linalg.norm(
            ground_around_px(other.view, shape)[orders] - ground_around_px(one.view, shape), axis=-1
        )
        apart = np.maximum(apart, np.nan_to_num(around, nan=np.inf).max(axis=-1) / AROUND)
    return float(apart.min())


def _orders(shape: ReferenceShape) -> IntArray:
    """Return (T, N) the corners in the orders in which the shape looks the same."""
    count = len(shape.corners_m)
    return np.asarray((np.array(shape.turns_onto_itself())[:, None] + np.arange(count)) % count)


def upper_px(state: SolidState, shape: ReferenceShape) -> FloatArray:
    """Return (N, 2) where the upper corners appear."""
    return project(state.view, shape.at_height(state.height_m))
