from __future__ import annotations

import numpy as np
import pytest
import shapely
import trimesh
from laws import seeds
from scipy.interpolate import LinearNDInterpolator

from standoff.core.errors import ConfigError
from standoff.core.homography import FloatArray
from standoff_sim.ground.terrain import Terrain
from standoff_sim.ground.terrain_plan import TerrainPlan
from standoff_sim.scene.covers import COVER_KINDS, make_cover
from standoff_sim.scene.reference import (
    BOARD_M,
    REFERENCE_KINDS,
    SQUARE_FOOTING_M,
    board_corners_m,
    make_reference,
)
from standoff_sim.scene.scene import Batch, Reference

LEVEL_M = 1.25
CENTRE_M = (7.3, -11.6)
SEEDS = range(5)


def level_ground() -> Terrain:
    height_m = np.full((101, 101), LEVEL_M, dtype=np.float32)
    dull = np.zeros((2, 2), dtype=np.uint8)
    return Terrain(TerrainPlan(), np.array([-50.0, -50.0]), 1.0, height_m, np.zeros((2, 2, 3), dtype=np.uint8), dull)


def reference_of(kind: str, seed: int, worn: bool = True) -> Reference:
    rng = np.random.default_rng(seed)
    return make_reference(rng, kind, CENTRE_M, 17.0 * seed, level_ground(), 9, worn=worn)


def points_m(batch: Batch) -> FloatArray:
    pose = batch.poses[0].astype(np.float64)
    return np.asarray(batch.mesh.vertices_m.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3])


def sides_m(reference: Reference) -> FloatArray:
    return np.asarray(np.linalg.norm(np.roll(reference.top_m, -1, axis=0) - reference.top_m, axis=1))


@pytest.mark.parametrize("kind", REFERENCE_KINDS)
@pytest.mark.parametrize("seed", seeds(len(SEEDS)))
def test_the_upper_corners_are_vertices_and_nothing_of_the_rim_is_further_out(kind: str, seed: int) -> None:
    reference = reference_of(kind, seed)
    points = points_m(reference.batches[0])
    for corner in reference.top_m:
        assert np.abs(points - corner).max(axis=1).min() < 1e-12
    outline = shapely.Polygon(reference.top_m[:, :2])
    assert outline.buffer(1e-5).contains(shapely.MultiPoint(points[:, :2]))


@pytest.mark.parametrize("kind", REFERENCE_KINDS)
@pytest.mark.parametrize("seed", seeds(len(SEEDS)))
def test_corners_go_counter_clockwise_and_top_lies_straight_above_base(kind: str, seed: int) -> None:
    reference = reference_of(kind, seed)
    ring = shapely.LinearRing(reference.top_m[:, :2])
    assert ring.is_ccw
    assert shapely.Polygon(ring).convex_hull.equals(shapely.Polygon(ring))
    np.testing.assert_array_equal(reference.top_m[:, :2], reference.base_m[:, :2])
    np.testing.assert_allclose(reference.base_m[:, 2], LEVEL_M, atol=1e-6)
    np.testing.assert_allclose(reference.top_m[:, :2].mean(axis=0), CENTRE_M, atol=1e-5)
    assert np.ptp(reference.top_m[:, 2]) < 1e-6
    assert all(batch.entity_id == reference.entity_id == 9 for batch in reference.batches)


@pytest.mark.parametrize(
    ("kind", "low_m", "high_m"),
    [
        ("square_footing", 0.4, 0.6),
        ("quadrilateral_footing", 0.25, 0.35),
        ("painted_square", 0.005, 0.005),
        ("board", 0.02, 0.02),
    ],
)
def test_each_kind_has_its_height(kind: str, low_m: float, high_m: float) -> None:
    for seed in SEEDS:
        reference = reference_of(kind, seed)
        assert low_m - 1e-6 <= reference.top_m[0, 2] - reference.base_m[0, 2] <= high_m + 1e-6


@pytest.mark.parametrize("seed", seeds(len(SEEDS)))
def test_the_square_footing_has_the_papers_side_and_right_angles(seed: int) -> None:
    reference = reference_of("square_footing", seed)
    np.testing.assert_allclose(sides_m(reference), SQUARE_FOOTING_M, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(reference.top_m[0] - reference.top_m[2]), 2**0.5 * 2.89, atol=1e-5)


@pytest.mark.parametrize("seed", seeds(len(SEEDS)))
def test_the_first_edge_points_along_the_heading(seed: int) -> None:
    reference = reference_of("square_footing", seed)
    edge = reference.top_m[1] - reference.top_m[0]
    assert np.rad2deg(np.arctan2(edge[1], edge[0])) % 360.0 == pytest.approx(17.0 * seed, abs=1e-3)


