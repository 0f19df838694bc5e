"""Heights that truth depends on: the surface between samples, level patches, pits, heaps; and plans that cannot be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from laws import examples, few, seeds

from standoff_sim.ground.relief import beside, grid_shape, make_relief
from standoff_sim.ground.site_plans import SiteStyle, random_plan
from standoff_sim.ground.terrain import Terrain, make_terrain
from standoff_sim.ground.terrain_plan import FlatPatch, Heap, Path, Pit, Slab, TerrainPlan

_SQUARE: Path = ((-4.0, 2.0), (2.0, 2.0), (2.0, 8.0), (-4.0, 8.0))


def small_terrain(seed: int, cell_m: float = 0.5) -> Terrain:
    plan = TerrainPlan(
        extent_m=(24.0, 20.0),
        cell_m=cell_m,
        roughness=1.0,
        heaps=(Heap((7.0, -5.0), 3.0, 1.5),),
        pits=(Pit(_SQUARE, 2.0),),
        ruts=(((-10.0, -6.0), (0.0, -7.0), (3.0, -2.0)),),
    )
    return make_terrain(np.random.default_rng(seed), plan)


def bare_terrain(height_m: np.ndarray[Any, np.dtype[np.float32]], cell_m: float) -> Terrain:
    rows, columns = height_m.shape
    origin = -np.array([columns - 1, rows - 1]) * cell_m / 2
    nothing = np.zeros((2, 2, 3), np.uint8)
    return Terrain(TerrainPlan(), origin, cell_m, height_m, nothing, nothing[..., 0])


def surface_of(terrain: Terrain) -> trimesh.Trimesh:
    rows, columns = terrain.height_m.shape
    x_m, y_m = np.meshgrid(
        terrain.origin_xy_m[0] + terrain.cell_m * np.arange(columns),
        terrain.origin_xy_m[1] + terrain.cell_m * np.arange(rows),
    )
    vertices = np.column_stack([x_m.ravel(), y_m.ravel(), terrain.height_m.ravel().astype(np.float64)])
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    south = np.column_stack([corner, corner + 1, corner + columns + 1])
    north = np.column_stack([corner, corner + columns + 1, corner + columns])
    return trimesh.Trimesh(vertices, np.concatenate([south, north]), process=False)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_heights_are_those_of_the_triangles_split_from_south_west_to_north_east(seed: int) -> None:
    terrain = small_terrain(seed)
    surface = surface_of(terrain)
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet([1.0, 1.0, 1.0], len(surface.faces))
    points = (surface.triangles * weights[:, :, None]).sum(axis=1)
    np.testing.assert_allclose(terrain.height_at(points[:, :2]), points[:, 2], atol=1e-9)


@examples(50)
@given(
    corners=st.lists(st.floats(-3.0, 3.0, width=32), min_size=4, max_size=4),
    east=st.floats(0.0, 1.0),
    north=st.floats(0.0, 1.0),
)
def test_a_cell_is_two_planes_that_meet_on_its_diagonal(corners: list[float], east: float, north: float) -> None:
    height = np.array(corners, np.float32).reshape(2, 2)
    terrain = bare_terrain(height, 1.0)
    south_west, north_east = float(height[0, 0]), float(height[1, 1])
    third = float(height[0, 1] if east >= north else height[1, 0])
    off, along = abs(east - north), min(east, north)
    expected = south_west * (1.0 - off - along) + north_east * along + third * off
    assert terrain.height_at(np.array([[east - 0.5, north - 0.5]]))[0] == pytest.approx(expected, abs=1e-6)


def test_outside_the_terrain_the_height_is_that_of_its_border() -> None:
    terrain = small_terrain(3)
    outside = np.array([[30.0, 4.2], [-30.0, 1.1], [2.3, 50.0], [2.3, -50.0], [99.0, 99.0]])
    half = np.array(terrain.size_m) / 2
    np.testing.assert_array_equal(terrain.height_at(outside), terrain.height_at(np.clip(outside, -half, half)))
    assert not terrain.inside(outside).any()
    assert terrain.inside(np.array([[0.0, 0.0], [12.0, 10.0]])).all()


@pytest.mark.parametrize("style", list(SiteStyle))
def test_the_border_is_at_height_zero_where_the_surroundings_begin(style: SiteStyle) -> None:
    rng = np.random.default_rng(5)
    height = make_relief(rng, random_plan(rng, style))
    border = np.concatenate([height[0], height[-1], height[:, 0], height[:, -1]])
    np.testing.assert_allclose(border, 0.0, atol=1e-6)


@pytest.mark.parametrize("seed", seeds(3))
def test_a_firm_patch_is_level_within_two_centimetres_whatever_lies_under_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    patches = (FlatPatch((3.0, -8.0), 3.2), FlatPatch((-30.0, 20.0), 6.0, 0.4))
    plan = random_plan(rng, patches=patches)
    terrain = bare_terrain(make_relief(rng, plan), plan.cell_m)
    for patch in patches:
        turn = rng.uniform(0.0, 2 * np.pi, 500)
        away_m = (patch.radius_m - terrain.cell_m) * np.sqrt(rng.random(500))
        on_it = np.array(patch.centre_m) + away_m[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
        height = terrain.height_at(on_it)
        assert np.ptp(height) < 0.02
        if patch.height_m is not None:
            np.testing.assert_allclose(height, patch.height_m, atol=0.02)


def test_a_soft_patch_keeps_part_of_the_relief() -> None:
    def spread_m(firmness: float) -> float:
        patch = FlatPatch((0.0, 0.0), 8.0, None, firmness)
        plan = TerrainPlan(extent_m=(40.0, 40.0), relief_m=0.2, patches=(patch,))
        height = make_relief(np.random.default_rng(1), plan)
        middle = height.shape[0] // 2
        return float(height[middle - 15 : middle + 15, middle - 15 : middle + 15].std())

    assert spread_m(0.5) == pytest.approx(0.5 * spread_m(0.0), rel=0.01)


@pytest.mark.parametrize("seed", [0, 7])
def test_a_pit_is_as_deep_as_planned_with_walls_steeper_than_sixty_degrees(seed: int) -> None:
    terrain = small_terrain(seed, cell_m=0.3)
    inside, around = np.array([[-1.0, 5.0], [-3.0, 3.0], [1.0, 7.0]]), np.array([[-5.0, 5.0], [-1.0, 1.0], [3.0, 5.0]])
    depth_m = terrain.height_at(around).mean() - terrain.height_at(inside).mean()
    assert depth_m == pytest.approx(2.0, abs=0.3)
    across = np.column_stack([np.linspace(-5.0, -3.0, 400), np.full(400, 5.0)])
    steepness_deg = np.rad2deg(np.arctan(np.abs(np.diff(terrain.height_at(across)) / np.diff(across[:, 0]))))
    assert steepness_deg.max() > 60.0


def test_a_heap_is_high_in_its_middle_and_no_steeper_than_loose_material_stands() -> None:
    heap = Heap((0.0, 0.0), 5.0, 3.0)
    bare = TerrainPlan(extent_m=(30.0, 30.0), relief_m=0.0, roughness=0.0)
    height = make_relief(
        np.random.default_rng(2), TerrainPlan(extent_m=(30.0, 30.0), relief_m=0.0, roughness=0.0, heaps=(heap,))
    )
    np.testing.assert_array_equal(make_relief(np.random.default_rng(2), bare), 0.0)
    assert height.max() == pytest.approx(3.0, abs=0.35)
    slope = np.hypot(*np.gradient(height, bare.cell_m))
    assert np.rad2deg(np.arctan(np.quantile(slope[height > 0.2], 0.9))) < 55.0
    assert np.count_nonzero(height > 0.05) * bare.cell_m**2 < np.pi * 25.0


def test_ruts_lie_on_both_sides_of_their_path() -> None:
    plan = TerrainPlan(extent_m=(40.0, 40.0), relief_m=0.0, roughness=0.0, ruts=(((-12.0, 0.0), (12.0, 0.0)),))
    across = bare_terrain(make_relief(np.random.default_rng(0), plan), plan.cell_m).height_at(
        np.array([[0.0, 1.0], [0.0, -1.0], [0.0, 0.0], [0.0, 5.0]])
    )
    assert across[0] < -0.02 and across[1] < -0.02
    assert across[2] > -0.005 and across[3] == pytest.approx(0.0, abs=1e-3)


def test_a_slab_is_level_and_stands_above_the_ground() -> None:
    slab = Slab(_SQUARE, rise_m=0.3)
    plan = TerrainPlan(extent_m=(40.0, 40.0), relief_m=0.1, slabs=(slab,))
    terrain = bare_terrain(make_relief(np.random.default_rng(0), plan), plan.cell_m)
    grid = np.stack(np.meshgrid(np.linspace(-3.5, 1.5, 20), np.linspace(2.5, 7.5, 20)), axis=-1).reshape(-1, 2)
    top = terrain.height_at(grid)
    assert np.ptp(top) < 0.01
    before = bare_terrain(make_relief(np.random.default_rng(0), TerrainPlan(extent_m=(40.0, 40.0), relief_m=0.1)), 0.3)
    assert top.mean() == pytest.approx(before.height_at(grid).mean() + 0.3, abs=0.03)


@pytest.mark.parametrize("style", few([None, *SiteStyle], quick=2))
def test_the_same_seed_gives_the_same_ground_bit_for_bit(style: SiteStyle | None) -> None:
    def build(seed: int) -> Terrain:
        rng = np.random.default_rng(seed)
        return make_terrain(rng, random_plan(rng, style, extent_m=(60.0, 20.0)))

    first, second, other = build(11), build(11), build(12)
    assert first.plan == second.plan != other.plan
    for name in ("height_m", "albedo", "wetness"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert np.any(first.height_m != other.height_m)


@pytest.mark.parametrize("style", list(SiteStyle))
def test_nothing_is_dug_heaped_or_cast_on_a_patch(style: SiteStyle) -> None:
    for seed in range(6):
        patches = (FlatPatch((0.0, 0.0), 12.0), FlatPatch((25.0, -10.0), 9.0, None, 0.5))
        plan = random_plan(np.random.default_rng(seed), style, patches=patches)
        for patch in patches:
            centre = np.array(patch.centre_m)
            for heap in plan.heaps:
                assert np.linalg.norm(np.array(heap.centre_m) - centre) > heap.radius_m + patch.radius_m
            for corners in [*(pit.outline_m for pit in plan.pits), *(slab.outline_m for slab in plan.slabs)]:
                outline = np.array(corners)
                assert np.linalg.norm(outline - centre, axis=1).min() > patch.radius_m


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"extent_m": (0.0, 120.0)}, "extent_m"),
        ({"extent_m": (120.0, 5000.0)}, "extent_m"),
        ({"extent_m": (float("nan"), 120.0)}, "extent_m"),
        ({"cell_m": 0.0}, "cell_m"),
        ({"cell_m": 0.06, "extent_m": (400.0, 400.0)}, "cells"),
        ({"roughness": 1.5}, "roughness"),
        ({"moisture": -0.1}, "moisture"),
        ({"puddles": 0.9}, "puddles"),
        ({"patches": (FlatPatch((90.0, 0.0), 3.0),)}, "patch"),
        ({"patches": (FlatPatch((0.0, 0.0), -3.0),)}, "patch"),
        ({"heaps": (Heap((0.0, 0.0), 2.0, 5.0),)}, "heap"),
        ({"pits": (Pit(_SQUARE, -1.0),)}, "depth"),
        ({"pits": (Pit(((0.0, 0.0), (1.0, 1.0)), 1.0),)}, "outline"),
        ({"pits": (Pit(((0.0, 0.0), (5.0, 5.0), (5.0, 0.0), (0.0, 5.0)), 1.0),)}, "outline"),
        ({"slabs": (Slab(((0.0, 0.0), (500.0, 0.0), (0.0, 5.0))),)}, "outline"),
        ({"roads": (((0.0, 0.0),),)}, "two points"),
    ],
)
def test_a_plan_that_cannot_be_is_refused_with_a_reason(changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        TerrainPlan(**changes)


def test_the_grid_covers_the_extent() -> None:
    terrain = small_terrain(0)
    assert terrain.size_m == pytest.approx((24.0, 20.0))
    assert terrain.height_m.shape == grid_shape(terrain.plan)
    np.testing.assert_allclose(terrain.origin_xy_m, (-12.0, -10.0))


@examples(30)
@given(st.floats(0.1, 5.0), st.floats(-np.pi, np.pi))
def test_a_shifted_straight_path_keeps_its_distance(offset_m: float, turn: float) -> None:
    line = np.linspace(0.0, 20.0, 7)[:, None] * np.array([np.cos(turn), np.sin(turn)])
    path: Path = tuple((float(x), float(y)) for x, y in line)
    shifted = np.array(beside(path, offset_m))
    np.testing.assert_allclose(np.linalg.norm(shifted - line, axis=1), offset_m, atol=1e-9)
    left = np.array([-np.sin(turn), np.cos(turn)])
    np.testing.assert_allclose((shifted - line) @ left, offset_m, atol=1e-9)


@pytest.mark.parametrize("style", list(SiteStyle))
@pytest.mark.parametrize("seed", seeds(3))
def test_nothing_is_dug_heaped_or_cast_where_somebody_goes(style: SiteStyle, seed: int) -> None:
    way = shapely.LineString([(-40.0, -20.0), (0.0, 5.0), (35.0, 30.0)]).buffer(2.0)
    plan = random_plan(np.random.default_rng(seed), style, ways=[way])
    outlines = [*(pit.outline_m for pit in plan.pits), *(slab.outline_m for slab in plan.slabs)]
    dug = [shapely.Polygon(outline) for outline in outlines]
    heaped = [shapely.Point(heap.centre_m).buffer(0.9 * heap.radius_m) for heap in plan.heaps]
    assert not any(shape.intersects(way) for shape in dug + heaped)
