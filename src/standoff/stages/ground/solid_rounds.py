"""The arithmetic of one round of a fit to a solid's edges, compiled: some hundred samples, and a dozen rounds a frame.

Sample n lies on edge `edge[n]`, one of `count`. Lengths are px along the sample's normal. Eyes are told as by
`projection.eye_of`, samples and looks as `EdgeSamples` and `Looks` hold them.
"""

from __future__ import annotations

import numpy as np

from standoff.core.compiled import compiled, solved
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.stages.ground.lines import TUKEY
from standoff.stages.ground.projection import projected

_CORRELATED = 6.0
"""Samples next to each other share blur, stains and shadows: so many count as one independent observation."""

_EDGE_SIGMA_PX = 0.12
"""No edge is known better than this, whatever its samples' scatter: lens blur, shading and compression pull it."""

_PATCHY_PX = 4.0
"""An edge of which hardly anything agrees may be something else's, off by about so much; one that is whole is not."""

_MIN_SCATTER_PX = 0.15
_LEAST_SHARE = 0.35
"""An edge of which less than this share is found contributes nothing: what was found is something else."""

_MIN_SAMPLES = 12


@compiled
def find_change(
    residual: FloatArray,
    found: BoolArray,
    jacobian: FloatArray,
    inside: BoolArray,
    edge: IntArray,
    doubt_px: FloatArray,
    prior_information: FloatArray,
    prior_pull: FloatArray,
    most: FloatArray,
) -> tuple[FloatArray, float]:
    """Return the change (P,) that the edges and a prior ask for, and how far it moves a sample at most, in px.

    Args:
        residual: (N,) as `associate` returns it.
        found: (N,).
        jacobian: (N, P).
        inside: (N,) whether the picture holds what was looked at.
        edge: (N,) of each.
        doubt_px: (count,) of the edges.
        prior_information: (P, P).
        prior_pull: (P,) of the prior.
        most: (P,) that the change may be.

    Returns:
        Both NaN where there is too little to fit to.
    """
    size = len(most)
    change, furthest_px = np.full(size, np.nan), 0.0
    weight, scatter_px = weigh(residual, found, inside, edge, doubt_px)
    believed = 0
    for n in range(len(weight)):
        believed += weight[n] > 0.0
    if believed < _MIN_SAMPLES:
        return change, np.nan
    information, pull = normal_equations(jacobian, residual, weight, scatter_px, edge, doubt_px)
    step = solved(information + prior_information, (pull + prior_pull).reshape(-1, 1))
    for k in range(size):
        if not np.isfinite(step[k, 0]):
            return change, np.nan
        change[k] = min(max(step[k, 0], -most[k]), most[k])
    for n in range(len(weight)):
        if weight[n] > 0.0:
            moved_px = 0.0
            for k in range(size):
                moved_px += jacobian[n, k] * change[k]
            furthest_px = max(furthest_px, abs(moved_px))
    return change, furthest_px


@compiled
def associate(
    position_m: FloatArray,
    rotation: FloatArray,
    matrix: FloatArray,
    distortion: FloatArray,
    height_m: float,
    xy_m: FloatArray,
    z_share: FloatArray,
    samples_px: FloatArray,
    normal: FloatArray,
    edge: IntArray,
    count: int,
    offset_px: FloatArray,
    steepness: FloatArray,
    gate_px: float,
) -> tuple[FloatArray, BoolArray, FloatArray]:
    """Choose an edge of the picture for each sample, as a state expects them.

    Returns:
        (N,) distance from the state's edge to the chosen one along the normal, 0 where there is none; (N,) whether
        there is one; (N, 9) how the state's edge moves along the normal.
    """
    places = np.empty((len(z_share), 3))
    for n in range(len(z_share)):
        places[n, 0], places[n, 1], places[n, 2] = xy_m[n, 0], xy_m[n, 1], z_share[n] * height_m
    points_px, by_view, by_point = projected(places, position_m, rotation, matrix, distortion)
    moved_px, jacobian = expect_edges(points_px, by_view, by_point, samples_px, normal, z_share)
    residual, found = choose_edges(moved_px, edge, count, offset_px, steepness, gate_px)
    return residual, found, jacobian


