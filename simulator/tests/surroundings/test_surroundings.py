"""What lies beyond the fence: off the site, within reach, affordable, the same for the same seed; shade."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from laws import seeds

from standoff.core.homography import FloatArray
from standoff_sim.ground.terrain import Terrain
from standoff_sim.ground.terrain_plan import TerrainPlan
from standoff_sim.scene.scene import NOTHING, PARKED, Batch
from standoff_sim.solids.mesh import Mesh, Surface
from standoff_sim.solids.panels import level, panels, upright
from standoff_sim.surroundings.buildings import COTTAGES, FLATS, SHEDS, House, building, scaffolding
from standoff_sim.surroundings.outskirts import CAR_VARIANTS, STREET_VARIANTS, lay_land, lay_street, parked_car
from standoff_sim.surroundings.surroundings import REACH_M, Setting, make_surroundings
from standoff_sim.surroundings.vegetation import (
    BUSH_VARIANTS,
    FAR_VARIANTS,
    TREE_VARIANTS,
    bush,
    far_tree,
    tree,
)

_PLANTS = [
    *(partial(tree, i) for i in range(TREE_VARIANTS)),
    *(partial(bush, i) for i in range(BUSH_VARIANTS)),
    *(partial(far_tree, i) for i in range(FAR_VARIANTS)),
]
_BUILT = [
    *(partial(building, house) for house in (*FLATS, *COTTAGES, *SHEDS)),
    *(partial(parked_car, i) for i in range(CAR_VARIANTS)),
    *(partial(lay_street, 800.0, 8.0, i) for i in range(STREET_VARIANTS)),
    partial(scaffolding, 30, 20),
]


def flat_terrain() -> Terrain:
    nothing = np.zeros((2, 2, 3), np.uint8)
    return Terrain(
        TerrainPlan(), np.array([-60.0, -60.0]), 1.0, np.zeros((121, 121), np.float32), nothing, nothing[..., 0]
    )


def world_points(batch: Batch) -> FloatArray:
    local = np.column_stack([batch.mesh.vertices_m, np.ones(len(batch.mesh.vertices_m))])
    points: FloatArray = np.einsum("nij,vj->nvi", batch.poses.astype(np.float64), local)[..., :3].reshape(-1, 3)
    return points


@pytest.mark.parametrize("seed", seeds(3))
@pytest.mark.parametrize("setting", list(Setting))
def test_surroundings_stay_off_the_site_within_reach_and_within_the_budget(setting: Setting, seed: int) -> None:
    batches = make_surroundings(np.random.default_rng(seed), flat_terrain(), setting=setting)
    assert sum(len(batch.mesh.triangles) * len(batch.poses) for batch in batches) < 120_000
    for batch in batches:
        assert batch.entity_id in (NOTHING, PARKED)
        points = world_points(batch)
        assert np.isfinite(points).all()
        inwards_m = 60.0 - np.abs(points[:, :2]).max(axis=1)
        built = batch.mesh.surface[0] not in (Surface.WOOD, Surface.FOLIAGE)
        assert inwards_m.max() < (0.1 if built else 10.0)
        assert np.abs(points[:, :2]).max() < 1.7 * REACH_M


@pytest.mark.parametrize("setting", list(Setting))
def test_the_same_seed_gives_the_same_surroundings_bit_for_bit(setting: Setting) -> None:
    first, second = (
        make_surroundings(
            np.random.default_rng(4), flat_terrain(), setting=setting, shade_to_sun=np.array([0.5, -0.5, 0.7])
        )
        for _ in range(2)
    )
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.poses, other.poses)
        np.testing.assert_array_equal(one.tint, other.tint)
        np.testing.assert_array_equal(one.mesh.vertices_m, other.mesh.vertices_m)
        np.testing.assert_array_equal(one.mesh.albedo, other.mesh.albedo)


def test_meshes_are_built_once() -> None:
    first, second = (
        make_surroundings(np.random.default_rng(seed), flat_terrain(), setting=Setting.SUBURB) for seed in (0, 1)
    )
    known = {id(batch.mesh) for batch in first}
    assert sum(id(batch.mesh) in known for batch in second) > len(second) / 2


@pytest.mark.parametrize("azimuth_deg", [100.0, 180.0, 230.0, 350.0])
@pytest.mark.parametrize("elevation_deg", [20.0, 55.0])
def test_a_tall_building_throws_its_shade_on_the_site(azimuth_deg: float, elevation_deg: float) -> None:
    azimuth, elevation = np.deg2rad([azimuth_deg, elevation_deg])
    to_sun = np.array([np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)])
    open_country = make_surroundings(np.random.default_rng(1), flat_terrain(), setting=Setting.COUNTRY)
    shaded = make_surroundings(np.random.default_rng(1), flat_terrain(), setting=Setting.COUNTRY, shade_to_sun=to_sun)

    def farthest_in_m(batches: tuple[Batch, ...]) -> float:
        """Return how far inside the border the shadow of a wall or roof reaches."""
        built = [batch for batch in batches if batch.mesh.surface[0] == Surface.CONCRETE]
        points = np.concatenate([world_points(batch) for batch in built])
        shadow = points[:, :2] - points[:, 2:] / to_sun[2] * to_sun[:2]
        return float((60.0 - np.abs(shadow).max(axis=1)).max())

    assert farthest_in_m(shaded) > 12.0
    assert farthest_in_m(shaded) > farthest_in_m(open_country)


@pytest.mark.parametrize("make", [*_PLANTS, *_BUILT])
def test_meshes_have_unit_normals_plausible_albedo_and_stand_on_the_ground(make: Callable[[], Mesh]) -> None:
    mesh = make()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-3)
    fixed = mesh.albedo[mesh.tintable == 0.0]
    assert mesh.albedo.min() >= 0.0 and (len(fixed) == 0 or fixed.max() <= 0.85)
    assert mesh.triangles.max() < len(mesh.vertices_m)
    assert -1.0 < mesh.vertices_m[:, 2].min() < 0.5
    assert make() is mesh


@pytest.mark.parametrize("house", [*FLATS, *COTTAGES, *SHEDS])
def test_a_building_is_as_large_as_it_says_with_walls_facing_outwards(house: House) -> None:
    mesh = building(house)
    length_m, depth_m, height_m = house.size_m
    extent = np.ptp(mesh.vertices_m, axis=0)
    assert extent[0] == pytest.approx(length_m, abs=1.2) and extent[1] == pytest.approx(depth_m, abs=1.2)
    assert extent[2] >= height_m - 0.1
    corners = mesh.vertices_m[mesh.triangles]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(facing, axis=1)
    given = mesh.normals[mesh.triangles[:, 0]]
    agrees = np.einsum("ij,ij->i", facing, given)[area > 1e-6]
    assert np.all(agrees > 0.0)
    glass = mesh.surface == Surface.GLASS
    assert np.all(np.einsum("ij,ij->i", mesh.normals[glass, :2], mesh.vertices_m[glass, :2]) > 0.0)


def test_panels_face_the_side_from_which_they_run_counter_clockwise() -> None:
    mesh = panels(level(0.0, 0.0, 3.0, 2.0, 1.0), (0.5, 0.5, 0.5))
    np.testing.assert_allclose(mesh.normals, np.tile([0.0, 0.0, 1.0], (4, 1)))
    wall = panels(upright(np.zeros((1, 2)), np.array([[2.0, 0.0]]), np.zeros(1), np.ones(1)), (0.5, 0.5, 0.5))
    np.testing.assert_allclose(wall.normals, np.tile([0.0, -1.0, 0.0], (4, 1)))


def test_land_leaves_the_site_free_and_covers_everything_else() -> None:
    land = lay_land(np.random.default_rng(0), (130.0, 90.0), 300.0, ("#808080", "#606a40"), Surface.FOLIAGE)
    corners = land.vertices_m[land.triangles]
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    doubled = np.cross(one, two)
    area = 0.5 * np.linalg.norm(doubled, axis=1).sum()
    outer = np.ptp(land.vertices_m[:, :2], axis=0)
    assert area == pytest.approx(outer[0] * outer[1] - 130.0 * 90.0, rel=1e-4)
    middle = corners.mean(axis=1)
    assert not np.any((np.abs(middle[:, 0]) < 65.0) & (np.abs(middle[:, 1]) < 45.0))
