"""Find the camera, and the solid's height where it is not known, that explain the edges of one picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.pose import CHANGES
from standoff.core.types import ImageArray, IntArray
from standoff.stages.ground.lines import TUKEY
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid import HEIGHT, STATE, EdgeSamples, SolidState, sample_edges
from standoff.stages.ground.solid_edges import Blurred, Looks, look_across

_ROUNDS, _SETTLED = 6, 4
_LEAST_GATE_PX = 2.0
_SUPPORT_PX = 0.7
_MIN_SCATTER_PX = 0.15
_CORRELATED = 6.0
"""Samples next to each other share blur, stains and shadows: so many count as one independent observation."""

_EDGE_SIGMA_PX = 0.12
"""No edge is known better than this, whatever its samples' scatter: lens blur, shading and compression pull it."""

_PATCHY_PX = 4.0
"""An edge of which hardly anything agrees may be something else's, off by about so much; one that is whole is not."""

_WORTH_SETTLING_PX, _DOUBT_LEFT = 0.2, 0.5
"""A narrow side's doubt of less than this is not worth a decision, and after one so much of it remains."""

_STRIP_BLUR_PX, _STRIP_SHARE, _STRIP_RATIO, _STRIP_DOUBT = 2.5, 0.6, 0.3, 0.35
"""A strip: two edges this near to each other along so much of the length, the fainter one with so much of the other's
steepness. Sharpening makes such pairs, too, but fainter ones."""

_LEAST_SHARE = 0.35
"""An edge of which less than this share is found contributes nothing: what was found is something else."""

_MIN_SAMPLES = 12
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
    upper = np.nan_to_num(support[:count], nan=0.0)
    lower = np.flatnonzero(lower_side >= 0)
    np.maximum.at(upper, lower_side[lower], np.nan_to_num(support[lower], nan=0.0))
    return upper


