from __future__ import annotations

import numpy as np
import pytest

from standoff.stages.ground.edge_field import EdgeField
from standoff.stages.ground.edges import Edges

BOX = np.array([40.0, 30.0, 140.0, 110.0])


def _edges(seed: int, count: int = 60) -> Edges:
    rng = np.random.default_rng(seed)
    points = BOX[:2] + rng.uniform(0.0, 1.0, (count, 2)) * (BOX[2:] - BOX[:2])
    angle = rng.uniform(-np.pi, np.pi, count)
    return Edges(points, 50.0 * np.column_stack([np.cos(angle), np.sin(angle)]))


def _along(edges: Edges) -> np.ndarray:
    return np.arctan2(edges.gradient[:, 0], -edges.gradient[:, 1])


@pytest.mark.parametrize("seed", range(4))
def test_an_edge_point_is_found_from_its_own_place_and_along_its_own_direction_either_way(seed: int) -> None:
    edges = _edges(seed, 8)
    field = EdgeField(edges, BOX)
    for turn in (0.0, np.pi, -np.pi):
        np.testing.assert_allclose(field.offsets(edges.points_px, _along(edges) + turn), 0.0, atol=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_no_edge_point_that_runs_the_same_way_is_nearer_than_the_one_found(seed: int) -> None:
    edges = _edges(seed)
    rng = np.random.default_rng([seed, 1])
    places = BOX[:2] + rng.uniform(0.0, 1.0, (300, 2)) * (BOX[2:] - BOX[:2])
    angle = rng.uniform(-np.pi, np.pi, 300)
    found = np.linalg.norm(EdgeField(edges, BOX).offsets(places, angle), axis=1)
    off = np.abs(np.mod(_along(edges) - angle[:, None] + np.pi / 2, np.pi) - np.pi / 2)
    apart = np.linalg.norm(edges.points_px - places[:, None], axis=2)
    # Directions are stepped by 11 degrees, places by pixels: surely so within 11 degrees, surely not beyond 23.
    assert (found <= np.where(off < np.deg2rad(11.0), apart, np.inf).min(axis=1) * 1.05 + 1.5).all()
    assert (found >= np.where(off < np.deg2rad(23.0), apart, np.inf).min(axis=1) - 1e-3).all()


def test_far_outside_and_where_no_edge_runs_that_way_there_is_none() -> None:
    upright = Edges(np.array([[90.0, 70.0]]), np.array([[50.0, 0.0]]))
    field = EdgeField(upright, BOX)
    assert np.isfinite(field.offsets(np.array([[80.0, 70.0]]), np.array([np.pi / 2]))).all()
    assert np.isinf(field.offsets(np.array([[80.0, 70.0]]), np.array([0.0]))).all()
    away = np.array([[-500.0, 70.0], [90.0, 1e9], [np.nan, np.nan]])
    assert np.isinf(field.offsets(away, np.full(3, np.pi / 2))).all()
    nothing = EdgeField(Edges(np.zeros((0, 2)), np.zeros((0, 2))), BOX)
    assert np.isinf(nothing.offsets(BOX[None, :2], np.zeros(1))).all()


def test_a_box_of_any_size_has_a_table_of_the_same_size() -> None:
    assert EdgeField(_edges(1), BOX).cell_px == 1.0
    assert EdgeField(_edges(1), 10.0 * BOX).cell_px > 5.0