@pytest.mark.parametrize("seed", seeds(len(SEEDS)))
def test_the_quadrilateral_has_sides_of_2_to_4_m_and_no_parallel_pair(seed: int) -> None:
    reference = reference_of("quadrilateral_footing", seed)
    assert sides_m(reference).min() > 2.0 and sides_m(reference).max() < 4.0
    edges = np.roll(reference.top_m, -1, axis=0)[:, :2] - reference.top_m[:, :2]
    turns_deg = np.rad2deg(np.arctan2(edges[:, 1], edges[:, 0]))
    for first in (0, 1):
        apart_deg = (turns_deg[first] - turns_deg[first + 2]) % 180.0
        assert min(apart_deg, 180.0 - apart_deg) > 3.9


@pytest.mark.parametrize("kind", ["square_footing", "quadrilateral_footing"])
@pytest.mark.parametrize("seed", seeds(len(SEEDS)))
def test_what_stands_on_a_footing_keeps_away_from_its_edges(kind: str, seed: int) -> None:
    reference = reference_of(kind, seed)
    points = points_m(reference.batches[0])
    above = points[points[:, 2] > reference.top_m[:, 2].max() + 1e-4]
    rim = shapely.LinearRing(reference.top_m[:, :2])
    assert all(rim.distance(shapely.Point(point)) > 0.5 for point in above[:, :2])


@pytest.mark.parametrize("kind", REFERENCE_KINDS)
def test_a_clean_reference_is_bare_and_has_one_colour_a_face(kind: str) -> None:
    for seed in SEEDS:
        reference = reference_of(kind, seed, worn=False)
        batch = reference.batches[0]
        assert points_m(batch)[:, 2].max() <= reference.top_m[:, 2].max() + 1e-6
        assert len(np.unique(batch.mesh.albedo, axis=0)) <= 2 and batch.dust.max() == 0.0


def test_the_same_seed_makes_the_same_reference() -> None:
    for kind in REFERENCE_KINDS:
        first, again = reference_of(kind, 3), reference_of(kind, 3)
        np.testing.assert_array_equal(first.top_m, again.top_m)
        np.testing.assert_array_equal(first.batches[0].mesh.vertices_m, again.batches[0].mesh.vertices_m)
        np.testing.assert_array_equal(first.batches[0].mesh.albedo, again.batches[0].mesh.albedo)


def test_the_boards_inner_corners_are_a_square_lattice_from_the_top_left() -> None:
    reference = reference_of("board", 0)
    corners = board_corners_m(reference).reshape(7, 7, 3)
    step = BOARD_M / 8
    np.testing.assert_allclose(np.diff(corners, axis=1), np.broadcast_to([step, 0.0, 0.0], (7, 6, 3)), atol=1e-5)
    np.testing.assert_allclose(np.diff(corners, axis=0), np.broadcast_to([0.0, -step, 0.0], (6, 7, 3)), atol=1e-5)
    np.testing.assert_allclose(corners[0, 0, :2] - CENTRE_M, [-3 * step, 3 * step], atol=1e-5)


def test_squares_that_share_an_edge_differ_and_black_meets_white_at_the_corners() -> None:
    reference = reference_of("board", 2)
    batch = reference.batches[0]
    points, up = points_m(batch), batch.mesh.normals[:, 2] > 0.9
    on_top = up & (points[:, 2] > reference.top_m[0, 2] - 1e-6)
    for corner in board_corners_m(reference):
        touching = on_top & (np.linalg.norm(points - corner, axis=1) < 1e-4)
        tones = np.sort(batch.mesh.albedo[touching, 0])
        assert len(tones) == 4 and tones[1] < 0.1 and tones[2] > 0.5


def test_unknown_kinds_are_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="square_footing"):
        reference_of("triangle", 0)
    with pytest.raises(ConfigError, match="sand_corner"):
        make_cover(np.random.default_rng(0), "snow", reference_of("board", 0), level_ground(), 0.0, 1.0)


def cover_of(kind: str, reference: Reference, seed: int) -> Batch:
    cover = make_cover(np.random.default_rng(seed), kind, reference, level_ground(), 2.0, 5.0)
    assert (cover.start_s, cover.stop_s) == (2.0, 5.0)
    return cover.batch


def height_over(batch: Batch, xy_m: FloatArray) -> FloatArray:
    points = points_m(batch)
    upwards = batch.mesh.normals[:, 2] > 0.05
    return np.asarray(LinearNDInterpolator(points[upwards, :2], points[upwards, 2], fill_value=-np.inf)(xy_m))