def fit_solid(
    gray: ImageArray, shape: ReferenceShape, prior: Belief, half_px: float, start: SolidState | None = None
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
    gate_px = half_px
    for stage in range(_ROUNDS):
        if stage == _SETTLED:
            samples = _settled(samples, looks, state)
        change = _step(samples, looks, state, prior, gate_px)
        if change is None:
            return None
        state = state.changed(np.clip(change, -_MAX_CHANGE, _MAX_CHANGE))
        gate_px = max(gate_px * 0.6, _LEAST_GATE_PX)
    return _finished(samples, looks, state)


def outline_support(picture: Blurred, shape: ReferenceShape, state: SolidState) -> tuple[EdgeSamples, FloatArray]:
    """Return a state's visible edges, and (E,) the share of each that a picture supports, without fitting anything."""
    samples = sample_edges(shape, state)
    samples, looks = _paired(samples, look_across(picture, samples, _LEAST_GATE_PX))
    residual, _, found = _associated(samples, looks, state, _LEAST_GATE_PX)
    return samples, _support(samples, looks, residual, found)


def _step(samples: EdgeSamples, looks: Looks, state: SolidState, prior: Belief, gate_px: float) -> FloatArray | None:
    """Return the change (9,) that one round of the fit finds, or None if there is too little to fit to."""
    residual, jacobian, found = _associated(samples, looks, state, gate_px)
    weight, scatter_px = _weights(samples, looks, residual, found)
    if (weight > 0).sum() < _MIN_SAMPLES:
        return None
    information, pull = _normal_equations(samples, jacobian, residual, weight, scatter_px)
    pull -= prior.information @ state.change_from(prior.state)
    change = np.asarray(np.linalg.solve(information + prior.information, pull), dtype=np.float64)
    return change if np.isfinite(change).all() else None


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
    """Decide for each narrow side, once the other edges have fixed the state, whether its upper or lower edge shows."""
    residual, _, found = _associated(samples, looks, state, _LEAST_GATE_PX + float(samples.doubt_px.max(initial=0.0)))
    offset_px = _medians(residual, found, samples)
    z_share, doubt_px = samples.z_share.copy(), samples.doubt_px.copy()
    expected = state.view.project(samples.points_m(state.height_m))
    for edge in np.flatnonzero((samples.doubt_px > _WORTH_SETTLING_PX) & (samples.length_px > 0)):
        mine = samples.edge == edge
        for share in (0.0, 1.0):
            places = np.column_stack([samples.xy_m[mine], np.full(mine.sum(), share * state.height_m)])
            moved = ((state.view.project(places) - expected[mine]) * samples.normal[mine]).sum(axis=1)
            if abs(offset_px[edge] - np.median(moved)) < samples.doubt_px[edge] / 2.0:
                z_share[mine] = share
                doubt_px[edge] *= _DOUBT_LEFT
    return replace(samples, z_share=z_share, doubt_px=doubt_px)


def _finished(samples: EdgeSamples, looks: Looks, state: SolidState) -> SolidFit | None:
    residual, jacobian, found = _associated(samples, looks, state, _LEAST_GATE_PX)
    weight, scatter_px = _weights(samples, looks, residual, found)
    support = _support(samples, looks, residual, found)
    information, _ = _normal_equations(samples, jacobian, residual, weight, scatter_px)
    if not np.isfinite(information).all():
        return None
    return SolidFit(state, information, support, samples.length_px, samples.lower_side, scatter_px)


def _normal_equations(
    samples: EdgeSamples, jacobian: FloatArray, residual: FloatArray, weight: FloatArray, scatter_px: float
) -> tuple[FloatArray, FloatArray]:
    """Return what all edges say (9, 9) and where they pull (9,), each edge's error as a whole included.

    The covariance of one edge's samples is that of independent errors plus one offset that all of them share; its
    inverse is Woodbury's.
    """
    count = len(samples.length_px)
    root = np.sqrt(weight / (scatter_px**2 * _CORRELATED))
    rows, values = jacobian * root[:, None], residual * root
    shared, pulls, total = np.zeros((count, STATE)), np.zeros(count), np.zeros(count)
    np.add.at(shared, samples.edge, rows * root[:, None])
    np.add.at(pulls, samples.edge, values * root)
    np.add.at(total, samples.edge, root**2)
    agreeing = np.bincount(samples.edge, weight > 0, count) / np.maximum(np.bincount(samples.edge, minlength=count), 1)
    patchy_px = _PATCHY_PX * (1.0 - agreeing) ** 2
    shrink = 1.0 / (1.0 / (_EDGE_SIGMA_PX**2 + samples.doubt_px**2 + patchy_px**2) + total)
    information: FloatArray = rows.T @ rows - (shared * shrink[:, None]).T @ shared
    pull: FloatArray = rows.T @ values - shared.T @ (shrink * pulls)
    return information, pull


def _associated(
    samples: EdgeSamples, looks: Looks, state: SolidState, gate_px: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Choose an edge of the picture for each sample.

    Returns:
        (N,) distance from the state's edge to the chosen one along the normal, 0 where there is none; (N, 9) how the
        state's edge moves along the normal; (N,) whether there is one.
    """
    points_px, by_view, by_point = state.view.project_with_jacobians(samples.points_m(state.height_m))
    by_height = by_point[:, :, 2] * samples.z_share[:, None]
    jacobian = np.empty((len(samples), STATE))
    jacobian[:, :CHANGES] = np.einsum("ni,nij->nj", samples.normal, by_view)
    jacobian[:, HEIGHT] = (samples.normal * by_height).sum(axis=1)
    expected = ((points_px - samples.points_px) * samples.normal).sum(axis=1)
    distance = looks.offset_px - expected[:, None]
    nearness = np.abs(looks.steepness) * np.exp(-0.5 * (distance / (0.5 * gate_px)) ** 2)
    nearness[~(np.abs(distance) <= gate_px)] = 0.0
    # All of one edge has its bright side on the same side.
    signed = np.zeros(len(samples.length_px))
    best = nearness.argmax(axis=1)
    rows = np.arange(len(samples))
    np.add.at(signed, samples.edge, np.sign(looks.steepness[rows, best]) * nearness[rows, best])
    polarity = np.sign(signed)[samples.edge]
    nearness[np.sign(looks.steepness) != polarity[:, None]] = 0.0
    best = nearness.argmax(axis=1)
    chosen = nearness[rows, best] > 0
    return np.where(chosen, distance[rows, best], 0.0), jacobian, chosen


def _medians(residual: FloatArray, found: BoolArray, samples: EdgeSamples) -> FloatArray:
    """Return (E,) the median residual of each edge; 0 where nothing was found."""
    edge, residual = samples.edge[found], residual[found]
    ordered = residual[np.lexsort((residual, edge))]
    counts = np.bincount(edge, minlength=len(samples.length_px))
    there = np.flatnonzero(counts)
    first = (np.cumsum(counts) - counts)[there]
    medians = np.zeros(len(counts))
    medians[there] = (ordered[first + (counts[there] - 1) // 2] + ordered[first + counts[there] // 2]) / 2.0
    return medians


def _weights(samples: EdgeSamples, looks: Looks, residual: FloatArray, found: BoolArray) -> tuple[FloatArray, float]:
    """Return Tukey's weights (N,), 0 where nothing is believed, and the scatter in px that they rest on.

    A doubtful edge may be off as a whole; what counts is how its samples scatter about itself.
    """
    if not found.any():
        return np.zeros(len(residual)), _MIN_SCATTER_PX
    allowed = 2.0 * samples.doubt_px
    centre = np.clip(_medians(residual, found, samples), -allowed, allowed)
    residual = residual - centre[samples.edge]
    scatter_px = max(1.4826 * float(np.median(np.abs(residual[found]))), _MIN_SCATTER_PX)
    weight: FloatArray = np.maximum(1.0 - (residual / (TUKEY * scatter_px)) ** 2, 0.0) ** 2 * found
    return weight * _believed(samples, looks, weight), scatter_px


def _believed(samples: EdgeSamples, looks: Looks, weight: FloatArray) -> BoolArray:
    """Return (N,) which samples lie on edges of which enough was found: a shadow that crosses one is no edge."""
    count = len(samples.length_px)
    agreeing = np.bincount(samples.edge, weight > 0, count)
    return np.asarray((agreeing >= _LEAST_SHARE * np.bincount(samples.edge, looks.inside, count))[samples.edge])


def _support(samples: EdgeSamples, looks: Looks, residual: FloatArray, found: BoolArray) -> FloatArray:
    count = len(samples.length_px)
    hits = np.bincount(samples.edge, found & (np.abs(residual) <= _SUPPORT_PX + samples.doubt_px[samples.edge]), count)
    looked = np.bincount(samples.edge, looks.inside, count)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(looked > 0, hits / looked, np.nan)
