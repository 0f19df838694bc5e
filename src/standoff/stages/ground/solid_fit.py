"""Find the camera, and the solid's height where it is not known, that explain the edges of one picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray, Luma
from standoff.stages.ground.projection import project
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid import EdgeSamples, SolidState, sample_edges
from standoff.stages.ground.solid_edges import Blurred, Looks, look_across
from standoff.stages.ground.solid_rounds import (
    associate,
    edge_medians,
    find_change,
    normal_equations,
    support_of,
    weigh,
)

_ROUNDS, _SETTLED_ROUNDS = 4, 2
_STILL_PX = 0.01
"""A round that moves no sample by more than this is the last: what is left is a fraction of it."""

_LEAST_GATE_PX, _GATE_SHRINKS, _GATE_MOVES = 2.0, 0.6, 4.0
"""Edges are looked for within a gate: that of the round before, smaller, or so many times what that round moved."""

_SUPPORT_PX = 0.7
_WORTH_SETTLING_PX, _DOUBT_LEFT = 0.2, 0.5
"""A narrow side's doubt of less than this is not worth a decision, and after one so much of it remains."""

_STRIP_BLUR_PX, _STRIP_SHARE, _STRIP_RATIO, _STRIP_DOUBT = 2.5, 0.6, 0.3, 0.35
"""A strip: two edges this near to each other along so much of the length, the fainter one with so much of the other's
steepness. Sharpening makes such pairs, too, but fainter ones."""

_MAX_CHANGE = np.array([0.3, 0.3, 0.3, 20.0, 20.0, 20.0, 0.7, 0.3, 1.0])
"""A round of the fit moves no further: beyond, the derivatives say nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """A normal distribution over states.

    Attributes:
        state: Its middle.
        information: (9, 9) inverse covariance of a change from it.
    """

    state: SolidState
    information: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class SolidFit:
    """What one picture says.

    Attributes:
        state: That explains prior and picture best.
        information: (9, 9) that the picture alone adds.
        support: (E,) share of the samples of each edge that have an edge of the picture on them, of one polarity; NaN
            where the edge is not sampled or lies outside the picture.
        length_px: (E,) visible length of each edge.
        lower_side: (E,) the side whose lower edge each is; -1 for all others.
        scatter_px: Of the samples about the edges.
    """

    state: SolidState
    information: FloatArray
    support: FloatArray
    length_px: FloatArray
    lower_side: IntArray
    scatter_px: float

    def seen_share(self, count: int) -> float:
        """Return the share of the whole outline, of `count` sides, that the picture has."""
        length = self.length_px[:count]
        if not length.sum() > 0:
            return 0.0
        return float(side_support(self.support, self.lower_side, count) @ length / length.sum())


def side_support(support: FloatArray, lower_side: IntArray, count: int) -> FloatArray:
    """Return (count,) the share of each side's upper or lower edge, the better one, that the picture has.

    Args:
        support: (E,) of each visible edge; NaN counts as 0.
        lower_side: (E,) the side whose lower edge each is, or -1.
        count: Sides of the outline, whose upper edges come first.
    """
    best = np.zeros(count)
    for edge, share in enumerate(support.tolist()):
        side = edge if edge < count else lower_side[edge]
        if side >= 0 and share > best[side]:
            best[side] = share
    return best


def fit_solid(
    gray: Luma, shape: ReferenceShape, prior: Belief, half_px: float, start: SolidState | None = None
) -> SolidFit | None:
    """Fit a state to the edges of a picture.

    Args:
        gray: (H, W).
        shape: Of the reference.
        prior: What is known beforehand.
        half_px: How far from the start's edges the picture's may lie.
        start: Where to begin; None: the prior's state.

    Returns:
        The fit, or None if there are too few edges to fit to.

    Source:
        Drummond and Cipolla, Real-time visual tracking of complex structures, 2002; Comport et al. 2006.
    """
    state = prior.state if start is None else start
    samples = sample_edges(shape, state)
    picture = Blurred.around(gray, samples.points_px, half_px) if len(samples) else None
    if picture is None:
        return None
    looks = look_across(picture, samples, half_px)
    moved = _moved(samples, looks, prior, _Place(state, half_px), _ROUNDS)
    if moved is None:
        return None
    settled = _settled(samples, looks, moved.state)
    if settled is not samples or not moved.still:
        moved = _moved(settled, looks, prior, moved, _SETTLED_ROUNDS)
    return None if moved is None else _finished(settled, looks, moved.state)


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """Where a fit is between two rounds.

    Attributes:
        state: The best so far.
        gate_px: How far from it the picture's edges may lie in the next round.
        still: Whether the last round moved next to nothing.
    """

    state: SolidState
    gate_px: float
    still: bool = False


def _moved(samples: EdgeSamples, looks: Looks, prior: Belief, place: _Place, rounds: int) -> _Place | None:
    """Go so many rounds, fewer where nothing moves any more; None where there is too little to fit to."""
    for _ in range(rounds):
        step = _step(samples, looks, place, prior)
        if step is None:
            return None
        change, moved_px = step
        gate_px = max(min(_GATE_SHRINKS * place.gate_px, _GATE_MOVES * moved_px), _LEAST_GATE_PX)
        still = place.gate_px <= _LEAST_GATE_PX and moved_px <= _STILL_PX
        place = _Place(place.state.changed(change), gate_px, still)
        if still:
            break
    return place


def outline_support(picture: Blurred, shape: ReferenceShape, state: SolidState) -> tuple[EdgeSamples, FloatArray]:
    """Return a state's visible edges, and (E,) the share of each that a picture supports, without fitting anything."""
    samples = sample_edges(shape, state)
    samples, looks = _paired(samples, look_across(picture, samples, _LEAST_GATE_PX))
    residual, found, _ = _associated(samples, looks, state, _LEAST_GATE_PX)
    return samples, _support(samples, looks, residual, found)


