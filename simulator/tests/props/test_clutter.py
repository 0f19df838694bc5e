from __future__ import annotations

import numpy as np
import pytest
import shapely

from standoff.core.homography import FloatArray
from standoff_sim.props.clutter import CLUTTER
from standoff_sim.props.heaps import scatter_litter
from standoff_sim.props.materials import SOILS, bar, block, mound, open_ended, relief, stone, tubular
from standoff_sim.props.prop import Prop
from standoff_sim.scene.scene import Batch
from standoff_sim.solids.mesh import Surface

SEEDS = range(4)
NAMES = [prop.name for prop in CLUTTER]


def corners_m(batches: tuple[Batch, ...]) -> FloatArray:
    return np.concatenate([
        (batch.mesh.vertices_m @ pose[:3, :3].T + pose[:3, 3]) for batch in batches for pose in batch.poses
    ])  # fmt: skip


@pytest.mark.parametrize("prop", CLUTTER, ids=NAMES)
def test_a_thing_stands_on_the_ground_within_its_radius(prop: Prop) -> None:
    for seed in SEEDS:
        points = corners_m(prop.make(np.random.default_rng(seed)))
        assert -0.75 < points[:, 2].min() < 0.12
        assert points[:, 2].max() < 5.5
        assert np.linalg.norm(points[:, :2], axis=1).max() < 1.35 * prop.radius_m + 0.3


@pytest.mark.parametrize("prop", CLUTTER, ids=NAMES)
def test_a_thing_is_cheap_and_no_brighter_than_real_surfaces(prop: Prop) -> None:
    triangles = []
    for seed in SEEDS:
        batches = prop.make(np.random.default_rng(seed))
        triangles.append(sum(len(batch.mesh.triangles) * len(batch.poses) for batch in batches))
        for batch in batches:
            tinted = 1.0 + batch.mesh.tintable[None, :, None] * (batch.tint[:, None] - 1.0)
            albedo = batch.mesh.albedo * tinted
            assert albedo.min() >= 0.0 and albedo.max() <= 0.851
            assert np.all((batch.dust >= 0.0) & (batch.dust <= 1.0))
    assert np.mean(triangles) < 1600


@pytest.mark.parametrize("prop", CLUTTER, ids=NAMES)
def test_the_same_generator_state_makes_the_same_thing_and_another_one_another(prop: Prop) -> None:
    first, again = (prop.make(np.random.default_rng(5)) for _ in range(2))
    for one, other in zip(first, again, strict=True):
        assert one.mesh is other.mesh
        np.testing.assert_array_equal(one.poses, other.poses)
        np.testing.assert_array_equal(one.tint, other.tint)
    looks = {tuple(np.round(corners_m(prop.make(np.random.default_rng(seed))).std(axis=0), 5)) for seed in SEEDS}
    assert len(looks) > 1


@pytest.mark.parametrize("prop", CLUTTER, ids=NAMES)
def test_meshes_are_drawn_from_a_finite_set(prop: Prop) -> None:
    seen = {id(batch.mesh) for seed in range(60) for batch in prop.make(np.random.default_rng(seed))}
    assert len(seen) <= 30