def highest_over(batch: Batch, xy_m: FloatArray) -> FloatArray:
    """Return (N,) heights of the highest surface over points, for a mesh of several bodies."""
    points = points_m(batch)
    bodies = trimesh.graph.connected_components(trimesh.Trimesh(points, batch.mesh.triangles, process=False).edges)
    heights = [LinearNDInterpolator(points[body, :2], points[body, 2], fill_value=-np.inf)(xy_m) for body in bodies]
    return np.asarray(np.max(heights, axis=0))


@pytest.mark.parametrize("shape", ["square_footing", "quadrilateral_footing", "painted_square"])
@pytest.mark.parametrize("kind", ["sand_corner", "plate", "tarpaulin"])
@pytest.mark.parametrize("seed", seeds(len(SEEDS)))
def test_a_cover_hides_a_whole_corner(shape: str, kind: str, seed: int) -> None:
    reference = reference_of(shape, seed)
    batch = cover_of(kind, reference, seed)
    turn = np.linspace(0.0, 2 * np.pi, 13)
    around = np.vstack([[0.0, 0.0], 0.1 * np.column_stack([np.cos(turn), np.sin(turn)])])
    outline = shapely.Polygon(reference.top_m[:, :2])
    hidden = []
    for corner in reference.top_m:
        spots = corner[:2] + around
        spots = spots[[outline.buffer(1e-6).contains(shapely.Point(spot)) for spot in spots]]
        hidden.append(bool(np.all(height_over(batch, spots) > corner[2])))
    assert sum(hidden) == 1


@pytest.mark.parametrize("shape", ["square_footing", "quadrilateral_footing", "painted_square"])
@pytest.mark.parametrize("seed", SEEDS[:2])
def test_sand_along_a_side_hides_that_edge_and_its_corners(shape: str, seed: int) -> None:
    reference = reference_of(shape, seed)
    heaps = cover_of("sand_side", reference, seed)
    top = reference.top_m
    share = np.linspace(0.0, 1.0, 101)[:, None, None]
    lines = top * (1 - share) + np.roll(top, -1, axis=0) * share
    heights_m = highest_over(heaps, lines[..., :2].reshape(-1, 2)).reshape(101, 4)
    hidden = (heights_m > lines[..., 2]).mean(axis=0)
    assert sorted(hidden)[-1] > 0.97
    assert sorted(hidden)[0] == 0.0


@pytest.mark.parametrize("shape", ["square_footing", "quadrilateral_footing", "painted_square"])
@pytest.mark.parametrize("kind", ["sand_edge", "sand_blanket"])
@pytest.mark.parametrize("seed", seeds(len(SEEDS)))
def test_sand_hides_part_of_one_edge_and_leaves_the_corners(shape: str, kind: str, seed: int) -> None:
    reference = reference_of(shape, seed)
    batch = cover_of(kind, reference, seed)
    top = reference.top_m
    share = np.linspace(0.0, 1.0, 101)[:, None]
    lengths = []
    for start, stop in zip(top, np.roll(top, -1, axis=0), strict=True):
        line = start * (1 - share) + stop * share
        lengths.append(float(np.mean(height_over(batch, line[:, :2]) > line[:, 2])))
    assert 0.15 < max(lengths) < 0.99
    assert np.all(height_over(batch, top[:, :2]) < top[:, 2])


@pytest.mark.parametrize("kind", COVER_KINDS)
@pytest.mark.parametrize("seed", seeds(len(SEEDS)))
def test_a_cover_rises_from_the_ground_and_lies_partly_on_the_object(kind: str, seed: int) -> None:
    reference = reference_of("square_footing", seed)
    batch = cover_of(kind, reference, seed)
    assert batch.poses[0, 2, 3] == pytest.approx(LEVEL_M)
    points = points_m(batch)
    assert points[:, 2].min() > LEVEL_M - 0.3 and points[:, 2].max() < reference.top_m[0, 2] + 0.9
    outline = shapely.Polygon(reference.top_m[:, :2])
    on_it = outline.intersection(shapely.MultiPoint(points[:, :2]).convex_hull).area
    assert 0.02 * outline.area < on_it < 0.7 * outline.area
    assert batch.entity_id == 0


@pytest.mark.parametrize("seed", seeds(len(SEEDS)))
def test_a_plates_weight_rests_on_the_object(seed: int) -> None:
    reference = reference_of("square_footing", seed)
    centre = points_m(cover_of("plate", reference, seed)).mean(axis=0)
    assert shapely.Polygon(reference.top_m[:, :2]).contains(shapely.Point(centre[:2]))