@compiled
def support_of(
    residual: FloatArray, found: BoolArray, inside: BoolArray, edge: IntArray, doubt_px: FloatArray, near_px: float
) -> FloatArray:
    """Return (count,) the share of each edge's samples in the picture that are found within `near_px` and its doubt.

    NaN where none lies in the picture.
    """
    hits, looked = np.zeros(len(doubt_px)), np.zeros(len(doubt_px))
    for n in range(len(residual)):
        looked[edge[n]] += inside[n]
        hits[edge[n]] += found[n] and abs(residual[n]) <= near_px + doubt_px[edge[n]]
    return hits / looked


@compiled
def expect_edges(
    points_px: FloatArray,
    by_view: FloatArray,
    by_point: FloatArray,
    samples_px: FloatArray,
    normal: FloatArray,
    z_share: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return (N,) how far along its normal each sample has moved, and (N, 9) how it moves with the state.

    Args:
        points_px: (N, 2) where the state puts the samples.
        by_view: (N, 2, 8) their derivative by a change of the view.
        by_point: (N, 2, 3) by their places.
        samples_px: (N, 2) where they were when they were looked at.
        normal: (N, 2) of their edges then.
        z_share: (N,) height of each as a share of the solid's.
    """
    count, views = len(points_px), by_view.shape[2]
    moved_px, jacobian = np.empty(count), np.empty((count, views + 1))
    for n in range(count):
        x, y = normal[n, 0], normal[n, 1]
        moved_px[n] = (points_px[n, 0] - samples_px[n, 0]) * x + (points_px[n, 1] - samples_px[n, 1]) * y
        for k in range(views):
            jacobian[n, k] = by_view[n, 0, k] * x + by_view[n, 1, k] * y
        jacobian[n, views] = (by_point[n, 0, 2] * x + by_point[n, 1, 2] * y) * z_share[n]
    return moved_px, jacobian


@compiled
def choose_edges(
    expected_px: FloatArray,
    edge: IntArray,
    count: int,
    offset_px: FloatArray,
    steepness: FloatArray,
    gate_px: float,
) -> tuple[FloatArray, BoolArray]:
    """Choose an edge of the picture for each sample: the steepest near where it is expected, all on an edge alike.

    Args:
        expected_px: (N,) where the state puts each sample.
        edge: (N,) of each.
        count: Of edges.
        offset_px: (N, K) edges of the picture; NaN where there are fewer.
        steepness: (N, K) of each, signed.
        gate_px: How far one may be from where it is expected.

    Returns:
        (N,) distance from what is expected to the chosen one, 0 where there is none; (N,) whether there is one.
    """
    samples, kept = offset_px.shape
    nearness = np.zeros((samples, kept))
    # All of one edge has its bright side on the same side.
    polarity = np.zeros(count)
    for n in range(samples):
        best, at = 0.0, 0
        for k in range(kept):
            distance = offset_px[n, k] - expected_px[n]
            if abs(distance) <= gate_px:
                nearness[n, k] = abs(steepness[n, k]) * np.exp(-0.5 * (distance / (0.5 * gate_px)) ** 2)
                if nearness[n, k] > best:
                    best, at = nearness[n, k], k
        polarity[edge[n]] += np.sign(steepness[n, at]) * best
    residual, chosen = np.zeros(samples), np.zeros(samples, dtype=np.bool_)
    for n in range(samples):
        best = 0.0
        for k in range(kept):
            if nearness[n, k] > best and steepness[n, k] * polarity[edge[n]] > 0.0:
                best, residual[n], chosen[n] = nearness[n, k], offset_px[n, k] - expected_px[n], True
    return residual, chosen


@compiled
def edge_medians(values: FloatArray, taken: BoolArray, edge: IntArray, count: int) -> FloatArray:
    """Return (count,) the median of each edge's values (N,), of those that are taken; 0 where none is."""
    medians = np.zeros(count)
    for k in range(count):
        mine = values[taken & (edge == k)]
        if len(mine):
            medians[k] = np.median(mine)
    return medians


@compiled
def weigh(
    residual: FloatArray, found: BoolArray, inside: BoolArray, edge: IntArray, doubt_px: FloatArray
) -> tuple[FloatArray, float]:
    """Return Tukey's weights (N,), 0 where nothing is believed, and the scatter in px that they rest on.

    A doubtful edge may be off as a whole; what counts is how its samples scatter about itself. Nothing of an edge is
    believed of which too little was found: a shadow that crosses one is no edge.

    Args:
        residual: (N,).
        found: (N,) whether there is a residual.
        inside: (N,) whether the picture holds what was looked at.
        edge: (N,) of each.
        doubt_px: (count,) of the edges.
    """
    samples, count = len(residual), len(doubt_px)
    weight = np.zeros(samples)
    if not found.any():
        return weight, _MIN_SCATTER_PX
    centre = edge_medians(residual, found, edge, count)
    about = np.empty(samples)
    for n in range(samples):
        allowed = 2.0 * doubt_px[edge[n]]
        about[n] = residual[n] - min(max(centre[edge[n]], -allowed), allowed)
    scatter_px = max(1.4826 * np.median(np.abs(about[found])), _MIN_SCATTER_PX)
    agreeing, looked = np.zeros(count), np.zeros(count)
    for n in range(samples):
        looked[edge[n]] += inside[n]
        if found[n]:
            weight[n] = max(1.0 - (about[n] / (TUKEY * scatter_px)) ** 2, 0.0) ** 2
            agreeing[edge[n]] += weight[n] > 0.0
    for n in range(samples):
        if agreeing[edge[n]] < _LEAST_SHARE * looked[edge[n]]:
            weight[n] = 0.0
    return weight, scatter_px


@compiled
def normal_equations(
    jacobian: FloatArray,
    residual: FloatArray,
    weight: FloatArray,
    scatter_px: float,
    edge: IntArray,
    doubt_px: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return what all edges say (P, P) and where they pull (P,), each edge's error as a whole included.

    The covariance of one edge's samples is that of independent errors plus one offset that all of them share; its
    inverse is Woodbury's.

    Args:
        jacobian: (N, P) how each sample moves with the parameters.
        residual: (N,).
        weight: (N,) Tukey's.
        scatter_px: Of the samples about their edges.
        edge: (N,) of each.
        doubt_px: (count,) of the edges.
    """
    samples, size = jacobian.shape
    count = len(doubt_px)
    information, pull = np.zeros((size, size)), np.zeros(size)
    shared, pulls, total = np.zeros((count, size)), np.zeros(count), np.zeros(count)
    agreeing, members = np.zeros(count), np.zeros(count)
    for n in range(samples):
        at = edge[n]
        members[at] += 1.0
        if not weight[n] > 0.0:
            continue
        agreeing[at] += 1.0
        certainty = weight[n] / (scatter_px**2 * _CORRELATED)
        total[at] += certainty
        pulls[at] += certainty * residual[n]
        for i in range(size):
            scaled = certainty * jacobian[n, i]
            shared[at, i] += scaled
            pull[i] += scaled * residual[n]
            for j in range(size):
                information[i, j] += scaled * jacobian[n, j]
    for at in range(count):
        patchy_px = _PATCHY_PX * (1.0 - agreeing[at] / max(members[at], 1.0)) ** 2
        shrink = 1.0 / (1.0 / (_EDGE_SIGMA_PX**2 + doubt_px[at] ** 2 + patchy_px**2) + total[at])
        for i in range(size):
            pull[i] -= shrink * pulls[at] * shared[at, i]
            for j in range(size):
                information[i, j] -= shrink * shared[at, i] * shared[at, j]
    return information, pull