@pytest.mark.parametrize("prop", CLUTTER, ids=NAMES)
def test_normals_are_of_unit_length_and_point_the_way_the_triangles_face(prop: Prop) -> None:
    for batch in prop.make(np.random.default_rng(1)):
        mesh = batch.mesh
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-4)
        a, b, c = (mesh.vertices_m[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
        facing = np.cross(b - a, c - a)
        area = np.linalg.norm(facing, axis=1)
        agree = (facing * mesh.normals[mesh.triangles].mean(axis=1)).sum(axis=1)
        assert np.all(agree[area > 1e-8] > 0.0)


def test_names_differ_and_there_are_many_families() -> None:
    assert len(set(NAMES)) == len(NAMES) >= 40


def test_a_bar_reaches_from_end_to_end() -> None:
    ends = np.array([[0.3, -1.0, 0.2], [2.0, 1.0, 1.4]])
    points = bar(ends[0], ends[1], 0.05, None, sections=8).vertices_m
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    np.testing.assert_allclose(np.ptp(points @ along), np.linalg.norm(ends[1] - ends[0]), rtol=1e-5)
    axis = np.linalg.norm(np.cross(points - ends[0], along), axis=1)
    assert axis.max() == pytest.approx(0.05, rel=1e-4)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_mound_has_its_top_near_its_middle_and_its_foot_in_the_ground(seed: int) -> None:
    mesh = mound(np.random.default_rng(seed), 2.0, 1.0, SOILS[0])
    reach = np.linalg.norm(mesh.vertices_m[:, :2], axis=1)
    assert 0.6 < mesh.vertices_m[:, 2].max() < 1.5
    assert reach[np.argmax(mesh.vertices_m[:, 2])] < 0.6
    assert mesh.vertices_m[reach > 2.1, 2].max(initial=-1.0) <= 0.0


def test_openings_are_dark_and_the_outside_is_not() -> None:
    pipe = tubular(0.5, 0.4, 2.0, (0.4, 0.4, 0.4), Surface.CONCRETE)
    inwards = (pipe.vertices_m[:, :2] * pipe.normals[:, :2]).sum(axis=1) < -0.1
    assert inwards.any() and pipe.albedo[inwards].max() < 0.15 and pipe.albedo[~inwards].min() > 0.35
    ends = open_ended(block((2.0, 1.0, 1.0), (0.5, 0.5, 0.5), Surface.PAINT), 0)
    assert np.all((ends.albedo[:, 0] < 0.1) == (np.abs(ends.normals[:, 0]) > 0.9))


def test_a_relief_faces_up_when_its_rows_run_along_x_and_its_columns_along_y() -> None:
    xy = np.stack(np.meshgrid(np.arange(4.0), np.arange(3.0), indexing="ij"), axis=-1)
    mesh = relief(np.concatenate([xy, np.zeros((4, 3, 1))], axis=-1), None, Surface.SOIL)
    np.testing.assert_allclose(mesh.normals, np.tile([0.0, 0.0, 1.0], (len(mesh.normals), 1)), atol=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_stone_is_about_a_unit_across(seed: int) -> None:
    spread = np.ptp(stone(np.random.default_rng(seed)).vertices_m, axis=0)
    assert spread.min() > 0.3 and spread.max() < 1.15


def test_litter_lies_in_its_region_on_the_ground_in_few_batches() -> None:
    region = shapely.Polygon([(0, 0), (30, 5), (20, 25), (-5, 15)])

    def height_at(xy_m: FloatArray) -> FloatArray:
        return np.asarray(0.1 * xy_m[:, 0] - 0.05 * xy_m[:, 1])

    batches = scatter_litter(np.random.default_rng(3), 2000, region, height_at)
    xyz = np.concatenate([batch.poses[:, :3, 3] for batch in batches]).astype(np.float64)
    assert len(xyz) == 2000 and len(batches) <= 24
    assert shapely.contains_xy(region.buffer(1e-4), xyz[:, 0], xyz[:, 1]).all()
    above = xyz[:, 2] - height_at(xyz[:, :2])
    assert above.min() > -1e-4 and above.max() < 0.15
    again = scatter_litter(np.random.default_rng(3), 2000, region, height_at)
    for one, other in zip(batches, again, strict=True):
        np.testing.assert_array_equal(one.poses, other.poses)


def test_litter_is_thicker_in_some_places() -> None:
    batches = scatter_litter(np.random.default_rng(0), 4000, shapely.box(0, 0, 60, 60), lambda xy: np.zeros(len(xy)))
    xy = np.concatenate([batch.poses[:, :2, 3] for batch in batches])
    counts, *_ = np.histogram2d(xy[:, 0], xy[:, 1], bins=12)
    assert counts.std() > 2.0 * np.sqrt(counts.mean())
