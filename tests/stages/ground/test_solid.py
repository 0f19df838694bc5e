from __future__ import annotations

import cv2
import numpy as np
import pytest
from drawn_solid import lens, random_state
from tolerances import GEOMETRY_REL

from standoff.core.homography import BoolArray, FloatArray
from standoff.stages.ground import ReferenceShape
from standoff.stages.ground.solid import STATE, SolidState, sample_edges, visible_edges

SHAPES = (
    ReferenceShape.square(2.89),
    ReferenceShape.rectangle(1.6, 3.2),
    ReferenceShape.from_sides((4.4, 2.6, 2.6, 3.0), diagonal_m=4.4),
    ReferenceShape.from_corners([[0.0, 0.0], [3.2, 0.0], [1.0, 2.6]]),
    ReferenceShape.regular(7, 1.2),
)

_SURFACE_M = 1e-9


def _state(seed: int, height_m: float = 1.0) -> tuple[ReferenceShape, SolidState]:
    shape = SHAPES[seed % len(SHAPES)]
    return shape, random_state(np.random.default_rng(seed), shape, lens(), height_m)


def _inside(shape: ReferenceShape, height_m: float, points_m: FloatArray) -> BoolArray:
    """Return whether points lie in the solid, not on its surface."""
    starts, sides = shape.corners_m, np.roll(shape.corners_m, -1, axis=0) - shape.corners_m
    unit = sides / np.linalg.norm(sides, axis=1)[:, None]
    apart = points_m[:, None, :2] - starts
    depth = unit[:, 0] * apart[..., 1] - unit[:, 1] * apart[..., 0]
    level = (points_m[:, 2] > _SURFACE_M) & (points_m[:, 2] < height_m - _SURFACE_M)
    return np.asarray(level & (depth > _SURFACE_M).all(axis=1))


def _all_edges(corners: int) -> FloatArray:
    """Return (3 N, 2, 2): corner and share of the height of both ends."""
    around = [(k, (k + 1) % corners) for k in range(corners)]
    level = [[(a, share), (b, share)] for share in (1.0, 0.0) for a, b in around]
    return np.array(level + [[(k, 1.0), (k, 0.0)] for k in range(corners)])


def _name(ends: FloatArray) -> tuple[tuple[float, ...], ...]:
    """Return an edge as something that has no direction."""
    return tuple(sorted(tuple(end) for end in ends.round(6).tolist()))


def test_the_edges_that_no_part_of_the_solid_hides_are_the_visible_ones() -> None:
    tried = 0
    for seed in range(40):
        shape, state = _state(seed)
        edges, doubt_px, _ = visible_edges(shape, state)
        # Of a narrow side the two edges are one, which another test looks at.
        if doubt_px.any():
            continue
        tried += 1
        claimed = {_name(edge) for edge in edges}
        for (a, share_a), (b, share_b) in _all_edges(len(shape.corners_m)):
            ends = np.array([[*shape.corners_m[int(a)], share_a], [*shape.corners_m[int(b)], share_b]])
            middle = ends.mean(axis=0) * (1.0, 1.0, state.height_m)
            ray = middle + np.linspace(0.0, 1.0, 2001)[:, None] * (state.view.position_m - middle)
            assert (_name(ends) in claimed) != _inside(shape, state.height_m, ray).any()
    assert tried >= 20


@pytest.mark.parametrize("seed", range(10))
def test_the_outline_of_the_whole_solid_is_the_hull_of_its_corners(seed: int) -> None:
    shape, state = _state(seed)
    scale = np.array([1.0, 1.0, state.height_m])
    ends = np.concatenate(visible_edges(shape, state)[0]) * scale
    corners = np.concatenate(
        [np.column_stack([shape.corners_m, np.full(len(shape.corners_m), z)]) for z in (0.0, state.height_m)]
    )
    hulls = [cv2.convexHull(state.view.project(points).astype(np.float32)) for points in (ends, corners)]
    assert cv2.contourArea(hulls[0]) == pytest.approx(cv2.contourArea(hulls[1]), rel=1e-5)


@pytest.mark.parametrize("seed", range(6))
def test_samples_lie_on_their_edges_and_their_normals_across(seed: int) -> None:
    shape, state = _state(seed)
    samples = sample_edges(shape, state)
    np.testing.assert_allclose(state.view.project(samples.points_m(state.height_m)), samples.points_px, rtol=1e-9)
    for edge in np.unique(samples.edge):
        mine = samples.points_px[samples.edge == edge]
        along = (mine[-1] - mine[0]) @ samples.normal[samples.edge == edge].T
        np.testing.assert_allclose(along, 0.0, atol=1e-6)


def test_a_side_too_narrow_to_have_two_edges_has_one_in_doubt_by_half_its_width() -> None:
    shape, tall = _state(4)
    flat = SolidState(tall.view, 0.02)
    edges, doubt_px, lower_side = visible_edges(shape, flat)
    narrow = edges[: len(shape.corners_m), 0, 2] == 0.5
    assert narrow.any() and (doubt_px[: len(narrow)] > 0).tolist() == narrow.tolist()
    assert (lower_side == -1).all()


def test_a_plate_without_height_has_no_doubt_and_no_lower_edges() -> None:
    shape, tall = _state(4)
    samples = sample_edges(shape, SolidState(tall.view, 0.0))
    np.testing.assert_allclose(samples.doubt_px, 0.0, atol=1e-9)


def test_a_change_of_a_state_leads_there_and_no_height_falls_below_the_ground() -> None:
    _, state = _state(2)
    change = np.array([0.02, -0.01, 0.03, 0.5, -0.4, 0.2, 0.05, 0.01, 0.1])
    np.testing.assert_allclose(state.changed(change).change_from(state), change, atol=1e3 * GEOMETRY_REL)
    assert state.changed(np.eye(STATE)[-1] * -5.0).height_m == 0.0