def _step(samples: EdgeSamples, looks: Looks, place: _Place, prior: Belief) -> tuple[FloatArray, float] | None:
    """Return the change (9,) that one round finds, and how far it moves a sample; None if too little is there."""
    prior_pull = -prior.information @ place.state.change_from(prior.state)
    change, moved_px = find_change(
        *_associated(samples, looks, place.state, place.gate_px),
        looks.inside,
        samples.edge,
        samples.doubt_px,
        prior.information,
        prior_pull,
        _MAX_CHANGE,
    )
    return None if np.isnan(moved_px) else (change, moved_px)


def _paired(samples: EdgeSamples, looks: Looks) -> tuple[EdgeSamples, Looks]:
    """Take an edge that shows as a narrow bright or dark strip as such: what is sure is the middle of the strip.

    Blur pushes the two edges of a strip apart, each by up to a pixel, and leaves their middle where it is. Where a
    narrow side is expected, that is its middle; elsewhere the edge may be on either side of the strip.
    """
    offset_px, steepness = looks.offset_px.copy(), looks.steepness.copy()
    doubt_px = samples.doubt_px.copy()
    first, second = offset_px[:, 0], offset_px[:, 1]
    with np.errstate(invalid="ignore"):
        apart_px = np.abs(first - second)
        strip = apart_px <= 2.0 * samples.doubt_px[samples.edge] + _STRIP_BLUR_PX
        strip &= -steepness[:, 1] * np.sign(steepness[:, 0]) >= _STRIP_RATIO * np.abs(steepness[:, 0])
    count = len(samples.length_px)
    shares = np.bincount(samples.edge, strip, count) / np.maximum(np.bincount(samples.edge, minlength=count), 1)
    for edge in np.flatnonzero(shares >= _STRIP_SHARE):
        mine = samples.edge == edge
        both = mine & strip
        expected = samples.doubt_px[edge] > _WORTH_SETTLING_PX
        doubt_px[edge] = _WORTH_SETTLING_PX if expected else _STRIP_DOUBT * float(np.median(apart_px[both]))
        falling = np.where(first > second, steepness[:, 0], steepness[:, 1])[both]
        middle = ((first + second) / 2.0)[both]
        offset_px[mine], steepness[mine] = np.nan, 0.0
        offset_px[both, 0], steepness[both, 0] = middle, falling
    return replace(samples, doubt_px=doubt_px), replace(looks, offset_px=offset_px, steepness=steepness)


def _settled(samples: EdgeSamples, looks: Looks, state: SolidState) -> EdgeSamples:
    """Decide for each narrow side, once the other edges have fixed the state, whether its upper or lower edge shows.

    Returns:
        The very samples where there is nothing to decide.
    """
    narrow = np.flatnonzero((samples.doubt_px > _WORTH_SETTLING_PX) & (samples.length_px > 0))
    if not len(narrow):
        return samples
    residual, found, _ = _associated(samples, looks, state, _LEAST_GATE_PX + float(samples.doubt_px.max(initial=0.0)))
    offset_px = edge_medians(residual, found, samples.edge, len(samples.length_px))
    z_share, doubt_px = samples.z_share.copy(), samples.doubt_px.copy()
    expected = project(state.view, samples.points_m(state.height_m))
    for edge in narrow:
        mine = samples.edge == edge
        for share in (0.0, 1.0):
            places = np.column_stack([samples.xy_m[mine], np.full(mine.sum(), share * state.height_m)])
            moved = ((project(state.view, places) - expected[mine]) * samples.normal[mine]).sum(axis=1)
            if abs(offset_px[edge] - np.median(moved)) < samples.doubt_px[edge] / 2.0:
                z_share[mine] = share
                doubt_px[edge] *= _DOUBT_LEFT
    return replace(samples, z_share=z_share, doubt_px=doubt_px)


def _finished(samples: EdgeSamples, looks: Looks, state: SolidState) -> SolidFit | None:
    residual, found, jacobian = _associated(samples, looks, state, _LEAST_GATE_PX)
    weight, scatter_px = weigh(residual, found, looks.inside, samples.edge, samples.doubt_px)
    support = _support(samples, looks, residual, found)
    information, _ = normal_equations(jacobian, residual, weight, scatter_px, samples.edge, samples.doubt_px)
    if not np.isfinite(information).all():
        return None
    return SolidFit(state, information, support, samples.length_px, samples.lower_side, scatter_px)


def _associated(
    samples: EdgeSamples, looks: Looks, state: SolidState, gate_px: float
) -> tuple[FloatArray, BoolArray, FloatArray]:
    """Choose an edge of the picture for each sample; see `associate`."""
    view = state.view
    return associate(
        view.position_m,
        view.site_to_camera,
        view.camera.matrix,
        view.camera.distortion,
        state.height_m,
        samples.xy_m,
        samples.z_share,
        samples.points_px,
        samples.normal,
        samples.edge,
        len(samples.length_px),
        looks.offset_px,
        looks.steepness,
        gate_px,
    )


def _support(samples: EdgeSamples, looks: Looks, residual: FloatArray, found: BoolArray) -> FloatArray:
    return support_of(residual, found, looks.inside, samples.edge, samples.doubt_px, _SUPPORT_PX)
